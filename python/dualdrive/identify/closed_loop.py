"""The least-squares problem of a closed-loop fit.

Simulated minus measured of every headline channel, weighted; sensitivities give the Jacobian. The
unknowns are, in this order: parameters, one constant per sensor and record, initial states per
record. A channel's weight is one over the RMS of its residual, and a record counts with its
effective number of samples: residuals of a wrong model are wrong for seconds, and thousands of
alike samples must not shout down what the data sheet says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.estimation.unknowns import StateUnknown, Unknown, values_at
from dualdrive.identify.coloured import correlation_time
from dualdrive.identify.regression import Prior, Rows
from dualdrive.mapper import Mapper, Threads
from dualdrive.replay import RTOL, Record, Replay, play_all
from dualdrive.replay.error_measures import may_be_off
from dualdrive.replay.run import MAX_STEPS

Array = NDArray[np.float64]


#: a trial that takes so many times the steps of the first is given up: it chatters or explodes
_TROUBLED = 30


#: share of a channel's spread below which agreement is arithmetic, and its weight rises no more
_FINEST = 1e-4


#: derivatives larger than this in any unit are those of an explosion: their squares overflow
_OVERFLOWING = 1e100


class FitError(RuntimeError):
    """A fit that can't be done; the message says what failed and what to try."""


