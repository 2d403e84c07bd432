"""A machine, records and what is not known: innovations at a point, and fits of it.

Unknown are the nominal numbers within their tolerances, a constant of every sensor whose zero is
not known, and the numbers of effects under trial. Fits are Levenberg-Marquardt steps on whitened
innovations and priors; the gains are held within a fit.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.identify.unknowns import Unknown
from dualdrive.innovations.noise import Noise
from dualdrive.innovations.records import Predictable
from dualdrive.replay.record import with_settings

Array = NDArray[np.float64]

#: one-sigma of a sensor's constant: of a motor's encoder at the pinion, rad; of a current, relative
_ZERO_ANGLE, _ZERO_CURRENT = 1e-3, 0.02
_DIFFERENCE = 1e-3  # of a unit of an unknown, for finite differences
_LOST = 300.0  # whitened: what a replay that broke down is counted with


@dataclass(frozen=True, eq=False)
class Variant:
    """A machine with effects under trial, and their unknowns.

    grown:   the core's machine with the effects in it
    effects: (effect, place); a group where every member has numbers of its own
    fixed:   parameter path -> value of what is counted
    looks:   among how many values those were found
    """

    grown: Any
    extra: tuple[Unknown, ...] = ()
    effects: tuple[tuple[str, str], ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    looks: float = 1.0

    @property
    def label(self) -> str:
        """``coulomb@table``, two joined by `` + ``, or ``nothing``."""
        return " + ".join(f"{e}@{p}" for e, p in self.effects) or "nothing"

    @property
    def key(self) -> str:
        """Label with its counted numbers."""
        counts = ", ".join(dict.fromkeys(f"{v:g}" for v in self.fixed.values()))
        return f"{self.label} ({counts})" if counts else self.label


@dataclass(frozen=True, eq=False)
class Point:
    """A variant at a point, shape (unknowns,), and its innovations there.

    residuals: whitened, records end to end, shape (rows, channels) each
    log_det:   sum of log det of the innovations' covariance
    lost:      a replay broke down
    """

    variant: Variant
    theta: Array
    residuals: tuple[Array, ...]
    log_det: float
    prior: float
    lost: bool = False
    history: tuple[float, ...] = field(default=())

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened innovations."""
        return float(sum(np.einsum("ij,ij->", r, r) for r in self.residuals))

    @property
    def minus_two_log(self) -> float:
        """-2 log L, priors included, constants left out."""
        return self.chi2 + self.log_det + self.prior


class Counter:
    """Replays done; a stop is asked between them."""

    def __init__(self, stop: Callable[[], bool] = lambda: False) -> None:
        self.replays, self.stop = 0, stop


