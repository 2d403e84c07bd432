"""What could explain it and what to do: candidates, groups, ladder, the next experiment."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dualdrive.diagnose.result import Candidate, Diagnosis, Interval
from dualdrive.report.markup import Html, join, number, percent, table, tag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dualdrive.diagnose.ladder import Ladder
    from dualdrive.report.pictures import Gallery

__all__ = ["candidates", "experiment", "ladder", "moved"]

_MOST = 15  # rows of a table
_TELLS_APART = 11.0


def candidates(d: Diagnosis, hung: Gallery) -> Html | None:
    """Every explanation tried, with its evidence, and which can't be told apart."""
    from dualdrive.plots import candidates as draw

    if not d.candidates:
        return None
    shown = list(d.candidates)[:_MOST]
    refitted = [c for c in shown if c.resolved]
    screened = [c for c in shown if not c.resolved]
    best = d.candidates[0]
    alt = f"Bars of each explanation's probability; {best.label}: {best.probability:.2f}."
    caption = "Probability of every explanation; filled blue: not told from the best."
    return join(
        [
            _groups(d),
            hung.hang(draw(d), caption, alt),
            _refitted(refitted) if refitted else None,
            _screened(screened) if screened else None,
        ]
    )


def _refitted(shown: Sequence[Candidate]) -> Html:
    """Explanations that were added to the machine, everything else refitted beside them."""
    words = (
        "Each of these was added to the machine and everything refitted. Held out: headline error "
        "on samples the refit did not see. Explains: what it removes of the error that an "
        "arbitrary torque could remove; explanations overlap, and these do not add up. Gain: twice "
        "the log likelihood it wins over the refitted machine."
    )
    head = ("explanation", "probability", "held out", "explains", "gain", "what it takes")
    rows = [
        (
            c.label,
            f"{c.probability:.3f}" if c.probability >= 1e-3 else "< 0.001",
            percent(c.held_out),
            percent(c.explained),
            _gain(c),
            _sizes(c),
        )
        for c in shown
    ]
    caption = "Explanations refitted, the best first"
    return join([tag("p", words), table(head, rows, caption, numbers=(1, 2, 3, 4), marked=0)])


def _screened(shown: Sequence[Candidate]) -> Html:
    """Explanations that their score, or a refit that was cut, left behind."""
    words = (
        "These were not refitted to the end: their score, the slope of the likelihood where the "
        "effect is still zero, or their first steps promised less."
    )
    rows = [(c.label, _gain(c), _sizes(c) or "screened only") for c in shown]
    head = ("explanation", "gain expected", "remark")
    return join([tag("p", words), table(head, rows, "Explanations screened only", numbers=(1,))])


def _gain(c: Candidate) -> str:
    return f"{c.gain:z,.0f}".replace(",", " ")


def _groups(d: Diagnosis) -> Html | None:
    if not d.groups:
        return None
    listed = (tag("li", ", ".join(group)) for group in d.groups)
    return tag(
        "div", tag("p", "This record can't tell apart:"), tag("ul", *listed), class_="groups"
    )


def _sizes(c: Candidate) -> str:
    sizes = "; ".join(
        f"{path.rpartition('.')[2]} {_interval(v)}" for path, v in c.parameters.items()
    )
    return "; ".join(filter(None, (sizes, c.note)))


def _interval(v: Interval) -> str:
    if v.low == v.high:  # counted, not fitted
        return number(v.value, v.unit)
    return f"{number(v.value, v.unit)} ({number(v.low, v.unit)} … {number(v.high, v.unit)})"


def _steps(found: Ladder) -> Html | None:
    """The commands behind the steps, where a step has one."""
    commands = [step.command for step in found.steps if step.command]
    return tag("pre", "\n".join(commands), tabindex="0") if commands else None


def ladder(found: Ladder | None, hung: Gallery) -> Html | None:
    """How the error fell, step by step, and why it stopped."""
    from dualdrive.plots import ladder as draw

    if found is None or not found.steps:
        return None
    steps, floor = list(found.steps), found.steps[-1].noise_floor
    rows = [
        (s.label, percent(s.fitted), percent(s.held_out), percent(s.noise_floor)) for s in steps
    ]
    first, last = steps[0], steps[-1]
    alt = (
        f"Error of every step: {percent(first.fitted)} at first ({first.label}), "
        f"{percent(last.fitted)} at last ({last.label}); noise floor {percent(floor)}."
    )
    caption = "Error after each step, on fitted and on held-out records, down to the noise floor."
    head = ("step", "fitted", "held out", "noise floor")
    return join(
        [
            hung.hang(draw(steps, noise_floor=floor), caption, alt),
            table(head, rows, "The ladder", numbers=(1, 2, 3), marked=len(rows) - 1),
            tag("p", f"Held out: {found.held}. It stopped there: {found.stopped}."),
            _steps(found),
        ]
    )


def experiment(d: Diagnosis, hung: Gallery) -> Html | None:
    """The experiment that parts the leading rivals, ready to be typed."""
    from dualdrive.plots import experiments, planned_motion

    best = d.next_experiment
    if best is None:
        return None
    a, b = best.separates
    verdict = "tells" if best.expected_distance >= _TELLS_APART else "goes some way to tell"
    words = [
        tag("strong", best.name),
        f" {verdict} {a} from {b}: expected distance {best.expected_distance:.3g}, where "
        f"{_TELLS_APART:g} is right in 95 % of cases. {best.why[:1].upper()}{best.why[1:]}.",
    ]
    settings = "; ".join(f"{path} = {value:g}" for path, value in best.settings.items())
    linear = getattr(d.refitted, "axis", "rotary") == "linear"
    alt = f"Commanded position and speed over time: {best.motion}."
    parts = [
        tag("p", *words),
        tag("p", f"Set for it: {settings}.") if settings else None,
        tag("p", "Motion, in words of ", tag("code", "--motion"), ": ", tag("code", best.motion)),
        tag("pre", "\n".join(best.commands), tabindex="0") if best.commands else None,
        hung.hang(planned_motion(best, linear=linear), "The motion to command.", alt),
    ]
    if best.other:
        alt = f"Bars of expected distances of every experiment; {best.name} is suggested."
        caption = f"Expected distance of {a} and {b} under each experiment of the menu."
        parts.append(hung.hang(experiments(best), caption, alt))
    return join(parts)


def moved(d: Diagnosis) -> Html | None:
    """Nominal numbers that the refit moved, with intervals."""
    if not d.moved:
        return None
    rows = [
        (path, number(v.value, v.unit), f"{number(v.low, v.unit)} … {number(v.high, v.unit)}")
        for path, v in d.moved.items()
    ]
    return table(("number", "refitted", "95 % interval"), rows, "Refitted numbers", numbers=(1, 2))
