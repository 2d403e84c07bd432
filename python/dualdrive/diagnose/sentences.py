"""A closed-loop diagnosis in words that an engineer would say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from dualdrive.diagnose.decision import MissingTorque
from dualdrive.diagnose.phrases import (
    HELPS,
    as_described,
    closing,
    depends,
    none_missing,
    percent,
    unfinished,
)
from dualdrive.diagnose.result import Candidate, Experiment, Shape, Verdict
from dualdrive.readable import interval

_FEW = 3  # numbers or rivals that a paragraph can hold


def paragraph(
    verdict: Verdict,
    candidates: Sequence[Candidate],
    groups: Sequence[Sequence[str]],
    error: Mapping[str, float],
    missing: Mapping[str, MissingTorque],
    shapes: Sequence[Shape],
    experiment: Experiment | None,
    warnings: Sequence[str],
    command: str,
    moved: Sequence[str],
) -> str:
    """Verdict, evidence for and against, what can't be told apart, and what to do."""
    said = [_opening(verdict, candidates, error, moved)]
    if verdict in ("effect", "ambiguous", "unknown") and missing:
        said.append(_unexplained(missing, named=verdict != "unknown"))
    if verdict in ("effect", "ambiguous") and candidates:
        said += _evidence(candidates)
    if verdict == "unknown":
        said += _best_of_all(candidates, shapes)
    said += closing(groups, experiment, command if verdict == "effect" else "", warnings)
    return " ".join(said)


def _opening(
    verdict: Verdict,
    candidates: Sequence[Candidate],
    error: Mapping[str, float],
    moved: Sequence[str],
) -> str:
    nominal, refitted = percent(error.get("nominal")), percent(error.get("refitted"))
    floor = percent(error.get("noise_floor"))
    if verdict == "adequate":
        return as_described(error, "simulated error")
    if verdict == "parameters":
        which = (
            f" ({', '.join(moved[:_FEW])}{', ...' if len(moved) > _FEW else ''})" if moved else ""
        )
        return (
            f"{none_missing(error)}, but numbers of the data sheet are off{which}: refitted, the "
            f"simulated error falls from {nominal} to {refitted}; sensors alone {floor}."
        )
    if verdict == "unfinished":
        return unfinished(refitted, floor)
    if verdict == "unknown":
        return (
            "Something is missing that no effect of the library explains. Refitting the data "
            f"sheet's numbers leaves {refitted}; sensors alone {floor}."
        )
    best = candidates[0]
    opening = (
        f"Refitting the data sheet's numbers leaves {refitted}; with {best.label} it is "
        f"{percent(best.fitted)}, cross-validated {percent(best.held_out)} (sensors alone {floor})."
    )
    if verdict == "ambiguous":
        return f"An effect is missing, and more than one law fits. {opening}"
    return f"{best.label} is missing (probability {best.probability:.2f}). {opening}"


def _unexplained(missing: Mapping[str, MissingTorque], *, named: bool) -> str:
    worst = max(missing, key=lambda body: missing[body].share)
    leaves = f"leaves {100 * missing[worst].share:.2g} % of the drive torque unexplained"
    begin = "Without it, the refitted machine" if named else "The refitted machine"
    return f"{begin} {leaves} at the {worst.replace('_', ' ')}."


def _evidence(candidates: Sequence[Candidate]) -> list[str]:
    best, *others = candidates
    numbers = [
        f"{path.rpartition('.')[2]} {interval(p.value, p.low, p.high, p.unit)}"
        for path, p in best.parameters.items()
        if p.value != 0.0 or p.low < p.high  # what is held at nothing says nothing
    ]
    said = [f"Its numbers: {', '.join(numbers)}."] if numbers else []
    if math.isfinite(best.explained):
        said.append(f"It removes {100 * best.explained:.0f} % of the unexplained error.")
    rivals = [c for c in others if c.resolved and c.probability > 0.01]
    if rivals:
        named = ", ".join(f"{c.label} ({c.probability:.2f})" for c in rivals[:_FEW])
        said.append(f"Not excluded: {named}.")
    elif others and others[0].resolved:
        said.append(f"The next best, {others[0].label}, leaves {percent(others[0].fitted)}.")
    if best.note:
        said.append(f"{best.note[0].upper()}{best.note[1:]}.")
    return said


def _best_of_all(candidates: Sequence[Candidate], shapes: Sequence[Shape]) -> list[str]:
    said = []
    resolved = [c for c in candidates if c.resolved and math.isfinite(c.explained)]
    if resolved and max(c.explained for c in resolved) >= HELPS:
        best = resolved[0]
        reason = best.note or "with it more is left than noise, so it is not named"
        said.append(
            f"Best candidate: {best.label}; removes {100 * best.explained:.0f} % of the "
            f"unexplained error; {reason}."
        )
    else:
        said.append("No candidate helps. Check signs, scales and units of the channels.")
    return [*said, *filter(None, [depends(shapes)])]
