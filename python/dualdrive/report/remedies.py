"""What could explain it and what to do: candidates, groups, ladder, the next experiment."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dualdrive.diagnose.result import Candidate, Diagnosis
from dualdrive.readable import interval
from dualdrive.report.markup import Html, join, percent, table, tag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dualdrive.diagnose.ladder import Ladder
    from dualdrive.report.pictures import Gallery

__all__ = [
    "EXPLAINS",
    "UNJUDGED",
    "candidates",
    "experiment",
    "in_order",
    "ladder",
    "moved",
    "sizes",
]

#: what the column of that name holds, here and in the terminal
EXPLAINS = "share of the error that an arbitrary torque could remove"

#: what stands above the explanations of a search that was stopped
UNJUDGED = (
    "The search was stopped: none of these is judged, and what gains most so far may yet lose "
    "to another."
)

_MOST = 15  # rows of a table
_TELLS_APART = 11.0


def candidates(d: Diagnosis, hung: Gallery) -> Html | None:
    """Every explanation tried, with its evidence, and which can't be told apart."""
    from dualdrive.plots import candidates as draw

    shown = in_order(d)[:_MOST]
    if not shown:
        return None
    refitted = [c for c in shown if c.resolved]
    screened = [c for c in shown if not c.resolved]
    stopped = d.verdict == "unfinished"
    best = shown[0]
    alt = f"Bars of each explanation's probability; {best.label}: {best.probability:.2f}."
    caption = "Probability of every explanation; filled blue: not told from the best."
    return join(
        [
            tag("p", UNJUDGED) if stopped else None,
            _groups(d),
            hung.hang(draw(d), caption, alt) if refitted and not stopped else None,
            _refitted(refitted, stopped=stopped) if refitted else None,
            _screened(screened, stopped=stopped) if screened else None,
        ]
    )


def in_order(d: Diagnosis) -> list[Candidate]:
    """Explanations as they are listed: those judged as they rank, then the rest by their gain."""
    judged = [c for c in d.candidates if c.resolved]
    rest = [c for c in d.candidates if not c.resolved]
    return judged + sorted(rest, key=lambda c: -c.gain)


def _refitted(shown: Sequence[Candidate], *, stopped: bool) -> Html:
    """Explanations that were added to the machine, everything else refitted beside them."""
    words = (
        "Each of these was added to the machine and everything refitted. Cross-validated: headline "
        "error on parts of the fitted records that the refit did not see. Explains: its "
        f"{EXPLAINS}; explanations overlap, and these do not add up. "
        "Gain: twice the log likelihood it wins over the refitted machine."
    )
    head = ("explanation", "probability", "cross-validated", "explains", "gain", "what it takes")
    rows = [
        (
            c.label,
            "–" if stopped else f"{c.probability:.3f}" if c.probability >= 1e-3 else "< 0.001",
            percent(c.held_out),
            percent(c.explained),
            _gain(c),
            _sizes(c),
        )
        for c in shown
    ]
    caption = "Explanations refitted, the best first" if not stopped else "Refitted until then"
    marked = None if stopped else 0
    return join([tag("p", words), table(head, rows, caption, numbers=(1, 2, 3, 4), marked=marked)])


def _screened(shown: Sequence[Candidate], *, stopped: bool) -> Html:
    """Explanations that their score, or a refit that was cut, left behind."""
    words = (
        "These were not refitted to the end: their score, the slope of the likelihood where the "
        "effect is still zero, or their first steps promised less."
    )
    rows = [(c.label, _gain(c), _sizes(c) or "screened only") for c in shown]
    head = ("explanation", "gain so far" if stopped else "gain expected", "remark")
    caption = "Explanations that wait for their turn" if stopped else "Explanations screened only"
    written = table(head, rows, caption, numbers=(1,))
    return written if stopped else join([tag("p", words), written])


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
    return "; ".join(filter(None, (*sizes(c), c.note)))


def sizes(c: Candidate) -> list[str]:
    """What an explanation takes, a line each: ``torque 12 kN·m [11.9 .. 12.1 kN·m]``."""
    return [
        f"{path.rpartition('.')[2]} {interval(v.value, v.low, v.high, v.unit)}"
        for path, v in c.parameters.items()
    ]


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
    drawn = hung.hang(draw(steps, noise_floor=floor), caption, alt) if len(steps) > 1 else None
    return join(
        [
            drawn,
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
    rows = [(path, interval(v.value, v.low, v.high, v.unit)) for path, v in d.moved.items()]
    head = ("number", "refitted [95 % interval]")
    return table(head, rows, "Refitted numbers", numbers=(1,))
