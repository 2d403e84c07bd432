"""Orders of an angle in a residual: lines of its spectrum over turns instead of seconds.

What repeats with the motor's poles, a gear's teeth or a turn of the table stands as a line at a
fixed order, whatever the speed. A line is judged by its neighbours: friction, inertia and noise
leave a smooth spectrum, in which neighbouring orders are alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

HIGHEST = 64  # per turn
TURNS = 3.0  # fewer turns of an angle have no spectrum
_LOWEST = 3  # cycles within the range of the angle, below which motion itself makes lines
_CLEAR, _NEAR = 2, 22  # neighbours in resolutions: those that the line leaks into, those that count
_PER_TURN = 8 * HIGHEST  # bins
LEVEL = 0.01


@dataclass(frozen=True)
class Order:
    """A line in the spectrum of a residual over an angle.

    angle:     table, pinion or motor whose turns are counted, with the drive's number
    order:     cycles per turn; `resolution` is half the distance to the next that can be told
    amplitude: of the residual, in `unit`
    excess:    amplitude over what the neighbouring orders would have
    share:     of the residual's mean square
    p:         probability of such a line anywhere among the orders, angles and channels examined
    also:      the same line counted over other angles
    """

    record: str
    channel: str
    angle: str
    order: float
    resolution: float
    amplitude: float
    unit: str
    excess: float
    share: float
    p: float
    also: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """``order 8 of motor 1``, integers as such."""
        return f"order {spoken(self.order, self.resolution)} of {self.angle}"

    @property
    def spoken(self) -> str:
        """``8 per turn of motor 1``; other angles that it may be counted over, where there are."""
        per = spoken(self.order, self.resolution)
        others = dict.fromkeys(name.rpartition(" of ")[2] for name in self.also)
        others.pop(self.angle, None)
        if not others:
            return f"{per} per turn of {self.angle}"
        alike = [n for n in self.also if n.rpartition(" of ")[2] in others and f" {per} " in n]
        if len(alike) >= len(others):
            every = ", ".join([self.angle, *others])
            return f"{per} per turn ({every} turn alike: its source can't be told)"
        return f"{per} per turn of {self.angle}, or {' or '.join(self.also)}"


@dataclass(frozen=True, eq=False)
class Turning:
    """An angle over the samples of a residual, rad; `ratio` turns of it make one of the table."""

    angle: str
    ratio: float
    values: Array


def spoken(order: float, resolution: float) -> str:
    """An order as a whole number where it can't be told from one."""
    whole = round(order)
    return str(whole) if whole and abs(order - whole) <= resolution else f"{order:.2f}"


def lines(
    record: str, channel: str, unit: str, residual: Array, counts: Flags, angles: Sequence[Turning]
) -> list[Order]:
    """Every line that might stand out, unadjusted: p is that of the one order alone.

    Args:
        record: whose residual it is.
        channel: the same.
        unit: of the residual.
        residual: shape (n,), SI.
        counts: samples that count, shape (n,).
        angles: what may turn; one that makes fewer than three turns is passed over.

    """
    found = []
    power = float(np.mean(residual[counts] ** 2)) if counts.any() else 0.0
    for turning in angles if power > 0.0 else ():
        turns = turning.values[counts] / (2 * np.pi)
        span = float(np.ptp(turns)) if len(turns) else 0.0
        if span < TURNS:
            continue
        spectrum, step = _spectrum(turns, residual[counts])
        for k, excess, chance in _standing_out(spectrum):
            amplitude = float(np.sqrt(spectrum[k]))
            found.append(
                Order(
                    record,
                    channel,
                    turning.angle,
                    k * step,
                    0.5 / span,
                    amplitude,
                    unit,
                    excess,
                    min(1.0, amplitude**2 / 2 / power),
                    chance,
                )
            )
    return found


