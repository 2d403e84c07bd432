"""What a diagnosis found: the shape of what is missing, who explains it, what parts the rivals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.record import PlotError
from dualdrive.plots.style import (
    COMMAND,
    FIRST,
    LIMIT,
    MEASURED,
    MODEL,
    NOISE,
    SECOND,
    figure_of,
    new_axes,
    picture,
    scale,
    single,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.diagnose import Diagnosis, EquationAtFault, Experiment, Shape

__all__ = [
    "candidates",
    "diagnosed",
    "equations",
    "experiments",
    "missing_torque",
    "planned_motion",
]

Array = NDArray[np.float64]

_MOST: Final = 10  # bars
_FEW: Final = 3  # points of a shape that are no line
#: what speaks against an equation
_AGAINST: Final = {
    "explained": "unexplained mean square that a free torque there removes (neighbours overlap)",
    "probability": "probability of the laws that act there",
    "torque": "torque of unknown course there, over the drives' torque",
}
_TELLS_APART: Final = 11.0  # squared distance at which two explanations are told apart in 95 %


@picture
def missing_torque(shape: Shape, *, axes: Axes | None = None) -> Figure:
    """What one equation of motion lacks along one coordinate, with its 95 % band.

    Raises PlotError for a shape of fewer than two points.
    """
    if len(shape.at) < 2:
        raise PlotError(f"missing torque of {shape.equation}: {len(shape.at)} points; needs two")
    axes = single(axes, 7.0, 3.2)
    across, up = scale(shape.coordinate_unit, shape.at), scale(shape.unit, shape.value)
    x = across(shape.at)
    if len(x) > _FEW:
        edges = up(shape.low), up(shape.high)
        axes.fill_between(x, *edges, color=NOISE, alpha=0.6, lw=0, label="95 %")
        axes.plot(x, up(shape.value), color=FIRST, lw=1.6, label="missing")
        axes.margins(y=0.08)
    else:  # a few places, such as the two directions, and nothing in between
        reach = [up(shape.value - shape.low), up(shape.high - shape.value)]
        look = {"color": FIRST, "ecolor": COMMAND, "marker": "o", "ls": "none", "capsize": 4}
        axes.errorbar(x, up(shape.value), reach, label="missing, 95 %", **look)  # type: ignore[arg-type]
        axes.margins(x=0.3, y=0.15)
        axes.set_xticks(x)
    axes.axhline(0, color=LIMIT, lw=0.8)
    axes.set_xlabel(across.label(shape.coordinate))
    axes.set_ylabel(up.label("missing"))
    axes.set_title(
        f"{shape.equation}, along {shape.coordinate}: explains {100 * shape.explained:.0f} %",
        fontsize=9.5,
    )
    axes.legend(loc="best")
    return figure_of(axes)


@picture
def candidates(diagnosis: Diagnosis, *, most: int = _MOST, axes: Axes | None = None) -> Figure:
    """Probability of every explanation, the best first, with its held-out error.

    Filled are those that this record can't tell from the best; hollow those whose refit failed or
    was cut.

    Raises PlotError where there is no candidate.
    """
    shown = list(diagnosis.candidates)[:most]
    if not shown:
        raise PlotError("candidates: the diagnosis names none")
    axes = single(axes, 8.0, 0.9 + 0.3 * len(shown))
    alike = _alike(diagnosis)
    for row, c in enumerate(shown):
        colour = FIRST if c.label in alike else NOISE
        full = colour if c.resolved else "none"
        axes.barh(row, c.probability, color=full, edgecolor=colour, height=0.7)
        text = (
            f"cross-validated {100 * c.held_out:.3g} %"
            if c.resolved and np.isfinite(c.held_out)
            else c.note
        )
        _at_right(axes, row, text or "unresolved")
    _rows(axes, [c.label for c in shown])
    axes.set_xlim(0, 1.3)
    axes.set_xticks([0, 0.25, 0.5, 0.75, 1.0])
    axes.set_xlabel("probability among the explanations considered")
    return figure_of(axes)


@picture
def equations(found: EquationAtFault, *, axes: Axes | None = None) -> Figure:
    """Every equation of motion with what speaks against it, the worst first."""
    shares = sorted(found.shares.items(), key=lambda item: -item[1])
    if not shares:
        raise PlotError("equations: none given")
    axes = single(axes, 7.0, 0.9 + 0.3 * len(shares))
    for row, (name, share) in enumerate(shares):
        axes.barh(row, share, color=MODEL if name == found.name else NOISE, height=0.7)
        _at_right(axes, row, f"{100 * share:.0f} %")
    _rows(axes, [name for name, _ in shares])
    axes.set_xlim(0, 1.15 * max(1e-9, *(share for _, share in shares)))
    axes.set_xlabel(_AGAINST[found.measure])
    return figure_of(axes)


@picture
def experiments(best: Experiment, *, most: int = _MOST, axes: Axes | None = None) -> Figure:
    """How far apart each experiment of the menu would put the two rivals, the suggested one first.

    The line marks the squared distance that tells two explanations apart in 95 % of cases.
    """
    from matplotlib.ticker import FuncFormatter, NullFormatter

    others = sorted(best.other.items(), key=lambda item: -item[1])[: most - 1]
    shown = [(best.name, best.expected_distance), *others]
    axes = single(axes, 8.0, 1.0 + 0.3 * len(shown))
    least = 0.5
    for row, (_, distance) in enumerate(shown):
        axes.barh(row, max(distance, least), color=NOISE if row else FIRST, height=0.7, left=0)
        _at_right(axes, row, f"{distance:.3g}")
    axes.axvline(_TELLS_APART, color=SECOND, lw=1.2, ls="--")
    _rows(axes, [name for name, _ in shown])
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.4g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(least, 30 * max(_TELLS_APART, *(d for _, d in shown)))
    axes.set_xlabel(f"squared distance over noise; {_TELLS_APART:g} tells them apart in 95 %")
    return figure_of(axes)


@picture
def planned_motion(best: Experiment, *, linear: bool = False) -> Figure:
    """The commanded motion of an experiment and its speed over time.

    Raises ValueError for words that are no motion.
    """
    from dualdrive.motion import parse_motion

    motion = parse_motion(best.motion, axis="linear" if linear else "rotary")
    t = np.linspace(0.0, motion.end, 2000)
    unit = "m" if linear else "rad"
    panels = new_axes(2, 8.0, 3.4)
    for axes, values, name, si in (
        (panels[0], motion.waveform.value(t), "position", unit),
        (panels[1], motion.waveform.rate(t), "speed", f"{unit}/s"),
    ):
        shown = scale(si, values)
        axes.plot(t, shown(values), color=COMMAND, lw=1.3)
        axes.set_ylabel(shown.label(name))
        axes.margins(y=0.08)
    panels[-1].set_xlabel("time [s]")
    return figure_of(panels[0])


def _alike(diagnosis: Diagnosis) -> set[str]:
    """Labels of the best candidate and of those the record can't tell from it."""
    best = diagnosis.candidates[0].label
    groups = [set(group) for group in diagnosis.groups if best in group]
    return {best}.union(*groups)


