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
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.estimation.unknowns import Unknown
from dualdrive.innovations.harmonics import bounds, coordinates, values
from dualdrive.innovations.modulations import Modulation, modulations, usual_angle
from dualdrive.innovations.noise import Noise, first_noise
from dualdrive.innovations.prediction import Replayed, predicted, replayed
from dualdrive.innovations.records import Predictable
from dualdrive.innovations.variant import Point, Variant
from dualdrive.replay import ratio_to_table
from dualdrive.replay.record import with_settings

Array = NDArray[np.float64]

#: one-sigma of a sensor's constant: of a motor's encoder at the pinion, rad; of a current, relative
_ZERO_ANGLE, _ZERO_CURRENT = 1e-3, 0.02
#: of the drives' torque: what may have acted before a first sample, where a search of it begins
_BEFORE = 0.01


@dataclass(frozen=True, eq=False)
class Filtered:
    """What a filter has of a record at its samples, shape (n,) each.

    torques: body -> torque of unknown course, N*m
    states: state -> value, SI
    """

    torques: Mapping[str, Array]
    states: Mapping[str, Array]


class Counter:
    """Replays done; a stop is asked between them.

    stop: whether none should begin any more
    told: how many are done, after each lot of them
    """

    def __init__(
        self,
        stop: Callable[[], bool] = lambda: False,
        told: Callable[[int], None] = lambda _: None,
    ) -> None:
        self.replays, self.stop, self._told = 0, stop, told

    def add(self, replays: int) -> None:
        """So many more."""
        self.replays += replays
        self._told(self.replays)


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
        self._before = first_noise(core, self.records, _BEFORE)
        self.speed = max(
            float(np.sqrt(np.mean(np.gradient(r.record.reference, r.record.t) ** 2)))
            for r in records
        )
        driven = [r.record.reference for r in self.records]
        table = usual_angle(driven, [r.sampled.step for r in self.records])
        self._angles = {body: table * ratio_to_table(core, body) for body in core.bodies}

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

    def on(self, records: Sequence[Predictable]) -> GreyBox:
        """The same unknowns on other stretches of the same records."""
        own = copy(self)
        own.records = list(records)
        return own

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
        return sum(len(r.measured) for r in self.records)

    def start(self, variant: Variant) -> Array:
        """Where a fit from the data sheet begins: what it has as nought at its usual size."""
        nominal = [p.start for p in self.nominal] + [0.0] * len(self.offsets)
        start: Array = np.r_[nominal, coordinates(variant.extra, {})]
        return start

    def of_the_data_sheet(self, variant: Variant) -> Array:
        """The same with the data sheet's own numbers."""
        theta = self.start(variant)
        theta[: len(self.nominal)] = self.centre[: len(self.nominal)]
        return theta

    def believed(self, variant: Variant) -> tuple[Array, Array]:
        """Where every unknown of a variant is believed to be, and its precision, 1/sigma^2.

        Of a number that changes with an angle a data sheet tells its mean, and not what it is at
        the usual angle.
        """
        extra = variant.extra
        sigma = np.r_[self.sigma, [p.sigma for p in extra]]
        paths = [p.path for p in self.nominal]
        for own in self._modulations(variant):
            sigma[paths.index(own.number)] = np.inf
        return np.r_[self.centre, [p.centre for p in extra]], 1.0 / sigma**2

    def bounds(self, variant: Variant) -> tuple[Array, Array]:
        """Lowest and highest of every unknown."""
        pairs = [p.bounds for p in self.nominal] + [(-np.inf, np.inf)] * len(self.offsets)
        pairs += bounds(variant.extra)
        low, high = np.array(pairs).T
        reach = np.r_[_BOX * self.sigma, np.full(len(variant.extra), np.inf)]
        centre = np.r_[self.centre, np.zeros(len(variant.extra))]
        return np.maximum(low, centre - reach), np.minimum(high, centre + reach)

    def machine(self, variant: Variant, theta: Array) -> Any:
        """The core's machine of a variant at a point.

        Raises:
            ValueError: a number is beyond what it may be.

        """
        core = variant.grown.copy()
        for path, value in self.values(variant, theta).items():
            core.set(path, value)
        return core

    def values(self, variant: Variant, theta: Array) -> dict[str, float]:
        """Path -> SI value of every number that a machine at a point has, constants left out."""
        n = len(self.nominal)
        pairs = zip(self.nominal, theta[:n], strict=True)
        found = {p.path: p.value(float(u)) for p, u in pairs}
        found |= values(variant.extra, theta[self.shared :])
        for own in self._modulations(variant):
            found |= own.mean(found)
        return found

    def point_of(self, variant: Variant, known: Mapping[str, float], constants: Array) -> Array:
        """Where a variant has these values, shape (unknowns,).

        Args:
            variant: a machine with laws under trial.
            known: path -> SI value of every number.
            constants: of sensors, as a point has them.

        """
        at = dict(known)
        for own in self._modulations(variant):
            at |= own.usual(at)
        nominal = [p.coordinate(at[p.path]) for p in self.nominal]
        found: Array = np.r_[nominal, constants, coordinates(variant.extra, at)]
        return found

    def modulated(self, variant: Variant) -> list[str]:
        """Paths of numbers that change with an angle, and of what they change by."""
        every = self._modulations(variant)
        return [path for own in every for path in (own.number, own.strength)]

    def _modulations(self, variant: Variant) -> list[Modulation]:
        return modulations(variant, self.nominal, self._angles)

    def resting(self, variant: Variant) -> dict[str, float]:
        """Body that dry friction may hold -> its RMS speed as commanded, rad/s; none at rest."""
        if self.speed == 0.0:
            return {}
        return {
            body: self.speed * abs(ratio_to_table(self.core, body))
            for body in _core.held_by_friction(variant.grown)
        }

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
        steady = [
            (core, self.constants(theta), gains)
            for (core, gains), (theta, _) in zip(own, places, strict=True)
            if gains is not None
        ]
        found = iter(self._learned(steady))
        result: list[tuple[Point, list[Any]] | None] = []
        for (_, gains), (theta, _) in zip(own, places, strict=True):
            if gains is None:
                result.append(None)
                continue
            point = self._point(variant, theta, next(found))
            result.append(None if point.lost else (point, gains))
        return result

    def _learned(
        self, jobs: Sequence[tuple[Any, Mapping[str, float], list[Any]]]
    ) -> list[list[Replayed]]:
        """Replays of machines under gains that learn how a record begins.

        The first of the records whose gains are alike learns, others begin as it does.
        """
        found: dict[tuple[int, int], Replayed] = {}
        first = [[first_alike(gains, r) for r in range(len(gains))] for _, _, gains in jobs]
        for leading in (True, False):
            batch, owners = [], []
            for k, (core, offsets, gains) in enumerate(jobs):
                for r, record in enumerate(self.records):
                    if (first[k][r] == r) != leading:
                        continue
                    if not leading:
                        gains[r].begin_as(gains[first[k][r]])
                    batch.append((core, offsets, record, gains[r], True))
                    owners.append((k, r))
            self.counter.add(len(batch))
            found.update(zip(owners, self.pool.map(replayed, batch), strict=True))
        return [[found[k, r] for r in range(len(self.records))] for k in range(len(jobs))]

    @staticmethod
    def _kind(record: Predictable) -> tuple[Any, ...]:
        """What the gains of a record depend on."""
        settings = tuple(sorted(record.record.settings.items()))
        unsure = tuple(sorted(record.unsure.items()))
        step, channels = record.sampled.step, record.channels
        return settings, step, channels, record.steps, unsure

    def _point(self, variant: Variant, theta: Array, found: Sequence[Replayed]) -> Point:
        det, lost = sum(f.log_det for f in found), any(f.lost for f in found)
        residuals = tuple(f.residuals for f in found)
        centre, precision = self.believed(variant)
        prior = float(precision @ (theta - centre) ** 2)
        return Point(variant, theta, residuals, det, prior, lost)

    def gains(self, variant: Variant, theta: Array, noise: Noise) -> list[Any]:
        """Kalman gains per record, about the variant at a point, first samples included.

        Raises:
            ValueError: no filter is steady under this noise.

        """
        core, offsets = self.machine(variant, theta), self.constants(theta)
        own = self.steady(core, noise)
        if own is None:
            raise ValueError(f"{variant.label}: no Kalman filter is steady under this noise")
        self._learned([(core, offsets, own)])
        return own

    def steady(self, core: Any, noise: Noise) -> list[Any] | None:
        """Steady Kalman gains per record; None where no filter is steady under this noise."""
        steady: dict[Any, Any] = {}
        own = []
        for r in self.records:
            key = self._kind(r)
            if key not in steady:
                there = with_settings(core, r.record.settings)
                try:
                    steady[key] = _core.kalman_gains(
                        there, r.sampled, noise.sensors(r), noise.torques(r), self.speed,
                        drifts=noise.drifts(r), second=noise.seconds(r),
                        creep=noise.creeps(r),
                        first_torque=self._before.with_torque(noise.initial).torques(r),
                        first_deviation=r.unsure,
                    )  # fmt: skip
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
                core = self.machine(variant, theta)
            except ValueError:
                core = None
            for r, g in zip(self.records, gains, strict=True):
                jobs.append((core, self.constants(theta), r, g, False))
                owners.append(k)
        found = list(self.pool.map(replayed, jobs))
        self.counter.add(len(jobs))
        points = []
        for k, (variant, theta) in enumerate(zip(variants, thetas, strict=True)):
            own = [f for f, owner in zip(found, owners, strict=True) if owner == k]
            points.append(self._point(variant, theta, own))
        return points

    def filtered(self, point: Point, gains: Sequence[Any]) -> list[Filtered]:
        """What the filter has of every record."""
        core, offsets = self.machine(point.variant, point.theta), self.constants(point.theta)
        self.counter.add(len(self.records))

        def one(job: tuple[Predictable, Any]) -> Filtered:
            record, own = job
            found = predicted(core, offsets, record, own, states=True)
            return Filtered(
                dict(zip(found["bodies"], found["torques"].T, strict=True)),
                dict(zip(found["states"], found["trajectory"].T, strict=True)),
            )

        return list(self.pool.map(one, zip(self.records, gains, strict=True)))


def first_alike(gains: Sequence[Any], r: int) -> int:
    """Place of the first record whose gains are those of one."""
    return next(k for k in range(r + 1) if k == r or gains[k].alike(gains[r]))


_HELD = 1e-9  # of a unit: a number that is not refitted
_BOX = 4.0  # sigma: nominal numbers stay within what a data sheet can mean
