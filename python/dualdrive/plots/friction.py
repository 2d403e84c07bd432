"""Torque over speed: the friction a machine shows, and what is not friction."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive.plots.record import PlotError, View
from dualdrive.plots.style import LIMIT, MEASURED, NOISE, TABLE, figure_of, picture, scale, single

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dualdrive.run import Run
    from dualdrive.traces import Trace

__all__ = ["torque_speed"]

Array = NDArray[np.float64]

#: share of the largest acceleration below which a sample counts as steady
STEADY: Final = 0.1
_BINS: Final = 12  # per direction
_FEWEST: Final = 5  # samples in a bin


@picture
def torque_speed(
    record: Run | Trace, *, window: tuple[float, float] | None = None, axes: Axes | None = None
) -> Figure:
    """Sum of the motor torques over speed, with medians and quartiles of the steady samples.

    Tension cancels in the sum. Samples taken while the speed changes carry inertia and are pale;
    what is left of the torque at steady speed is friction.

    record: a finished run, or a trace with ``T_1`` (and ``T_2``) and a speed or angle
    window: (start, stop) in s; all of it unless given

    Raises PlotError where torque or speed is missing.
    """
    axes = single(axes, 7.0, 4.4)
    view = View(record, window)
    channels = view.numbered("T_") or view.numbered("I_")
    if not channels:
        raise PlotError("no motor torque T_1 and no current I_1; record one of them")
    total = np.sum([view[name] for name in channels.values()], axis=0)
    name, speed, speed_unit, steady = _speed(view)
    x, y = scale(speed_unit, speed), scale(view.unit(next(iter(channels.values()))), total)
    axes.plot(x(speed), y(total), ".", ms=1.5, color=NOISE, label="speeding up or slowing down")
    axes.plot(x(speed[steady]), y(total[steady]), ".", ms=2, color=TABLE, alpha=0.5, label="steady")
    bins = _bins(speed[steady], total[steady], float(np.abs(speed).max()))
    if len(bins.speed):
        middle = y(bins.median)
        reach = np.abs(y(np.array([bins.low, bins.high])) - middle)
        axes.errorbar(
            x(bins.speed), middle, reach, fmt="o", ms=4, lw=1.2, color=MEASURED, capsize=2,
            label="median and quartiles", zorder=3,
        )  # fmt: skip
    axes.axhline(0, color=LIMIT, lw=0.6)
    axes.axvline(0, color=LIMIT, lw=0.6)
    axes.margins(0.05)
    axes.set_xlabel(x.label(name))
    what = {"T": "torque", "I": "current"}[next(iter(channels.values()))[0]]
    axes.set_ylabel(y.label(f"sum of motor {what}s" if len(channels) > 1 else f"motor {what}"))
    axes.set_title("Torque over speed" if what == "torque" else "Current over speed")
    key = axes.legend(loc="best")
    for dot in key.legend_handles[:2]:
        dot.set_markersize(5)  # type: ignore[union-attr]
    return figure_of(axes)


class _Bins(NamedTuple):
    speed: Array
    median: Array
    low: Array
    high: Array


def _bins(speed: Array, torque: Array, top: float) -> _Bins:
    """Medians and quartiles over equal parts of each direction's range, up to the speed `top`."""
    found: list[tuple[float, ...]] = []
    for direction in (-1, 1):
        edges = direction * np.linspace(0.02 * top, top * (1 + 1e-9), _BINS + 1)
        for a, b in pairwise(edges):
            inside = (speed >= min(a, b)) & (speed < max(a, b))
            if inside.sum() >= _FEWEST:
                quartiles = np.quantile(torque[inside], (0.5, 0.25, 0.75))
                found.append((float(np.median(speed[inside])), *map(float, quartiles)))
    table = np.array(sorted(found)).reshape(-1, 4)
    return _Bins(*table.T)


def _speed(view: View) -> tuple[str, Array, str, NDArray[np.bool_]]:
    """What the speed is called, its values and unit, and where it is steady."""
    if "omega_m" in view:
        what, speed, unit = "table speed", view["omega_m"], view.unit("omega_m")
    elif "omega_1" in view:
        what, speed, unit = "speed of motor 1", view["omega_1"], view.unit("omega_1")
    elif "theta_m" in view:
        what, unit = "table speed", f"{view.unit('theta_m')}/s"
        speed = _smooth(np.gradient(_smooth(view["theta_m"]), view.t))
    else:
        raise PlotError("no speed: omega_m, omega_1 or theta_m is needed")
    change = np.abs(view["alpha_m"] if "alpha_m" in view else np.gradient(_smooth(speed), view.t))
    # the largest change but for the last per cent, where impacts and noise sit
    calm = change <= STEADY * float(np.quantile(change, 0.99))
    return what, speed, unit, _lasting(calm)


def _lasting(calm: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Without the beginning and end of each calm stretch, where the torque still settles."""
    from scipy.ndimage import binary_erosion

    width = max(1, len(calm) // 200)
    return np.asarray(
        binary_erosion(calm, np.ones(2 * width + 1, dtype=np.bool_), border_value=1), dtype=np.bool_
    )


def _smooth(values: Array, width: int = 15) -> Array:
    """Mean of `width` neighbours, ends included."""
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(values, width, mode="nearest"))