def _rows(axes: Axes, labels: Sequence[str]) -> None:
    axes.set_yticks(np.arange(len(labels)), list(labels))
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")


def _at_right(axes: Axes, row: int, text: str) -> None:
    axes.text(
        0.995, row, text, va="center", ha="right", fontsize=8,
        color=MEASURED, transform=axes.get_yaxis_transform(),
    )  # fmt: skip


@picture
def diagnosed(diagnosis: Diagnosis) -> Figure:
    """A diagnosis on one sheet: candidates, where it fails, which equation, what is missing.

    Panels for which nothing was found are left out. Raises PlotError where nothing at all was.
    """
    from matplotlib.figure import Figure

    from dualdrive.plots.comparison import conditions

    bars = [c for c in diagnosis.where if c.kind not in ("time", "order")]
    panels: list[tuple[float, str, Callable[[Axes], Figure]]] = []
    if diagnosis.candidates:
        rows = min(_MOST, len(diagnosis.candidates))
        panels.append((rows, "What could explain it", lambda a: candidates(diagnosis, axes=a)))
    if bars:
        panels.append((len(bars), "Where it fails", lambda a: conditions(diagnosis, axes=a)))
    if (fault := diagnosis.equation) is not None and fault.shares:
        panels.append((len(fault.shares), "Which equation", lambda a: equations(fault, axes=a)))
    shapes = [s for s in diagnosis.shapes if len(s.at) > 1]
    if shapes:
        best = max(shapes, key=lambda s: s.explained)
        panels.append((8, "What is missing", lambda a: missing_torque(best, axes=a)))
    if not panels:
        raise PlotError(f"diagnosis of {diagnosis.machine}: no law and no error to draw")
    heights = [1.0 + 0.28 * rows for rows, _, _ in panels]
    figure = Figure(figsize=(8.5, 0.5 + sum(heights)), layout="constrained")
    grid = figure.subplots(len(panels), 1, squeeze=False, height_ratios=heights)
    for (_, title, draw), axes in zip(panels, grid[:, 0], strict=True):
        draw(axes)
        axes.set_title(title)
    records = ", ".join(diagnosis.records)
    figure.suptitle(
        f"{diagnosis.machine} against {records}: {diagnosis.verdict}",
        x=0.01, ha="left", fontsize=11, fontweight="bold",
    )  # fmt: skip
    return figure
