"""How the report was made: commands, records with their hashes, machine files, versions."""

from __future__ import annotations

from dualdrive.diagnose.result import Diagnosis
from dualdrive.report.markup import Html, join, table, tag
from dualdrive.report.provenance import Provenance

__all__ = ["origin"]


def origin(d: Diagnosis, found: Provenance | None) -> Html:
    """All that makes the report again."""
    found = found or Provenance()
    how = {"closed_loop": "closed loop simulated", "balance": "torque balance"}.get(d.mode, d.mode)
    commands = [*found.commands, *([d.command] if d.command not in ("", *found.commands) else [])]
    parts = [tag("p", f"Mode: {how}. Computed in {d.seconds:.3g} s.")]
    if commands:
        parts += [tag("h3", "Commands"), tag("pre", "\n".join(commands), tabindex="0")]
    if found.sources:
        rows = [(s.name, f"{s.size:,}".replace(",", " "), s.sha256) for s in found.sources]
        parts.append(table(("file", "bytes", "SHA-256"), rows, "Records", numbers=(1,)))
    for title, text in found.machines.items():
        summary = tag("summary", f"Machine file, {title}")
        parts.append(tag("details", summary, tag("pre", text, tabindex="0")))
    if found.versions:
        versions = ", ".join(f"{name} {text}" for name, text in found.versions.items())
        parts.append(tag("p", f"{versions}. Made {found.made}.", class_="fine"))
    return join(parts)
