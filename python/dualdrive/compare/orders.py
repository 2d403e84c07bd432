"""Orders of an angle in a residual: lines of its spectrum over turns instead of seconds.

What repeats with the motor's poles, a gear's teeth or a turn of the table stands as a line at a
fixed order, whatever the speed. A line is judged by its neighbours: friction, inertia and noise
leave a smooth spectrum, in which neighbouring orders are alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

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
    ratio:     turns of the angle per turn of the table
    geared:    whether any angle of the machine makes more or fewer turns than the table
    alike:     other angles of the same ratio over which the line stands at this order, too
    also:      the same line counted over angles of other ratios
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
    ratio: float = 1.0
    geared: bool = True
    alike: tuple[str, ...] = ()
    also: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """``order 8 of motor 1``, integers as such."""
        angles = " or ".join((self.angle, *self.alike))
        return f"order {spoken(self.order, self.resolution)} of {angles}"

    @property
    def spoken(self) -> str:
        """``8 per turn of motor 1``; why its source can't be told, where several angles have it."""
        per = f"{spoken(self.order, self.resolution)} per turn"
        if not self.alike:
            return " or ".join((f"{per} of {self.angle}", *self.also))
        angles = f"{', '.join((self.angle, *self.alike))} turn alike"
        why = angles if self.geared else "all ratios are 1"
        return " or ".join((f"{per} ({why}: its source can't be told)", *self.also))


@dataclass(frozen=True)
class Ripple:
    """One line as it is told, which several records may show, clearest first."""

    shown: tuple[Order, ...]

    @property
    def largest(self) -> Order:
        """As the record shows it in which it is largest."""
        return max(self.shown, key=lambda o: o.amplitude)

    @property
    def spoken(self) -> str:
        """``8 per turn of motor 1``: the mean order of all records, every angle that has it."""
        return self._whole.spoken

    @property
    def sentence(self) -> str:
        """What is told of it in a comparison."""
        amplitude = _span([o.amplitude for o in self.shown], ".3g")
        share = _span([100.0 * o.share for o in self.shown], ".0f")
        records = f" in {len(self.shown)} records" if len(self.shown) > 1 else ""
        return (
            f"{self.largest.channel}: ripple, {self.spoken}: amplitude {amplitude} "
            f"{self.largest.unit}, {share}% of the residual's square{records}"
        )

    @property
    def _whole(self) -> Order:
        """The clearest, at the mean order, with the angles of all."""
        first = self.shown[0]
        same = [o for o in self.shown if _alike(o, first)]
        angles = dict.fromkeys(a for o in same for a in (o.angle, *o.alike))
        labels = dict.fromkeys(label for o in same for label in o.also)
        return replace(
            first,
            order=float(np.mean([o.order for o in same])),
            alike=tuple(a for a in angles if a != first.angle),
            also=tuple(labels),
        )


@dataclass(frozen=True, eq=False)
class Turning:
    """An angle over the samples of a residual, rad; `ratio` turns of it make one of the table."""

    angle: str
    ratio: float
    values: Array


def spoken(order: float, resolution: float) -> str:
    """An order with the digits that it has; a whole number where it can't be told from one."""
    whole = round(order)
    if whole and abs(order - whole) <= resolution:
        return str(whole)
    digits = math.ceil(-math.log10(2.0 * resolution))
    return f"{order:.{min(max(digits, 1), 2)}f}"


def ripples(orders: Sequence[Order]) -> list[Ripple]:
    """Lines of different records that can't be told apart as one, clearest first."""
    groups: list[list[Order]] = []
    for line in orders:
        own = next((g for g in groups if _same(line, g[0])), None)
        if own is None:
            groups.append([line])
        elif line.record not in {o.record for o in own}:
            own.append(line)
    return [Ripple(tuple(group)) for group in groups]


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
                    turning.ratio,
                )
            )
    return found


def examined(angles: Sequence[Turning], counts: Flags) -> int:
    """How many orders of these angles can be told apart: the size of the family of tests."""
    spans = [float(np.ptp(a.values[counts])) / (2 * np.pi) for a in angles if counts.any()]
    return sum(round(HIGHEST * span) for span in spans if span >= TURNS)


def significant(found: Sequence[Order], family: int, *, geared: bool) -> list[Order]:
    """The lines that stand out of the whole family (Bonferroni), each told once, clearest first.

    geared: whether any angle of the machine makes more or fewer turns than the table
    """
    groups: list[list[Order]] = []
    for line in sorted(found, key=lambda o: (o.p, abs(o.order - round(o.order)))):
        own = replace(line, p=min(1.0, line.p * family))
        if own.p > LEVEL:
            continue
        twins = next((g for g in groups if g[0].record == own.record and _same(own, g[0])), None)
        if twins is None:
            groups.append([own])
        elif own.angle not in {o.angle for o in twins}:
            twins.append(own)
    return [_told_once(group, geared=geared) for group in groups]


def _told_once(group: Sequence[Order], *, geared: bool) -> Order:
    """One line that several angles count, over the plainest of them."""
    first = min(group, key=_plainness)
    alike = [o for o in group if _alike(o, first)]
    return replace(
        first,
        order=float(np.mean([o.order for o in alike])),
        p=min(o.p for o in group),
        geared=geared,
        alike=tuple(o.angle for o in alike if o.angle != first.angle),
        also=tuple(o.label for o in group if not _alike(o, first)),
    )


def _plainness(line: Order) -> tuple[bool, float]:
    """Whole numbers before broken ones, then few cycles per turn before many."""
    whole = round(line.order) > 0 and abs(line.order - round(line.order)) <= line.resolution
    return not whole, line.order


def _alike(one: Order, other: Order) -> bool:
    """Whether the angles of two lines turn one to one."""
    return math.isclose(one.ratio, other.ratio)


def _same(one: Order, other: Order) -> bool:
    """Whether two lines of a channel are one: the same cycles per turn of the table."""
    first, second = (o.order * o.ratio for o in (one, other))
    width = sum(2.0 * o.resolution * o.ratio for o in (one, other))
    return one.channel == other.channel and abs(first - second) <= width


def _span(values: Sequence[float], digits: str) -> str:
    """``2 to 4``, or one number where both ends read alike."""
    return " to ".join(dict.fromkeys(f"{v:{digits}}" for v in (min(values), max(values))))


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