class Problem:
    """Residuals and their derivatives; remembers the last point and every failed simulation."""

    def __init__(
        self,
        core: Any,
        records: Sequence[Record],
        parameters: Sequence[Unknown],
        states: Sequence[StateUnknown],
        *,
        channels: Sequence[str],
        offsets: str = "all",
        rtol: float = RTOL,
        mapper: Mapper | None = None,
    ) -> None:
        self.mapper: Mapper = mapper or Threads()
        self.core, self.records = core, list(records)
        self.parameters, self.states = list(parameters), list(states)
        self.rtol, self.granted = rtol, offsets
        self.rows = [
            (k, name) for k, r in enumerate(self.records) for name in r.names if name in channels
        ]
        self.offsets = [
            (k, name) for k, name in self.rows if may_be_off(self.records[k].channel(name), offsets)
        ]
        self.spread = {own: self.records[own[0]].channel(own[1]).spread for own in self.rows}
        self.weights = {own: 1.0 / self.spread[own] for own in self.rows}
        self.failures: list[str] = []
        self.runs = 0
        self.max_steps = MAX_STEPS
        self._fresh: tuple[bytes, list[Replay]] | None = None
        self._known: tuple[bytes, dict[tuple[int, str], Array]] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """What copies and pickles take along; a copy plays its records one after the other."""
        own = {"mapper": Threads(1), "weights": dict(self.weights), "failures": []}
        return {**self.__dict__, **own, "_fresh": None, "_known": None}

    # --- where things stand in the vector of unknowns -----------------------------------------

    @property
    def size(self) -> int:
        """How many unknowns there are."""
        return len(self.parameters) + len(self.offsets) + len(self.states)

    @property
    def start(self) -> Array:
        """Parameters where their fit begins; constants scaled by their channel's spread."""
        return self._padded([p.start for p in self.parameters], 0.0)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest of every unknown."""
        low, high = (
            zip(*(p.bounds for p in self.parameters), strict=True) if self.parameters else ((), ())
        )
        return self._padded(low, -np.inf), self._padded(high, np.inf)

    @property
    def scale(self) -> Array:
        """How far a first step may go: a width of the prior, an effect's own size, a spread."""
        own = [p.sigma if np.isfinite(p.sigma) else max(1.0, abs(p.start)) for p in self.parameters]
        return np.concatenate([own, np.ones(len(self.offsets) + len(self.states))])

    def levelled(self, u: Array) -> Array:
        """The point with every sensor's constant where the mean of its residual vanishes."""
        replays = self.replays(u)
        if replays is None:
            raise FitError(f"the simulation fails at the starting point: {self.failures[-1]}")
        level, first = u.copy(), len(self.parameters)
        for j, own in enumerate(self.offsets):
            residual = replays[own[0]].residual(own[1])
            level[first + j] = -float(np.mean(residual)) / self.spread[own]
        return level

    @property
    def prior(self) -> Prior:
        """Nominal values within their tolerance, states within theirs, constants free."""
        spread = self._padded([p.sigma for p in self.parameters], 1.0)
        spread[len(self.parameters) : len(self.parameters) + len(self.offsets)] = np.inf
        return Prior(self._padded([p.centre for p in self.parameters], 0.0), spread)

    def _padded(self, own: Sequence[float], rest: float) -> Array:
        """A vector of all unknowns from what the parameters say, `rest` for the others."""
        return np.array([*own, *[rest] * (len(self.offsets) + len(self.states))], dtype=np.float64)

    def values(self, u: Array) -> dict[str, float]:
        """Path -> SI value of the parameters."""
        return values_at(self.parameters, u[: len(self.parameters)])

    def constants(self, u: Array) -> dict[tuple[str, str], float]:
        """(record, channel) -> what its sensor adds, SI."""
        first = len(self.parameters)
        return {
            (self.records[k].name, name): float(u[first + j]) * self.spread[k, name]
            for j, (k, name) in enumerate(self.offsets)
        }

    def initial(self, u: Array) -> list[dict[str, float]]:
        """Per record: state -> initial value."""
        first = len(self.parameters) + len(self.offsets)
        found: list[dict[str, float]] = [{} for _ in self.records]
        for j, s in enumerate(self.states):
            found[s.record][s.state] = s.centre + s.sigma * float(u[first + j])
        return found

    def machine_at(self, u: Array) -> Any:
        """The core's machine with the parameters of u."""
        core = self.core.copy()
        for path, value in self.values(u).items():
            core.set(path, value)
        return core

    # --- residuals ----------------------------------------------------------------------------

    def replays(self, u: Array, *, slopes: bool = False) -> list[Replay] | None:
        """Simulate every record at u; None (and a note) where one fails."""
        if not slopes and self._fresh and self._fresh[0] == u.tobytes():
            return self._fresh[1]
        asked: list[str] = []
        if slopes:
            asked = [p.path for p in self.parameters]
            asked += sorted({f"initial.{s.state}" for s in self.states})
        try:
            found = play_all(
                self.machine_at(u),
                self.records,
                asked,
                self.initial(u),
                mapper=self.mapper,
                rtol=self.rtol,
                max_steps=self.max_steps,
            )
        except ValueError as error:
            if self.runs == 0:  # an option that makes no sense, not a trial out of range
                raise
            self.failures.append(str(error))
            return None
        self.runs += len(found)
        for replay in found:
            if not replay.ok:
                self.failures.append(f"{replay.record.name}: {replay.status}: {replay.message}")
                return None
        if self.max_steps == MAX_STEPS:
            usual = max(int(replay.statistics["steps"]) for replay in found)
            self.max_steps = min(MAX_STEPS, _TROUBLED * (usual + 10_000))
        if not slopes:
            self._fresh = (u.tobytes(), found)
        return found

    def residual(self, u: Array) -> Array:
        """Weighted residuals, then what the priors say; infinite where a simulation fails."""
        replays = self.replays(u)
        if replays is None:
            count = sum(len(self.records[k].t) for k, _ in self.rows)
            return np.full(count + self._beliefs(u).size, np.inf)
        left = self.unweighted(replays, u)
        return np.concatenate(
            [*(self.weights[own] * left[own] for own in self.rows), self._beliefs(u)]
        )

    def unweighted(self, replays: Sequence[Replay], u: Array) -> dict[tuple[int, str], Array]:
        """(record, channel) -> simulated plus constant minus measured."""
        constants = self.constants(u)
        return {
            (k, name): replays[k].residual(name) + constants.get((self.records[k].name, name), 0.0)
            for k, name in self.rows
        }

    def jacobian(self, u: Array) -> Array:
        """Derivative of `residual`.

        Raises:
            FitError: the sensitivities fail where the simulation itself does not.

        """
        slopes = self.slopes(u)
        weighted = [self.weights[own] * slopes[own] for own in self.rows]
        prior = self.prior
        believed = np.isfinite(prior.sigma)
        return np.concatenate([*weighted, np.diag(np.sqrt(prior.precision()))[believed]])

    def slopes(self, u: Array) -> dict[tuple[int, str], Array]:
        """(record, channel) -> derivative of its unweighted residual, shape (n, unknowns)."""
        if self._known and self._known[0] == u.tobytes():
            return self._known[1]  # new weights ask at the same point again
        replays = self.replays(u, slopes=True)
        if replays is None:
            raise FitError(f"no sensitivities at the present point: {self.failures[-1]}")
        count = len(self.parameters)
        state_names = sorted({s.state for s in self.states})
        own_slope = np.array([p.slope(float(v)) for p, v in zip(self.parameters, u, strict=False)])
        found = {}
        for k, name in self.rows:
            whole = np.zeros((len(self.records[k].t), self.size))
            raw = replays[k].slopes.get(name, np.zeros((len(whole), 0)))
            if not np.abs(raw).max(initial=0.0) < _OVERFLOWING:
                raise FitError(f"{self.records[k].name}: the sensitivities of {name} overflow")
            whole[:, :count] = raw[:, :count] * own_slope
            if (k, name) in self.offsets:
                whole[:, count + self.offsets.index((k, name))] = self.spread[k, name]
            for j, s in enumerate(self.states):
                if s.record == k:
                    column = count + state_names.index(s.state)
                    whole[:, count + len(self.offsets) + j] = s.sigma * raw[:, column]
            found[k, name] = whole
        self._known = (u.tobytes(), found)
        return found

    def reweigh(self, u: Array) -> float:
        """Set weights from the residuals at u; return by how much they moved, as a factor."""
        replays = self.replays(u)
        if replays is None:
            raise FitError(f"the simulation fails at the starting point: {self.failures[-1]}")
        before = dict(self.weights)
        sizes, times = {}, []
        for own, left in self.unweighted(replays, u).items():
            steady = left - np.mean(left) if own in self.offsets else left
            rms = float(np.sqrt(np.mean(steady**2)))
            sizes[own] = max(rms, _FINEST * self.spread[own])
            times.append(correlation_time(steady))
        # one time for all: relative weights from sizes alone make the rounds descend on n log RMS
        alike = 1.0 + 2.0 * float(np.mean(times))
        self.weights = {own: 1.0 / (sizes[own] * np.sqrt(alike)) for own in self.rows}
        moved = [np.log(self.weights[own] / before[own]) for own in self.rows]
        return float(np.exp(np.max(np.abs(moved))))

    def regression_rows(self, u: Array) -> list[Rows]:
        """The problem linearised at u, one block per record, for the covariance."""
        replays = self.replays(u)
        assert replays is not None
        left, slopes = self.unweighted(replays, u), self.slopes(u)
        blocks = []
        for k, record in enumerate(self.records):
            own = [row for row in self.rows if row[0] == k]
            residual = np.stack([left[row] for row in own])
            measured = np.stack([record.channel(name).measured for _, name in own])
            jacobian = np.stack([slopes[row] for row in own])
            blocks.append(Rows(residual, jacobian, measured, np.ones(residual.shape, dtype=bool)))
        return blocks

    def _beliefs(self, u: Array) -> Array:
        prior = self.prior
        believed = np.isfinite(prior.sigma)
        result: Array = ((u - prior.mean) / prior.sigma)[believed]
        return result


def channels_to_fit(records: Sequence[Record], wanted: Sequence[str] | None) -> list[str]:
    """The headline channels, or those asked for.

    Raises:
        ValueError: a channel that is not compared.

    """
    known: Mapping[str, bool] = {c.name: c.headline for r in records for c in r.channels}
    for name in wanted or ():
        if name not in known:
            raise ValueError(f"channels: {name} is not compared; there are {', '.join(known)}")
    chosen = list(wanted or [name for name, counts in known.items() if counts])
    return chosen or [name for name in known if not name.startswith("theta_")] or list(known)
