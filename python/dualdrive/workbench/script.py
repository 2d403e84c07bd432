"""The Python script that does the same as the clicks: from the first model to the last rung."""

from __future__ import annotations

from typing import Any

__all__ = ["script"]

_HEAD = '''\
"""What was done in the workbench, as a script. Run it in the project's folder."""

from pathlib import Path

import dualdrive
from dualdrive.traces import read_parts
from dualdrive.traces.mapping_file import mapping_from
from dualdrive.workbench.adding import added

HERE = Path(__file__).parent


def parts(name, path, mapping, wanted=None):
    """The parts of a recording by name, as the workbench calls them."""
    path = HERE / path
    mapping = mapping_from(mapping, name) if mapping else None
    found = {name + p.name.removeprefix(path.stem): p for p in read_parts(path, mapping)}
    return {n: p for n, p in found.items() if wanted is None or n in wanted}

'''


def script(now: dict[str, Any]) -> str:
    """The text of the script for a state of a project."""
    lines = [_HEAD]
    for role in ("fit", "held_out"):
        lines.append(f"{role} = {{}}")
        for t in now["traces"]:
            if t["role"] == role:
                wanted = f", {t['parts']!r}" if t["parts"] else ""
                lines.append(f"{role} |= parts({t['name']!r}, {t['path']!r}, {t['map']!r}{wanted})")
    steps = now["steps"]
    if not steps:
        return "\n".join([*lines, ""])
    lines += [
        "",
        f"machine = dualdrive.Machine.load(HERE / {steps[0]['file']!r})",
        'mode = "auto"  # of comparisons: as the last diagnosis judged',
        "print(dualdrive.compare.compare(machine, fit, mode).table())",
    ]
    for step in steps[1:]:
        lines += _rung(step)
    diagnosis = now["diagnosis"]
    looked = diagnosis is not None and diagnosis["step"] == steps[-1]["id"]
    if looked and not steps[-1]["how"].startswith("improve: "):
        lines += _diagnosed(diagnosis["effort"])
    lines += [
        "",
        "if held_out:",
        "    print(dualdrive.compare.compare(machine, held_out, mode).table())",
        'machine.save(HERE / "rebuilt.toml", overwrite=True)',
    ]
    return "\n".join([*lines, ""])


def _diagnosed(effort: str) -> list[str]:
    return [
        "",
        f"found = dualdrive.diagnose.diagnose(machine, fit, effort={effort!r})",
        "print(found.paragraph)",
        '(HERE / "rebuilt.html").write_text(dualdrive.report.page(found), "utf-8")',
    ]


def _rung(step: dict[str, Any]) -> list[str]:
    effort = step["effort"]
    if step["how"] == "refitted":
        return [*_diagnosed(effort), "machine, mode = found.refitted, found.mode"]
    if step["how"].startswith("improve: "):
        return [
            "",
            f"# {step['label']}: a rung of dualdrive.diagnose.improve(",
            f"#     machine, fit, held_out or None, effort={effort!r})",
            f"machine = dualdrive.Machine.load(HERE / {step['file']!r})",
        ]
    return [
        "",
        f"machine = added(found, {step['how']!r}, fit)",
        "compared = dualdrive.compare.compare(machine, fit, mode)",
        f"print({step['label']!r}, compared.error['headline'])",
    ]
