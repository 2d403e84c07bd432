"""Positions out of a recorded trace: where the axis stood in each dwell, and whence it came."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.traces import Trace

from .cycle import STILL
from .iso230 import Iso230, evaluate
from .rules import IndexingError

__all__ = ["evaluate_trace"]

Floats = NDArray[np.float64]


class _Stay(NamedTuple):
    """A dwell: its target, and the mean position at its end."""

    target: float
    position: float


def evaluate_trace(
    trace: Trace,
    targets: ArrayLike | None = None,
    *,
    unit: str = "rad",
    dwell: float = 1.0,
    window: float | None = None,
    still: float | None = None,
    travel: float | None = None,
) -> Iso230:
    """Evaluate a test that was recorded as a trace with ``theta_m`` over time.

    targets:  where the axis was sent; else the plateaus of ``theta_ref``
    unit:     rad, or m of a linear axis, whose position in m stands as ``theta_m``
    dwell:    s; a shorter rest is none.  window: the end of it that is averaged; else half of it
    still:    by how much the axis may move within the window; else 1 arc second, 1 µm

    Targets that are reached from one side only are where the cycle turns back, and are left out.
    Raises IndexingError without reversals or dwells, where the axis moves while it is read, or
    where counts differ between targets.
    """
    if "theta_m" not in trace:
        raise IndexingError(f"{trace.name}: no channel theta_m: map the measured position to it")
    places = None if targets is None else np.sort(np.array(targets, float).reshape(-1))
    if places is None and "theta_ref" not in trace:
        raise IndexingError(f"{trace.name}: neither theta_ref nor targets: say where it was sent")
    window = dwell / 2 if window is None else window
    still = STILL[unit] if still is None else still
    rests = _rests(trace, places, dwell)
    stays = [_stay(trace, places, rest, window, still, unit) for rest in rests]
    up, down = _visits(stays, trace.name)
    both = sorted(set(up) & set(down))
    if not both:
        raise IndexingError(
            f"{trace.name}: no reversals: {len(stays)} dwells, and no target was reached from both "
            "sides; a bidirectional test is needed"
        )
    left_out = sorted({*up, *down} - set(both))
    notes = [f"{len(left_out)} turning points left out"] if left_out else []
    return evaluate(
        both,
        [up[t] for t in both],
        [down[t] for t in both],
        unit=unit,
        travel=travel,
        name=trace.name,
        notes=notes,
    )


def _rests(trace: Trace, targets: Floats | None, dwell: float) -> list[slice]:
    """Stretches of at least `dwell` s in which the command, or else the axis, does not move."""
    commanded = "theta_ref" in trace
    angle = trace["theta_ref" if commanded else "theta_m"]
    if commanded or targets is None:
        moved = 1e-9 * float(np.ptp(angle))
    else:
        moved = 0.01 * float(np.diff(targets).min()) if targets.size > 1 else 0.0
    t = trace.t
    later = np.interp(t + dwell / 2, t, angle)  # after half a dwell it is where it was
    flat = (np.abs(later - angle) <= moved) & (t <= t[-1] - dwell / 2)
    # a measured angle has begun to move where it leaves the tolerance: that end is cut off
    held = dwell / 2 if commanded else dwell / 4
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flat.astype(np.int8), [0]])))
    found = []
    for first, beyond in edges.reshape(-1, 2):
        last = int(np.searchsorted(t, t[beyond - 1] + held, side="right"))
        if t[last - 1] - t[first] >= (dwell / 2 + held) * (1 - 1e-6):
            found.append(slice(int(first), last))
    if not found:
        raise IndexingError(
            f"{trace.name}: no rest of {dwell:g} s: the axis never dwells; name a shorter dwell, "
            "or record a test that stops at its targets"
        )
    return found


def _stay(
    trace: Trace, targets: Floats | None, rest: slice, window: float, still: float, unit: str
) -> _Stay:
    from dualdrive.units import human

    t, angle = trace.t[rest], trace["theta_m"][rest]
    seen = angle[t >= t[-1] - window]
    if np.ptp(seen) > still:
        moved = human(float(np.ptp(seen)), unit)
        raise IndexingError(
            f"{trace.name}: at t = {t[-1]:.6g} s the axis moves by {moved} within the last "
            f"{window:g} s of its dwell (allowed {human(still, unit)}): it hunts, or has not "
            "settled; no position is read. Allow more (still) where that is noise"
        )
    if targets is None:
        return _Stay(float(trace["theta_ref"][rest][-1]), float(seen.mean()))
    nearest = targets[np.abs(targets - seen.mean()).argmin()]
    return _Stay(float(nearest), float(seen.mean()))


def _visits(
    stays: list[_Stay], name: str
) -> tuple[dict[float, list[float]], dict[float, list[float]]]:
    """Positions by target, those reached from below and those from above."""
    ways: tuple[dict[float, list[float]], dict[float, list[float]]] = ({}, {})
    known: list[float] = []
    before: float | None = None
    span = max((s.target for s in stays), default=0.0) - min((s.target for s in stays), default=0.0)
    for stay in stays:
        near = [k for k in known if abs(k - stay.target) <= 1e-6 * span]
        target = near[0] if near else stay.target
        known += [] if near else [target]
        if before is not None and target != before:
            way = ways[0] if target > before else ways[1]
            way.setdefault(target, []).append(stay.position)
        before = target
    if len(known) < 2:
        raise IndexingError(f"{name}: the axis rests at one place only; that is no test")
    return ways
