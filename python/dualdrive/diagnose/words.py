"""The diagnosis in words: one paragraph an engineer can act on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from dualdrive.compare.equation import EquationAtFault
from dualdrive.diagnose.judge import Judgement, Reason
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

#: why the best of what was tried gets no name
_WHY: dict[Reason, str] = {
    "": "too little to name it",
    "gains": "probability {probability:.2f}, too low to name it",
    "explains": "too little to name it",
    "bound": "{bound}",
    "bent": "but its second law only bends the curve of the first, so the law has another shape",
    "contradicted": "but the errors printed contradict it",
    "clipped": "but a channel stands at its limit, which may do the same",
}
_TELLS = 0.3  # share of the missing torque from which a coordinate says something of a name


def paragraph(
    judged: Judgement,
    candidates: Sequence[Candidate],
    groups: Sequence[Sequence[str]],
    error: Mapping[str, float],
    equation: EquationAtFault | None,
    shapes: Sequence[Shape],
    experiment: Experiment | None,
    warnings: Sequence[str],
    command: str,
    moved: Sequence[str],
) -> str:
    """Verdict, evidence for and against, what can't be told apart, and what to do."""
    if warnings and not candidates and not error:
        return f"The records can't be judged: {' '.join(warnings)}"
    verdict = judged.verdict
    said = [_opening(verdict, candidates, error, moved)]
    if verdict in ("effect", "ambiguous") and candidates:
        said += _evidence(candidates, shapes)
    if verdict == "unknown":
        said += _unexplained(judged.why, candidates, equation, shapes)
    alike = groups if verdict == "ambiguous" else ()
    said += closing(alike, experiment, command if verdict == "effect" else "", warnings)
    return " ".join(said)


def _opening(
    verdict: Verdict,
    candidates: Sequence[Candidate],
    error: Mapping[str, float],
    moved: Sequence[str],
) -> str:
    refitted, floor = percent(error.get("refitted")), percent(error.get("noise_floor"))
    nominal = percent(error.get("nominal"))
    if verdict == "adequate":
        return as_described(error)
    if verdict == "parameters":
        which = f" ({', '.join(moved)})" if moved else ""
        return (
            f"{none_missing(error)}, but numbers of the data sheet are off{which}: refitted, the "
            f"error falls from {nominal} to {refitted}; sensors alone {floor}."
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


def _evidence(candidates: Sequence[Candidate], shapes: Sequence[Shape]) -> list[str]:
    best, *others = candidates
    numbers = [
        f"{path.rpartition('.')[2]} {interval(p.value, p.low, p.high, p.unit)}"
        for path, p in best.parameters.items()
        if p.value != 0.0 or p.low < p.high  # what is held at nothing says nothing
    ]
    said = [f"Its numbers: {', '.join(numbers)}."] if numbers else []
    said.append(f"It removes {100 * best.explained:.0f} % of the unexplained error.")
    if shapes and shapes[0].explained > _TELLS:
        said.append(depends(shapes))
    others = [c for c in others if c.resolved]
    rivals = [c for c in others if c.probability > 0.01]
    if rivals:
        named = ", ".join(f"{c.label} ({c.probability:.2f})" for c in rivals[:3])
        said.append(f"Not excluded: {named}.")
    elif others:
        said.append(f"The next best, {others[0].label}, leaves {percent(others[0].fitted)}.")
    if best.note:
        said.append(f"{best.note[0].upper()}{best.note[1:]}.")
    return said


def _unexplained(
    why: Reason,
    candidates: Sequence[Candidate],
    equation: EquationAtFault | None,
    shapes: Sequence[Shape],
) -> list[str]:
    said = []
    tried = [c for c in candidates if math.isfinite(c.explained)]
    if tried and max(c.explained for c in tried) < HELPS:
        said.append("No candidate helps. Check sign and scale of the torques.")
    elif tried:
        best = tried[0]
        reason = _WHY[why].format(
            probability=best.probability, bound=best.note or "too large to be plausible"
        )
        said.append(
            f"Best candidate: {best.label}; removes {100 * best.explained:.0f} % of the "
            f"unexplained error; {reason}."
        )
    if equation is not None:
        said.append(f"The equation that does not close is that of the {equation.name}.")
    return [*said, *filter(None, [depends(shapes)])]