def examined(angles: Sequence[Turning], counts: Flags) -> int:
    """How many orders of these angles can be told apart: the size of the family of tests."""
    spans = [float(np.ptp(a.values[counts])) / (2 * np.pi) for a in angles if counts.any()]
    return sum(round(HIGHEST * span) for span in spans if span >= TURNS)


def significant(found: Sequence[Order], family: int, ratios: dict[str, float]) -> list[Order]:
    """The lines that stand out of the whole family (Bonferroni), each told once, clearest first.

    ratios: angle -> turns per turn of the table, by which one line is known under several angles
    """
    from dataclasses import replace

    told: list[Order] = []
    for line in sorted(found, key=lambda o: (o.p, abs(o.order - round(o.order)))):
        own = replace(line, p=min(1.0, line.p * family))
        if own.p > LEVEL:
            continue
        twin = next((k for k, other in enumerate(told) if _same(own, other, ratios)), None)
        if twin is None:
            told.append(own)
        elif own.angle != told[twin].angle:
            first, second = sorted((told[twin], own), key=_plainness)
            names = dict.fromkeys((*told[twin].also, *own.also, second.label))
            told[twin] = replace(
                first, p=min(first.p, second.p), also=tuple(n for n in names if n != first.label)
            )
    return told


def _plainness(line: Order) -> tuple[bool, float]:
    """Whole numbers before broken ones, then few cycles per turn before many."""
    whole = round(line.order) > 0 and abs(line.order - round(line.order)) <= line.resolution
    return not whole, line.order


def _same(one: Order, other: Order, ratios: dict[str, float]) -> bool:
    """Whether two lines are one: the same cycles per turn of the table."""
    first, second = (o.order * ratios[o.angle] for o in (one, other))
    width = sum(2.0 * o.resolution * ratios[o.angle] for o in (one, other))
    return (one.record, one.channel) == (other.record, other.channel) and abs(
        first - second
    ) <= width


def _spectrum(turns: Array, residual: Array) -> tuple[Array, float]:
    """Squared amplitude at orders 0, 1, 2, ... steps, and the step: half the resolution.

    Samples count by the angle they stand for, so that slow stretches do not drown fast ones.
    """
    weight = np.abs(np.gradient(turns))
    cell = np.floor((turns - turns.min()) * _PER_TURN).astype(int)
    size = int(cell.max()) + 1
    whole = float(np.sum(weight)) or 1.0
    level = float(np.sum(weight * residual)) / whole
    summed = np.bincount(cell, weight * (residual - level), size)
    count = 2 * size
    orders = np.fft.rfft(summed, count)
    step = _PER_TURN / count
    return (2.0 * np.abs(orders[: int(HIGHEST / step) + 1]) / whole) ** 2, step


def _standing_out(spectrum: Array) -> list[tuple[int, float, float]]:
    """Peaks with their excess in amplitude and their chance, by their neighbours on either side."""
    near, clear = 2 * _NEAR, 2 * _CLEAR  # the spectrum has two points in a resolution
    if len(spectrum) < 2 * near + 2:
        return []
    sums = np.concatenate([[0.0], np.cumsum(spectrum)])
    rows = np.arange(max(2 * _LOWEST, near), len(spectrum) - near)
    below = (sums[rows - clear] - sums[rows - near]) / (near - clear)
    above = (sums[rows + near + 1] - sums[rows + clear + 1]) / (near - clear)
    level = np.maximum(below, above) + 1e-300
    peak = (spectrum[rows] >= spectrum[rows - 1]) & (spectrum[rows] > spectrum[rows + 1])
    ratio = spectrum[rows] / level
    independent = _NEAR - _CLEAR
    # a squared amplitude over the mean of K alike: F with 2 and 2K degrees of freedom
    chance = (1.0 + ratio / independent) ** -independent
    return [
        (int(rows[k]), float(np.sqrt(ratio[k])), float(chance[k]))
        for k in np.flatnonzero(peak & (chance < LEVEL))
    ]
