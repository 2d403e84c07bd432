"""The diagnosis in words: one paragraph an engineer can act on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from dualdrive.diagnose.judge import Reason
from dualdrive.diagnose.phrases import beyond_noise, none_missing, percent
from dualdrive.diagnose.result import Candidate, Diagnosis, Shape
from dualdrive.readable import interval

#: why the best of what was tried gets no name, where its own note does not say it
_WHY: Mapping[Reason, str] = {
    "": "with it more is left than noise, so it is not named",
    "gains": "probability {probability:.2f}, too low to name it",
    "explains": "too little to name it",
    "bound": "too large to be plausible",
    "bent": "but its second law only bends the curve of the first, so the law has another shape",
    "contradicted": "but the errors printed contradict it",
    "clipped": "but a channel stands at its limit, which may do the same",
}
_FEW = 3  # numbers, rivals or warnings that a paragraph can hold
_HELPS = 0.05  # of the unexplained error: what removes less does not help
_TELLS = 0.3  # share of the missing torque from which a coordinate says something of a name
_OF_NONE = 0.05  # and below which it tells nothing at all


def paragraph(d: Diagnosis, why: Reason = "") -> str:
    """Verdict, evidence for and against, what can't be told apart, what to do, what to mind.

    d: all of it but the paragraph; why: of a balance, why the best candidate gets no name
    """
    if not d.judged:
        return f"The records can't be judged. {' '.join(d.warnings)}"
    if d.verdict == "unknown" and _loop(d) and math.isnan(d.error["noise_floor"]):
        return " ".join(["Whether anything is missing these records can't show.", *_closing(d)])
    said = [_opening(d)]
    if d.verdict in ("effect", "ambiguous", "unknown"):
        said += _unexplained(d)
    if d.best:
        said += _evidence(d, d.best)
    if d.verdict == "unknown":
        said += _unnamed(d, why)
    return " ".join([*said, *_closing(d)])


def _loop(d: Diagnosis) -> bool:
    return d.mode == "closed_loop"


def _opening(d: Diagnosis) -> str:
    errors = (d.error.get(which) for which in ("nominal", "refitted", "noise_floor"))
    nominal, refitted, floor = map(percent, errors)
    kind = "simulated error" if _loop(d) else "error"
    if d.verdict == "adequate":
        left = f"{kind} {nominal}, sensors alone {floor}."
        if beyond_noise(d.error, "nominal"):
            return (
                f"The machine as described leaves more than noise, but nothing can be named: {left}"
            )
        return (
            f"The machine as described meets the records: {left} "
            "Nothing is missing that these records could show."
        )
    if d.verdict == "parameters":
        moved = list(d.moved)
        if _loop(d) and len(moved) > _FEW:
            moved = [*moved[:_FEW], "..."]
        which = f" ({', '.join(moved)})" if moved else ""
        return (
            f"{none_missing(d.error)}, but numbers of the data sheet are off{which}: refitted, the "
            f"{kind} falls from {nominal} to {refitted}; sensors alone {floor}."
        )
    leaves = f"Refitting the data sheet's numbers leaves {refitted}; "
    if d.verdict == "unfinished":
        return (
            "The search was stopped before every law had its turn: what follows is what was known "
            f"until then, and no verdict. {leaves}sensors alone {floor}."
        )
    if d.verdict == "unknown":
        begin = "Something is missing that no effect of the library explains."
        return f"{begin} {leaves}sensors alone {floor}."
    best = d.candidates[0]
    begin = "An effect is missing, and more than one law fits."
    if d.verdict == "effect":
        begin = f"{best.label} is missing (probability {best.probability:.2f})."
    return (
        f"{begin} {leaves}with {best.label} it is {percent(best.fitted)}, "
        f"cross-validated {percent(best.held_out)} (sensors alone {floor})."
    )


def _unexplained(d: Diagnosis) -> list[str]:
    """Of a loop, the equation that asks for most torque of unknown course."""
    missing = d.missing_torque
    if not missing:
        return []
    worst = max(missing, key=lambda body: missing[body].share)
    leaves = f"leaves {100 * missing[worst].share:.2g} % of the drive torque unexplained"
    begin = "Without it, the refitted machine" if d.best else "The refitted machine"
    return [f"{begin} {leaves} at the {worst.replace('_', ' ')}."]


def _evidence(d: Diagnosis, best: Candidate) -> list[str]:
    numbers = [
        f"{path.rpartition('.')[2]} {interval(p.value, p.low, p.high, p.unit)}"
        for path, p in best.parameters.items()
        if p.value != 0.0 or p.low < p.high  # what is held at nothing says nothing
    ]
    said = [f"Its numbers: {', '.join(numbers)}."] if numbers else []
    if math.isfinite(best.explained):
        said.append(f"It removes {100 * best.explained:.0f} % of the unexplained error.")
    if not _loop(d) and d.shapes and d.shapes[0].explained > _TELLS:
        said += _depends(d.shapes)
    others = [c for c in d.candidates[1:] if c.resolved]
    rivals = [f"{c.label} ({c.probability:.2f})" for c in others if c.probability > 0.01]
    if rivals:
        said.append(f"Not excluded: {', '.join(rivals[:_FEW])}.")
    elif others:
        said.append(f"The next best, {others[0].label}, leaves {percent(others[0].fitted)}.")
    if best.note:
        said.append(f"{best.note[0].upper()}{best.note[1:]}.")
    return said


def _unnamed(d: Diagnosis, why: Reason) -> list[str]:
    said = []
    tried = [c for c in d.candidates if math.isfinite(c.explained)]
    if tried and max(c.explained for c in tried) >= _HELPS:
        best = tried[0]
        reason = _WHY[why].format(probability=best.probability)
        if best.note and why in ("", "bound"):
            reason = best.note
        said.append(
            f"Best candidate: {best.label}; removes {100 * best.explained:.0f} % of the "
            f"unexplained error; {reason}."
        )
    elif _loop(d):
        said.append("No candidate helps. Check signs, scales and units of the channels.")
    elif tried:
        said.append("No candidate helps. Check sign and scale of the torques.")
    if d.equation is not None and not _loop(d):
        said.append(f"The equation that does not close is that of the {d.equation.name}.")
    return [*said, *_depends(d.shapes)]


def _depends(shapes: Sequence[Shape]) -> list[str]:
    """What the missing torque depends on most, and what that looks like."""
    if not shapes:
        return []
    s = shapes[0]
    if s.explained < _OF_NONE:
        return ["The missing torque depends on none of the coordinates that were tried."]
    share = f"{100 * s.explained:.0f} % of the missing torque of the {s.equation.replace('_', ' ')}"
    if s.coordinate == "direction":
        return [f"{share} depends only on the sign of the speed, as dry friction does."]
    return [f"{share} depends only on the {s.coordinate}."]


def _closing(d: Diagnosis) -> list[str]:
    """What can't be told apart, what to do, what to mind."""
    said, plan = [], d.next_experiment
    if d.verdict == "ambiguous" and d.groups:
        alike = "; ".join(", ".join(group) for group in d.groups)
        said.append(f"These records can't tell apart: {alike}.")
    if plan is not None:
        said.append(
            f"To tell {' from '.join(plan.separates)}, measure next: {plan.name} "
            f"(expected distance {plan.expected_distance:.0f}; 11 is enough)."
        )
    if d.verdict == "effect" and d.command:
        said.append(f"To add it: {d.command}")
    if len(d.warnings) > _FEW:
        said.append(f"Mind the {len(d.warnings)} warnings about the records.")
    elif d.warnings:
        said.append(f"Mind: {'; '.join(w.rstrip('.') for w in d.warnings)}.")
    return said
