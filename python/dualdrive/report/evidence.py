"""What the records say: errors, overlays, where it fails, what is missing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from dualdrive.diagnose.result import Diagnosis
from dualdrive.report.markup import Html, join, percent, table, tag

if TYPE_CHECKING:
    from dualdrive.compare import Comparison, EquationAtFault
    from dualdrive.report.pictures import Gallery

__all__ = ["errors", "overlays", "shapes", "where"]

#: error of a diagnosis -> how the report calls it, in the order of the table
_ERRORS = {
    "nominal": "as given",
    "refitted": "numbers refitted",
    "held_out_refitted": "numbers refitted, cross-validated",
    "best": "with the best explanation",
    "held_out_best": "with the best explanation, cross-validated",
    "noise_floor": "noise floor: what the sensors alone leave",
}
_OF_THE_BEST = ("best", "held_out_best")
_MOST = 12  # rows of a table
_TELLING = 0.05  # share of what is missing from which a coordinate says something of it


def errors(d: Diagnosis) -> Html | None:
    """The headline error of every stage beside the noise floor."""
    floor = d.error.get("noise_floor", math.nan)
    known = {**_ERRORS, **{name: name for name in d.error if name not in _ERRORS}}
    if d.best is None:  # what stands there is the refit without one
        known = {name: text for name, text in known.items() if name not in _OF_THE_BEST}
    rows = [
        (text, percent(d.error[name]), _times(d.error[name], floor))
        for name, text in known.items()
        if name in d.error
    ]
    if not rows:
        return None
    words = (
        "RMS of simulated minus measured over the RMS of the measured signal about its mean, "
        "averaged over following error, currents or torques, and deflections."
        if d.mode == "closed_loop"
        else "RMS of what the equations of motion leave over the RMS of the measured torque about "
        "its mean."
    )
    caption = "Headline error, and how many times the noise floor it is"
    return join(
        [tag("p", words), table(("machine", "error", "× floor"), rows, caption, numbers=(1, 2))]
    )


def _times(error: float, floor: float) -> str:
    return f"{error / floor:.3g}" if floor > 0 and math.isfinite(error) else "–"


def overlays(d: Diagnosis, hung: Gallery) -> Html | None:
    """Measured and simulated over each other, before and after."""
    stages = [("numbers refitted", d.before), ("with the best explanation", d.after)]
    found = [part for text, c in stages if c is not None for part in _overlay(c, text, hung)]
    return join(found) if found else None


def _overlay(comparison: Comparison, text: str, hung: Gallery) -> list[Html]:
    from dualdrive.plots import measured_vs_model

    error = comparison.error
    head = tag("h3", f"{text[0].upper()}{text[1:]}: error {percent(error['headline'])}")
    parts = [head]
    for record in comparison.records:
        shown = [q for q in comparison.quantities if q.record == record and q.headline]
        words = "; ".join(f"{q.name}: error {percent(q.shares[0])}" for q in shown)
        alt = f"Measured and simulated channels of {record} over time, {text}. {words}."
        caption = f"{record}, {text}: measured (solid) and model (dashed)."
        parts.append(hung.hang(measured_vs_model(comparison, record=record), caption, alt, shown))
    return parts


def where(d: Diagnosis, hung: Gallery) -> Html | None:
    """Conditions under which the error is larger, the equation that does not close."""
    from dualdrive.plots import PlotError, conditions, equations

    parts: list[Html] = []
    worst = sorted((c for c in d.where if c.excess > 1.0), key=lambda c: -c.excess)
    sure = [c for c in worst if c.significant]
    if worst and not sure and not any(math.isnan(c.p) for c in worst):
        words = "Beyond chance the error is larger nowhere: what is wrong is wrong all over."
        parts.append(tag("p", words))
    if worst:
        try:
            alt = "Bars of the error under each condition over that of the whole record."
            caption = "Error under each condition over the error everywhere; 1 is average."
            parts.append(hung.hang(conditions(d), caption, alt))
        except PlotError:
            pass  # only stretches of time or lines of a spectrum: the table has them
        rows = [
            (
                c.condition,
                c.kind,
                f"{c.excess:.2f}",
                percent(c.time, ".0f"),
                percent(c.square, ".0f"),
                _chance(c.p),
            )
            for c in (sure or worst)[: _MOST if sure else _MOST // 2]
        ]
        head = ("condition", "kind", "× average", "of the time", "of the squares", "by chance")
        text = (
            "Where the error is larger than on average, the worst first. Conditions overlap: their "
            "times and squares do not add up"
        )
        parts.append(table(head, rows, text, numbers=(2, 3, 4, 5)))
    if d.equation is not None and d.equation.shares:
        alt = f"A bar for every equation of motion; {d.equation.name} is marked."
        words, caption = _at_fault(d.equation)
        parts += [tag("p", words), hung.hang(equations(d.equation), caption, alt)]
    return join(parts) if parts else None


def _at_fault(found: EquationAtFault) -> tuple[str, str]:
    """Which equation fails, in a sentence; what the bars beside it are."""
    fails = f"The equation of motion that fails is that of the {found.name.replace('_', ' ')}"
    if found.measure == "torque":
        most = (
            f"the filter asks for a torque of {found.shares[found.name]:.2g} of the drives' there"
        )
        return f"{fails}: {most}.", "Torque of unknown course over the drives' torque, by equation."
    sentence = f"{fails} (probability {percent(found.probability, '.0f')})."
    if found.measure == "probability":
        return sentence, "Probability of all laws that act in an equation, together."
    caption = (
        "What a free torque in one equation removes of the unexplained mean square. Neighbours "
        "remove each other's in part: the numbers do not add up."
    )
    return sentence, caption


def _chance(p: float) -> str:
    """Probability of so large an excess anywhere by chance alone."""
    return "–" if math.isnan(p) else "< 0.1\N{NO-BREAK SPACE}%" if p < 1e-3 else percent(p)


def shapes(d: Diagnosis, hung: Gallery) -> Html | None:
    """The missing torque along each coordinate that says something of it."""
    from dualdrive.plots import missing_torque

    shown = sorted((s for s in d.shapes if len(s.at) > 1), key=lambda s: -s.explained)
    before = hung.count
    parts = [
        hung.hang(
            missing_torque(s),
            f"What the {s.equation.replace('_', ' ')} lacks along {s.coordinate}, with its 95 % "
            f"band; a function of it alone explains {percent(s.explained, '.0f')} of the "
            "missing mean square.",
            f"Missing torque of {s.equation} from {min(s.value):.3g} to {max(s.value):.3g} "
            f"{s.unit} along {s.coordinate} from {min(s.at):.3g} to {max(s.at):.3g} "
            f"{s.coordinate_unit}.",
        )
        for s in shown
    ]
    telling = sum(s.explained >= _TELLING for s in shown) or 1
    first, rest = join(parts[:telling]), parts[telling:]
    if not rest:
        return first if parts else None
    numbers = hung.numbers(before + telling + 1)
    words = tag("summary", f"{numbers}: coordinates that explain next to nothing")
    return join([first, tag("details", words, *rest)])
