"""A closed-loop diagnosis in words that an engineer would say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from dualdrive.diagnose.decision import MissingTorque
from dualdrive.diagnose.result import Candidate, Experiment, Interval, Shape, Verdict
from dualdrive.units import human

_FEW = 3  # warnings, numbers or rivals that a paragraph can hold


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
        said.append(_unexplained(missing))
    if verdict in ("effect", "ambiguous") and candidates:
        said += _evidence(candidates)
    if verdict == "unknown":
        said += _best_of_all(candidates, shapes)
    if groups:
        said.append(f"These records can't tell apart: {'; '.join(', '.join(g) for g in groups)}.")
    if experiment is not None:
        said.append(
            f"To tell {' from '.join(experiment.separates)}, measure next: {experiment.name} "
            f"(expected distance {experiment.expected_distance:.0f}; 11 is enough)."
        )
    if verdict == "effect" and command:
        said.append(f"To add it: {command}")
    if len(warnings) > _FEW:
        said.append(f"Mind the {len(warnings)} warnings about the records.")
    elif warnings:
        said.append(f"Mind: {'; '.join(w.rstrip('.') for w in warnings)}.")
    return " ".join(said)


def _opening(
    verdict: Verdict,
    candidates: Sequence[Candidate],
    error: Mapping[str, float],
    moved: Sequence[str],
) -> str:
    nominal, refitted = _per(error.get("nominal")), _per(error.get("refitted"))
    floor = _per(error.get("noise_floor"))
    if verdict == "adequate":
        return (
            f"The machine as described meets the records: simulated error {nominal}, sensors alone "
            f"{floor}. Nothing is missing that these records could show."
        )
    if verdict == "parameters":
        which = (
            f" ({', '.join(moved[:_FEW])}{', ...' if len(moved) > _FEW else ''})" if moved else ""
        )
        return (
            f"No effect is missing, but numbers of the data sheet are off{which}: refitted, the "
            f"simulated error falls from {nominal} to {refitted}; sensors alone {floor}."
        )
    if verdict == "unfinished":
        return (
            "The search was stopped before every law had its turn: what follows is what was known "
            "until then, and no verdict."
        )
    if verdict == "unknown":
        return (
            "Something is missing that no effect of the library explains. Refitting the data "
            f"sheet's numbers leaves {refitted}; sensors alone {floor}."
        )
    best = candidates[0]
    opening = (
        f"Refitting the data sheet's numbers leaves {refitted}; with {best.label} it is "
        f"{_per(best.fitted)}, cross-validated {_per(best.held_out)} (sensors alone {floor})."
    )
    if verdict == "ambiguous":
        return f"An effect is missing, and more than one law fits. {opening}"
    return f"{best.label} is missing (probability {best.probability:.2f}). {opening}"


def _unexplained(missing: Mapping[str, MissingTorque]) -> str:
    worst = max(missing, key=lambda body: missing[body].share)
    m = missing[worst]
    return (
        f"Without it, the refitted machine leaves {100 * m.share:.2g} % of the drive torque "
        f"unexplained at the {worst.replace('_', ' ')}."
    )


def _evidence(candidates: Sequence[Candidate]) -> list[str]:
    best, *others = candidates
    numbers = [
        f"{path.rpartition('.')[2]} {_number(p)}"
        for path, p in best.parameters.items()
        if p.value != 0.0 or p.low < p.high  # what is held at nothing says nothing
    ]
    said = [f"Its numbers: {', '.join(numbers)}."] if numbers else []
    rivals = [c for c in others if c.resolved and c.probability > 0.01]
    if rivals:
        named = ", ".join(f"{c.label} ({c.probability:.2f})" for c in rivals[:_FEW])
        said.append(f"Not excluded: {named}.")
    elif others and others[0].resolved:
        said.append(f"The next best, {others[0].label}, leaves {_per(others[0].fitted)}.")
    if best.note:
        said.append(f"{best.note[0].upper()}{best.note[1:]}.")
    return said


def _best_of_all(candidates: Sequence[Candidate], shapes: Sequence[Shape]) -> list[str]:
    said = []
    resolved = [c for c in candidates if c.resolved and math.isfinite(c.explained)]
    if resolved:
        best = resolved[0]
        said.append(
            f"Best candidate: {best.label}; with it more is left than noise, so it is not named."
        )
    else:
        said.append("No candidate helps. Check signs, scales and units of the channels.")
    if shapes and shapes[0].explained > 0.3:
        s = shapes[0]
        said.append(
            f"{100 * s.explained:.0f} % of the missing torque of the {s.equation} depends only on "
            f"{s.coordinate}; a learned curve (spline) over {s.coordinate} would carry it."
        )
    return said


def _number(p: Interval) -> str:
    """Value and interval; what was counted or held has none."""
    if p.low < p.high:
        return f"{human(p.value, p.unit)} [{human(p.low, p.unit)} .. {human(p.high, p.unit)}]"
    return human(p.value, p.unit)


def _per(share: float | None) -> str:
    return "?" if share is None or not math.isfinite(share) else f"{100 * share:.3g} %"
