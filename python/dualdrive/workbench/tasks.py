"""What a job does, each by the functions that the other verbs call; nothing is computed here.

A task gets the job's folder, its request and somebody to tell of progress, writes its results into
the folder, and returns what the project remembers of it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from dualdrive.files import FileError, read_text, write_atomically
from dualdrive.machine import Machine
from dualdrive.machine_file import preset_names
from dualdrive.toml_text import parse_toml
from dualdrive.traces import Trace, TraceMap, read_parts
from dualdrive.workbench import keep, views
from dualdrive.workbench.series import write_store

__all__ = ["FOREIGN", "TASKS", "warm_up"]

#: what tasks import, in the order in which a page that has just opened asks for it
_NEEDED: Final = (
    "pandas", "tomlkit", "dualdrive.compare", "scipy.special", "scipy.linalg", "scipy.optimize",
    "scipy.interpolate", "scipy.stats", "scipy.signal", "dualdrive.simulation", "dualdrive.linear",
    "dualdrive.diagnose", "pint",
)  # fmt: skip
Request = Mapping[str, Any]
Tell = Callable[..., None]


def warm_up() -> Iterator[None]:
    """Load what tasks need, step by step: a recording is read before all is there."""
    for module in _NEEDED:
        import_module(module)
        yield


def read(folder: Path, request: Request, tell: Tell) -> dict[str, Any]:
    """Read a recording into a store; what was amiss, and what a machine has against it."""
    told = request["trace"]
    tell(f"reading {told['name']}")
    parts = parts_of(told)
    tell("preparing it for the screen")
    write_store(folder / "series", {name: _columns(part) for name, part in parts.items()})
    return {
        "records": {name: views.record(part) for name, part in parts.items()},
        "warnings": _warnings(request.get("machine"), parts),
    }


def propose(folder: Path, request: Request, tell: Tell) -> dict[str, Any]:
    """Propose which column is which channel, with reasons."""
    from dualdrive.traces import propose as proposed

    tell("looking at its columns")
    return {"proposal": views.proposal(proposed(Path(request["trace"]["path"])))}


def machine(folder: Path, request: Request, tell: Tell) -> dict[str, Any]:
    """Check a machine file, and write it as one that rests on no other."""
    text = request["preset"] if request.get("preset") else None
    if text is not None:
        found = Machine.load(text)
    else:
        source = read_text(Path(request["path"]))
        base = parse_toml(source).get("base")
        if base is not None and base not in preset_names():
            raise FileError(
                f"{request['name']}: base = {str(base)[:60]!r}: a machine of the workbench rests "
                "on a preset or on nothing; `dualdrive machine show` writes it as one file"
            )
        found = Machine.from_toml(source, request["name"])
    _write(folder / "machine.toml", found.toml())
    return {"machine": views.machine(found)}


def compare(folder: Path, request: Request, tell: Tell) -> dict[str, Any]:
    """Hold a machine against what is fitted and against what is held out."""
    m = machine_of(request)
    for label in request.get("without", ()):
        m.remove(label)
    found: dict[str, Any] = {"without": list(request.get("without", ()))}
    for role in ("fit", "held_out"):
        traces = records_of(request, role)
        if traces:
            tell(f"simulating {', '.join(traces)}" if len(traces) < 4 else "simulating")
            found[role] = views.compared(m, traces, folder / role, request["mode"])
    _write_json(folder / "view.json", found)
    roles = [role for role in ("fit", "held_out") if role in found]
    return {
        "error": {role: found[role]["error"] for role in roles},
        "mode": found[roles[0]]["mode"] if roles else request["mode"],
    }


def diagnose(folder: Path, request: Request, tell: Tell) -> dict[str, Any]:
    """Say what is missing; see :func:`dualdrive.diagnose.diagnose`."""
    from dualdrive.diagnose import diagnose as diagnosed

    m, traces = machine_of(request), records_of(request, "fit")
    found = diagnosed(m, traces, effort=request["effort"], progress=tell)
    keep.save(found, folder, "diagnosis")
    _write_json(folder / "view.json", views.diagnosis(found, m))
    return {
        "verdict": found.verdict,
        "paragraph": found.paragraph,
        "mode": _judged(m, traces, found),
    }


def add(folder: Path, request: Request, tell: Tell) -> dict[str, Any]:
    """Add a candidate of a diagnosis and refit, or take the refitted numbers alone."""
    from dualdrive.workbench.adding import added

    d = keep.load(Path(request["diagnosis"]), "diagnosis")
    _write(folder / "refitted.toml", _noted(d.refitted, "numbers refitted", d).toml())
    kept = ""
    if request.get("label"):
        grown = added(d, request["label"], records_of(request, "fit"), progress=tell)
        said = [entry["change"] for entry in grown.history[len(d.refitted.history) :]]
        _write(folder / "added.toml", _noted(grown, f"added {request['label']}", d).toml())
        kept = next((line for line in said if "those that the diagnosis found" in line), "")
    return {"label": request.get("label"), "said": kept}


def report(folder: Path, request: Request, tell: Tell) -> dict[str, Any]:
    """Write the page that `dualdrive report` writes."""
    from dualdrive.diagnose import Ladder, Step
    from dualdrive.report import Provenance, page

    d = keep.load(Path(request["diagnosis"]), "diagnosis")
    tell("drawing the report")
    steps = [
        Step(
            s["label"],
            _or_nan(s["fitted"]),
            _or_nan(s["held_out"]),
            _or_nan(s["noise_floor"]),
            s["command"],
            Machine.from_toml(read_text(Path(s["machine"])), s["label"]),
        )
        for s in request["steps"]
    ]
    ladder = Ladder(steps, [d], request["stopped"], request["held"], d.seconds) if steps else None
    origin = Provenance.of(
        steps[0].machine if steps else d.refitted,
        [t["path"] for t in request["traces"]],
        improved=steps[-1].machine if len(steps) > 1 else None,
        commands=request["commands"],
    )
    _write(folder / "report.html", page(d, ladder=ladder, provenance=origin))
    return {}


def climb(folder: Path, request: Request, tell: Tell) -> dict[str, Any]:
    """Diagnose, add and refit until nothing nameable is left, as `dualdrive improve` does."""
    from dualdrive.diagnose import improve

    held = records_of(request, "held_out")
    m = machine_of(request)
    found = improve(
        m,
        records_of(request, "fit"),
        held or None,
        effort=request["effort"],
        progress=tell,
    )
    steps = []
    for k, step in enumerate(found.steps[1:], 1):
        _write(folder / f"step{k}.toml", step.machine.toml())
        steps.append({"label": step.label, "file": f"step{k}.toml"})
    if found.diagnoses:
        keep.save(found.diagnoses[-1], folder, "diagnosis")
        _write_json(folder / "view.json", views.diagnosis(found.diagnoses[-1], m))
    last = found.diagnoses[-1] if found.diagnoses else None
    return {
        "steps": steps,
        "stopped": found.stopped,
        "diagnosed": last is not None,
        "mode": _judged(m, records_of(request, "fit"), last) if last is not None else "auto",
    }


# --- what tasks share -----------------------------------------------------------------------------


def machine_of(request: Request) -> Machine:
    """The machine that a request names."""
    path = Path(request["machine"])
    return Machine.from_toml(read_text(path), path.stem)


def parts_of(told: Mapping[str, Any]) -> dict[str, Trace]:
    """The parts of one recording, those that are wanted, by name."""
    from dualdrive.traces.mapping_file import mapping_from

    mapping: TraceMap | None = mapping_from(told["map"], told["name"]) if told["map"] else None
    path = Path(told["path"])
    found = {
        told["name"] + part.name.removeprefix(path.stem): part for part in read_parts(path, mapping)
    }
    wanted = told.get("parts")
    return {n: p for n, p in found.items() if n in wanted} if wanted else found


def records_of(request: Request, role: str) -> dict[str, Trace]:
    """Every part of every recording of a role."""
    own = [told for told in request["traces"] if told["role"] == role]
    return {name: part for told in own for name, part in parts_of(told).items()}


def _columns(part: Trace) -> tuple[Any, dict[str, tuple[Any, str, str]]]:
    return part.t, {n: (part[n], part.units[n], part.long_names[n]) for n in part}


def _judged(m: Machine, traces: Mapping[str, Trace], found: Any) -> str:
    """The mode of a diagnosis; ``auto`` where it is the one that a comparison takes by itself."""
    from dualdrive.identify import which_mode

    return "auto" if found.mode == which_mode(m.core, traces, None) else str(found.mode)


def _warnings(path: str | None, parts: Mapping[str, Trace]) -> list[str]:
    """What a machine has against recordings: swapped, flipped, clipped, late channels."""
    if path is None:
        return []
    from dualdrive.compare import check_records

    try:
        m = machine_of({"machine": path})
        return [w.message for w in check_records(m, parts)]
    except (ValueError, RuntimeError) as error:
        return [str(error)]


def _noted(m: Machine, change: str, d: Any) -> Machine:
    """The machine with a line in its history."""
    m.note(f"{change}, {d.fitted_to}", "dualdrive workbench")
    return m


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else value


def _write(path: Path, text: str) -> None:
    with write_atomically(path) as temporary:
        temporary.write_text(text, "utf-8")


def _write_json(path: Path, content: Any) -> None:
    _write(path, json.dumps(content, allow_nan=False, ensure_ascii=False))


TASKS: Final[dict[str, Callable[[Path, Request, Tell], dict[str, Any]]]] = {
    "read": read,
    "preview": read,
    "propose": propose,
    "machine": machine,
    "compare": compare,
    "diagnose": diagnose,
    "add": add,
    "climb": climb,
    "report": report,
}
#: tasks that look at files for the first time: they get a limit of memory
FOREIGN: Final = ("read", "preview", "propose", "machine")