class GreyBox:
    """Records and the unknowns that every variant shares."""

    def __init__(
        self,
        core: Any,
        records: Sequence[Predictable],
        nominal: Sequence[Unknown],
        *,
        threads: int | None = None,
        counter: Counter | None = None,
    ) -> None:
        self.core, self.records, self.nominal = core, list(records), list(nominal)
        self.offsets = self._floating()
        self.sigma = np.array([p.sigma for p in self.nominal] + [1.0] * len(self.offsets))
        self.centre = np.array([p.centre for p in self.nominal] + [0.0] * len(self.offsets))
        self.threads = threads or os.cpu_count() or 1
        self.pool = ThreadPoolExecutor(self.threads)
        self.counter = counter or Counter()
        self.speed = max(
            float(np.sqrt(np.mean(np.gradient(r.record.reference, r.record.t) ** 2)))
            for r in records
        )

    def _floating(self) -> dict[str, float]:
        """Channel -> one-sigma of its constant. The table's encoder is the loop's own zero."""
        found: dict[str, float] = {}
        for r in self.records:
            for c, y in zip(r.channels, r.measured.T, strict=True):
                stem, _, n = c.partition("_")
                if stem == "theta" and c != "theta_m":
                    gearbox = f"gearbox_{n}"
                    geared = not n.startswith("c") and gearbox in self.core.connections
                    found[c] = _ZERO_ANGLE * (self.core.get(f"{gearbox}.ratio") if geared else 1.0)
                elif stem in ("I", "T"):
                    found[c] = max(found.get(c, 0.0), _ZERO_CURRENT * float(np.std(y)))
        return found

    def held(self) -> GreyBox:
        """The same with the nominal numbers as the data sheet has them."""
        own = copy(self)
        own.sigma = self.sigma.copy()
        own.sigma[: len(self.nominal)] = _HELD
        return own

    @property
    def shared(self) -> int:
        """Unknowns that every variant has."""
        return len(self.nominal) + len(self.offsets)

    @property
    def samples(self) -> int:
        """Samples of all records."""
        return sum(len(r.record.t) for r in self.records)

    def start(self, variant: Variant) -> Array:
        """Where a fit from the data sheet begins."""
        nominal = [p.start for p in self.nominal] + [0.0] * len(self.offsets)
        return np.array(nominal + [p.start for p in variant.extra])

    def bounds(self, variant: Variant) -> tuple[Array, Array]:
        """Lowest and highest of every unknown."""
        pairs = [p.bounds for p in self.nominal] + [(-np.inf, np.inf)] * len(self.offsets)
        pairs += [p.bounds for p in variant.extra]
        low, high = np.array(pairs).T
        reach = np.r_[_BOX * self.sigma, np.full(len(variant.extra), np.inf)]
        centre = np.r_[self.centre, np.zeros(len(variant.extra))]
        return np.maximum(low, centre - reach), np.minimum(high, centre + reach)

    def machine(self, variant: Variant, theta: Array) -> Any:
        """The core's machine of a variant at a point."""
        core = variant.grown.copy()
        n = len(self.nominal)
        known = [*zip(self.nominal, theta[:n], strict=True)]
        known += [*zip(variant.extra, theta[self.shared :], strict=True)]
        for p, u in known:
            core.set(p.path, p.value(float(u)))
        return core

    def constants(self, theta: Array) -> dict[str, float]:
        """Channel -> what its sensor adds."""
        n = len(self.nominal)
        return {
            c: s * float(x)
            for (c, s), x in zip(self.offsets.items(), theta[n : self.shared], strict=True)
        }

    def likelihoods(
        self, variant: Variant, places: Sequence[tuple[Array, Noise]]
    ) -> list[tuple[Point, list[Any]] | None]:
        """Innovations and gains of a variant at several points, each under a noise of its own.

        None where no filter is steady or a replay breaks down.
        """

        def job(place: tuple[Array, Noise]) -> tuple[Any, list[Any] | None]:
            try:
                core = self.machine(variant, place[0])
            except ValueError:
                return None, None
            return core, self.steady(core, place[1])

        own = list(self.pool.map(job, places))
        jobs = [
            (core, self.constants(theta), r, g, True)
            for (core, gains), (theta, _) in zip(own, places, strict=True)
            for r, g in zip(self.records, gains or [], strict=bool(gains))
        ]
        self.counter.replays += len(jobs)
        found = iter(list(self.pool.map(_replay, jobs)))
        result: list[tuple[Point, list[Any]] | None] = []
        for (_, gains), (theta, _) in zip(own, places, strict=True):
            if gains is None:
                result.append(None)
                continue
            point = self._point(variant, theta, [next(found) for _ in self.records])
            result.append(None if point.lost else (point, gains))
        return result

    def _point(self, variant: Variant, theta: Array, found: Sequence[_Replayed]) -> Point:
        det, lost = sum(f.log_det for f in found), any(f.lost for f in found)
        residuals = tuple(f.residuals for f in found)
        return Point(variant, theta, residuals, det, self.prior(theta), lost)

    def gains(self, variant: Variant, theta: Array, noise: Noise) -> list[Any]:
        """Kalman gains per record, about the variant at a point, first samples included.

        Raises:
            ValueError: no filter is steady under this noise.

        """
        core, offsets = self.machine(variant, theta), self.constants(theta)
        own = self.steady(core, noise)
        if own is None:
            raise ValueError(f"{variant.label}: no Kalman filter is steady under this noise")
        jobs = [(core, offsets, r, g, True) for r, g in zip(self.records, own, strict=True)]
        list(self.pool.map(_replay, jobs))
        self.counter.replays += len(jobs)
        return own

    def steady(self, core: Any, noise: Noise) -> list[Any] | None:
        """Steady Kalman gains per record; None where no filter is steady under this noise."""
        steady: dict[Any, Any] = {}
        own = []
        for r in self.records:
            key = (tuple(sorted(r.record.settings.items())), r.sampled.step, r.channels, r.steps)
            if key not in steady:
                there = with_settings(core, r.record.settings)
                try:
                    steady[key] = _core.kalman_gains(
                        there, r.sampled, noise.sensors(r), noise.torques(), self.speed
                    )
                except ValueError:
                    return None
            own.append(steady[key].copy())
        return own

    def points(
        self, variants: Sequence[Variant], thetas: Sequence[Array], gains: Sequence[Any]
    ) -> list[Point]:
        """Innovations at several points, side by side."""
        jobs, owners = [], []
        for k, (variant, theta) in enumerate(zip(variants, thetas, strict=True)):
            try:
                core, offsets = self.machine(variant, theta), self.constants(theta)
            except ValueError:
                core = None
            for r, g in zip(self.records, gains, strict=True):
                jobs.append((core, offsets, r, g, False))
                owners.append(k)
        found = list(self.pool.map(_replay, jobs))
        self.counter.replays += len(jobs)
        points = []
        for k, (variant, theta) in enumerate(zip(variants, thetas, strict=True)):
            own = [f for f, owner in zip(found, owners, strict=True) if owner == k]
            points.append(self._point(variant, theta, own))
        return points

    def torques(self, point: Point, gains: Sequence[Any]) -> list[dict[str, Array]]:
        """Per record: body -> torque of unknown course as the filter has it, N*m, shape (n,)."""
        core, offsets = self.machine(point.variant, point.theta), self.constants(point.theta)
        self.counter.replays += len(self.records)

        def one(job: tuple[Predictable, Any]) -> dict[str, Array]:
            record, own = job
            found = predicted(core, offsets, record, own, states=True)
            return dict(zip(found["bodies"], found["torques"].T, strict=True))

        return list(self.pool.map(one, zip(self.records, gains, strict=True)))

    def prior(self, theta: Array) -> float:
        """Squared distance of the shared unknowns from what is believed, in sigma."""
        off = (theta[: self.shared] - self.centre) / self.sigma
        return float(off @ off)

    def columns(self, point: Point, which: Sequence[int], gains: Sequence[Any]) -> list[Array]:
        """Derivatives of the residuals by some unknowns, finite differences, flat per unknown."""
        _, high = self.bounds(point.variant)
        moved, steps = [], []
        for k in which:
            step = _DIFFERENCE * (
                self.sigma[k] if k < self.shared and np.isfinite(self.sigma[k]) else 1.0
            )
            if point.theta[k] + step > high[k]:
                step = -step
            theta = point.theta.copy()
            theta[k] += step
            moved.append(theta)
            steps.append(step)
        base = flat(point.residuals)
        others = self.points([point.variant] * len(moved), moved, gains)
        return [(flat(o.residuals) - base) / s for o, s in zip(others, steps, strict=True)]


