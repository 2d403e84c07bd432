"""How sure fitted numbers are: intervals, Wald and Chow tests, errors on what a fit did not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.result import Interval
from dualdrive.diagnose.screening.variants import periods
from dualdrive.diagnose.selection import Fitted
from dualdrive.estimation.unknowns import Unknown
from dualdrive.innovations import (
    GreyBox,
    Point,
    covariance,
    deviations,
    flat,
    inflation,
    slopes,
    step_within,
    values,
    waves,
)

Array = NDArray[np.float64]
Place = tuple[Point, Sequence[Any]]

_BLOCKS = 8  # of every record, one left out by cross-validation
_NOTHING = 1e-9  # of what all pieces tell of a number: one that tells less asks for nothing
_FAR = 3.0  # standard errors that a number may move where a block is left out
_PART = 1e-3  # of a standard deviation: a step of the delta method
_SURE = 1.96  # standard deviations of a 95 % interval


@dataclass(frozen=True)
class NormalEquations:
    """Of a Gauss-Newton step about a fit, by pieces: as many of every record, one after the other.

    products: J'J of each piece, shape (records, pieces, unknowns, unknowns)
    slopes:   J'r, shape (records, pieces, unknowns)
    squares:  r'r, shape (records, pieces)
    precision: of the priors, shape (unknowns,)
    scale:    by which all of these count for less, where innovations count themselves
    """

    products: Array
    slopes: Array
    squares: Array
    precision: Array
    scale: float

    @property
    def information(self) -> Array:
        """Of all pieces and the priors, shape (unknowns, unknowns)."""
        total: Array = self.scale * self.products.sum(axis=(0, 1)) + np.diag(self.precision)
        return total

    @property
    def covariance(self) -> Array:
        """Of the unknowns, shape (unknowns, unknowns)."""
        return covariance(self.information)

    @property
    def changes(self) -> Array:
        """Fall of chi^2 if each unknown changed from piece to piece, shape (unknowns,)."""
        told = np.einsum("rbkk->rbk", self.products).reshape(-1, len(self.precision))
        asked = self.slopes.reshape(told.shape)
        whole = told.sum(axis=0) + 1e-300
        every = asked**2 / np.maximum(told, _NOTHING * whole)
        found: Array = self.scale * (every.sum(axis=0) - asked.sum(axis=0) ** 2 / whole)
        return found


@dataclass(frozen=True)
class Changing:
    """The number that would change most, were it let.

    name: its path
    gain: fall of chi^2 if it did so from piece to piece; noise alone gives about `numbers`
    numbers: that it would take beyond the one
    """

    name: str
    gain: float
    numbers: int


class Uncertainty:
    """What records tell of fitted machines; derivatives are taken once for each of them."""

    def __init__(self, grey: GreyBox) -> None:
        self.grey = grey
        self._known: dict[Fitted, NormalEquations] = {}
        self._places: dict[Fitted, Place] = {}

    def about(self, f: Fitted) -> NormalEquations:
        """The normal equations about a fit."""
        if f not in self._known:
            self._known[f] = self._taken(f)
        return self._known[f]

    def _place(self, f: Fitted) -> Place:
        """Its innovations and gains, under the noise by which its derivatives are taken."""
        if f not in self._places:
            noise, own = f.told_under, (f.point, f.gains)
            [there] = self.grey.likelihoods(f.variant, [(f.point.theta, noise)]) if noise else [own]
            self._places[f] = there or own
        return self._places[f]

    def _taken(self, f: Fitted) -> NormalEquations:
        grey, (point, gains) = self.grey, self._place(f)
        columns = np.stack(slopes(grey, point, range(len(point.theta)), gains))
        _, precision = grey.believed(f.variant)
        own, begin = [], 0
        for x in point.residuals:
            J, r = columns[:, begin : begin + x.size], x.ravel()
            pieces = [_pieces(x) == b for b in range(_BLOCKS)]
            own.append([(J[:, k], r[k]) for k in pieces])
            begin += x.size
        return NormalEquations(
            np.array([[J @ J.T for J, _ in pieces] for pieces in own]),
            np.array([[J @ r for J, r in pieces] for pieces in own]),
            np.array([[r @ r for _, r in pieces] for pieces in own]),
            precision,
            1.0 / inflation(point),
        )

    def cross_validated(self, f: Fitted) -> float:
        """Error on blocks of time that a fit did not see, over that on those it saw.

        One Gauss-Newton step takes each block out of the fit, and a replay with the numbers found
        so tells the block's error (Ljung, System Identification, 16.4). A step that the other
        blocks are worse off with is none: what a command that is late by ticks does is level
        between these, and jumps. A fit by simulation is not where the filter's own would end: how
        far that is, is no block's doing, and its steps need not be steps down.
        """
        (point, gains), grey, normal = self._place(f), self.grey, self.about(f)
        deviation = np.sqrt(np.diag(normal.covariance).clip(0.0) + 1e-300)
        # a linear step says nothing far away, where only one block tells a number
        H = normal.information + np.diag(1.0 / (_FAR * deviation) ** 2)
        low, high = grey.bounds(f.variant)
        centre, precision = grey.believed(f.variant)
        products, slopes = normal.products.sum(axis=0), normal.slopes.sum(axis=0)
        gradient = normal.scale * slopes.sum(axis=0) + precision * (point.theta - centre)
        rest = step_within(H, gradient, low - point.theta, high - point.theta)
        places = []
        for product, slope in zip(products, slopes, strict=True):
            there = normal.scale * (slope + product @ rest)  # where that end is
            step = np.linalg.solve(H - normal.scale * product, there)
            step = np.clip(step, -_FAR * deviation, _FAR * deviation)
            places.append(np.clip(point.theta + step, low, high))
        blocks = np.concatenate([_pieces(x) for x in point.residuals])
        r, total = flat(point.residuals), 0.0
        for b, found in enumerate(grey.points([f.variant] * _BLOCKS, places, gains)):
            there, seen = flat(found.residuals), blocks != b
            if f.told_under is None and not there[seen] @ there[seen] < r[seen] @ r[seen]:
                there = r  # no fit to the others would have taken this step
            total += float(np.sum(there[~seen] ** 2))
        return float(np.sqrt(total / max(float(normal.squares.sum()), 1e-300)))

    def intervals(self, f: Fitted) -> dict[str, Interval]:
        """Path -> value with its 95 % interval, nominal numbers and the effects' own.

        Phases lie within half a turn of zero, centres of local faults within half their period.
        """
        grey, theta, n = self.grey, f.point.theta, len(self.grey.nominal)
        covariance = self.about(f).covariance
        deviation = np.sqrt(np.maximum(np.diag(covariance)[:n], 0.0))
        found = {}
        for p, u, d in zip(grey.nominal, theta[:n], deviation, strict=True):
            found[p.path] = _interval(p, float(u), _SURE * float(d))
        own, first = f.variant.extra, grey.shared
        at, phases = values(own, theta[first:]), [turn for _, turn in waves(own)]
        spread = deviations(own, theta[first:], covariance[first:, first:])
        for k, (p, d) in enumerate(zip(own, _SURE * spread, strict=True)):
            if k in phases:
                found[p.path] = Interval(at[p.path], at[p.path] - d, at[p.path] + d, p.unit)
            else:
                found[p.path] = _interval(p, p.coordinate(at[p.path]), float(d))
            label, _, name = p.path.rpartition(".")
            if name == "centre":
                found[p.path] = _near_zero(
                    found[p.path], 2.0 * np.pi / periods(f.variant.grown, label)
                )
        for path, value in f.variant.fixed.items():
            unit = f.variant.grown.parameter(f.variant.grown.members(path)[0]).unit
            found[path] = Interval(value, value, value, unit)
        return found | self._modulated(f, covariance)

    def _modulated(self, f: Fitted, covariance: Array) -> dict[str, Interval]:
        """Numbers that change with an angle, and by how much, by the delta method.

        (Lehmann, Casella, Theory of Point Estimation, 2nd ed., section 1.8.)
        """
        grey, v, theta = self.grey, f.variant, f.point.theta
        at, paths = grey.values(v, theta), grey.modulated(v)
        deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        rows: dict[str, list[float]] = {path: [] for path in paths}
        for k, d in enumerate(deviation if paths else []):
            step = np.zeros(len(theta))
            step[k] = _PART * float(d)
            up, down = grey.values(v, theta + step), grey.values(v, theta - step)
            for path in paths:
                rows[path].append((up[path] - down[path]) / (2.0 * step[k]) if d else 0.0)
        found = {}
        for path, row in rows.items():
            slope, declared = np.array(row), v.grown.parameter(v.grown.members(path)[0])
            half = _SURE * float(np.sqrt(max(slope @ covariance @ slope, 0.0)))
            ends = (max(at[path] - half, declared.low), min(at[path] + half, declared.high))
            found[path] = Interval(at[path], *ends, declared.unit)
        return found

    def changing(self, f: Fitted) -> Changing:
        """The number that speaks most against all of them being constant; no sensor's zero.

        The score test of steps from piece to piece (Chow, Econometrica 28 (1960) 591-605; Nyblom,
        J. American Statistical Association 84 (1989) 223-230).
        """
        normal, n, first = self.about(f), len(self.grey.nominal), self.grey.shared
        numbers = [*self.grey.nominal, *f.variant.extra]
        gains = np.r_[normal.changes[:n], normal.changes[first:]]
        k = int(np.argmax(gains))
        return Changing(numbers[k].path, float(gains[k]), normal.squares.size - 1)

    def distance(self, f: Fitted) -> float:
        """Of the nominal numbers from the data sheet's: Wald's statistic.

        Chi-squared of as many degrees of freedom as there are such numbers, where the data sheet
        is right (Wald, Transactions of the American Mathematical Society 54, 1943, 426-482).
        """
        n = len(self.grey.nominal)
        off = f.point.theta[:n] - self.grey.centre[:n]
        return float(off @ np.linalg.pinv(self.about(f).covariance[:n, :n], hermitian=True) @ off)


def _interval(p: Unknown, u: float, d: float) -> Interval:
    low, high = sorted((p.value(u - d), p.value(u + d)))
    return Interval(p.value(u), low, high, p.unit)


def _near_zero(known: Interval, period: float) -> Interval:
    """The same, so many periods off that its value lies within half a period of zero."""
    off = period * round(known.value / period)
    return replace(known, value=known.value - off, low=known.low - off, high=known.high - off)


def _pieces(residuals: Array) -> NDArray[np.intp]:
    """Of every entry of a record's residuals, in their order: its piece of time."""
    n, channels = residuals.shape
    return np.repeat(np.minimum(np.arange(n) * _BLOCKS // n, _BLOCKS - 1), channels)