_HELD = 1e-9  # of a unit: a number that is not refitted
_BOX = 4.0  # sigma: nominal numbers stay within what a data sheet can mean


def flat(residuals: Sequence[Array]) -> Array:
    """All rows end to end."""
    return np.concatenate([r.ravel() for r in residuals])


def predicted(
    core: Any,
    offsets: Mapping[str, float],
    record: Predictable,
    gains: Any,
    *,
    moved: Mapping[str, float] | None = None,
    **options: bool,
) -> Any:
    """What `_core.predict` finds of one record.

    Args:
        core: the machine, the record's own settings not yet in it.
        offsets: channel -> what its sensor adds.
        record: what was measured.
        gains: of `GreyBox.gains`.
        moved: state -> what is added to it where the record begins.
        options: of `_core.predict`.

    """
    there = with_settings(core, record.record.settings)
    initial = record.initial(there, offsets)
    for state, x in (moved or {}).items():
        initial[state] = initial.get(state, 0.0) + x
    return _core.predict(
        there,
        record.sampled,
        gains,
        initial=initial,
        offsets=[offsets.get(c, 0.0) for c in record.channels],
        **options,
    )


class _Replayed(NamedTuple):
    residuals: Array
    log_det: float
    lost: bool


def _replay(job: tuple[Any, Mapping[str, float], Predictable, Any, bool]) -> _Replayed:
    core, offsets, record, gains, learn = job
    nothing = _Replayed(np.full(record.measured.shape, _LOST), 0.0, True)
    if core is None:
        return nothing
    try:
        found = predicted(core, offsets, record, gains, learn_first=learn)
    except (ValueError, RuntimeError):
        return nothing
    residuals = np.clip(found["residuals"], -_LOST, _LOST)
    return _Replayed(residuals, float(found["log_det"]), not found["finite"])
