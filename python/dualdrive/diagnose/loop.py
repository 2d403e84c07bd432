"""Closed loop: every record is simulated, and each channel that both have is a series.

The channels are those of the headline error: following error, currents or torques, deflections.
Absolute angles would say the same thing once per encoder, in units of the tightest noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.compare.noise import noise_floor
from dualdrive.compare.where import standing
from dualdrive.diagnose.confront import Series, Tolerance, believable, nominal_unknowns
from dualdrive.estimation.unknowns import default_free
from dualdrive.identify.closed_loop import FitError, Problem, channels_to_fit
from dualdrive.identify.evaluation import state_unknowns
from dualdrive.identify.parts import sizes_of_part
from dualdrive.mapper import Threads
from dualdrive.replay import Record, headline, ratio_to_table

Array = NDArray[np.float64]

_SHORTEST = 5e-5  # s: a delay below that costs a simulation more than it could show
RTOL = 1e-6  # local tolerance: far below a record's noise
_MOST_STEPS = 8_000  # of an integrator per second: a trial that takes more chatters
_CALM = 0.1  # s after the command has stopped
#: how far the zero of a current or torque sensor may be off, as a share of its channel's spread
CURRENT_ZERO = 0.05


class ClosedLoop:
    """See :class:`~dualdrive.diagnose.confront.Confrontation`."""

    mode = "closed_loop"
    one_clock = False

    def __init__(
        self,
        core: Any,
        played: Sequence[Record],
        rtol: float = RTOL,
        *,
        tolerance: Tolerance = None,
    ) -> None:
        self.core, self.records = core, list(played)
        self.nominal = nominal_unknowns(core, default_free(core), tolerance)
        self.problem = Problem(
            core,
            self.records,
            self.nominal,
            state_unknowns(core, self.records),
            channels=channels_to_fit(self.records, None),
            rtol=rtol,
            mapper=Threads(1),
        )
        self.series = [self._series(*row) for row in self.problem.rows]
        prior = self.problem.prior
        self.centre, self.sigma = prior.mean, prior.sigma.copy()
        first = len(self.nominal)
        for j, (k, name) in enumerate(self.problem.offsets):
            if self.records[k].channel(name).kind in ("current", "torque"):
                self.sigma[first + j] = CURRENT_ZERO
        self.low, self.high = believable(*self.problem.bounds, self.centre, self.sigma)
        self.start = self.problem.start
        self._most_steps = _MOST_STEPS * round(sum(r.t[-1] - r.begin for r in self.records) + 1.0)

    def _series(self, k: int, name: str) -> Series:
        record = self.records[k]
        c = record.channel(name)
        still = standing(record.t, record.reference)
        rate = np.abs(np.gradient(c.measured, record.t))
        floor = noise_floor(record.t, c.measured, still).rms
        keep = np.ones(len(record.t), dtype=bool)
        calm = standing(record.t, record.reference, settle=_CALM)
        own = (record.name, name, c.kind, c.unit, record.t, c.measured, floor, rate, keep, calm)
        return Series(*own)

    def _problem(self, core: Any) -> Problem:
        own = copy(self.problem)
        own.core = core
        return own

    def left(self, core: Any, u: Array) -> list[Array] | None:
        """Simulated plus the sensor's constant minus measured."""
        own = self._problem(core)
        own.max_steps = self._most_steps
        try:
            replays = own.replays(u)
        except ValueError:
            return None  # an effect outside what the core can simulate
        if replays is None:
            return None
        left = own.unweighted(replays, u)
        return [left[row] for row in own.rows]

    def slopes(self, core: Any, u: Array) -> list[Array] | None:
        """Exact sensitivities from the engine."""
        own = self._problem(core)
        try:
            slopes = own.slopes(u)
        except (FitError, ValueError):
            return None
        return [slopes[row] for row in own.rows]

    def machine_at(self, core: Any, u: Array) -> Any:
        """The core's machine with the nominal numbers of u."""
        return self._problem(core).machine_at(u)

    def levelled(self, core: Any, u: Array) -> Array:
        """The point with every sensor's constant where the mean of its residual vanishes."""
        return self._problem(core).levelled(u)

    @property
    def channels(self) -> list[str]:
        """Recorded channels that a recorder may have spoilt."""
        return sorted(
            {n for r in self.records for c in r.channels for n, _ in c.parts} - {"theta_ref"}
        )

    def headline(self, left: Sequence[Array]) -> float:
        """Mean over following error, currents or torques, and deflections, RMS over spread."""
        by_row = dict(zip(self.problem.rows, left, strict=True))
        square: dict[str, float] = {}
        whole: dict[str, float] = {}
        channels = [(k, c) for k, r in enumerate(self.records) for c in r.channels if c.headline]
        for k, c in channels:
            if (k, c.name) not in by_row:
                continue
            residual = by_row[k, c.name]
            residual = residual - np.mean(residual) if c.floating else residual
            square[c.name] = square.get(c.name, 0.0) + float(residual @ residual)
            whole[c.name] = whole.get(c.name, 0.0) + len(residual) * c.spread**2
        errors = {name: math.sqrt(square[name] / whole[name]) for name in square}
        return headline(errors, [c for _, c in channels if c.name in errors])

    def columns(self, k: int) -> Mapping[str, Array]:
        """The record's own columns, and the command that was played."""
        record = self.records[self.problem.rows[k][0]]
        own = {name: np.asarray(record.trace[name]) for name in record.trace}
        return {**own, "theta_ref": record.reference}

    def part_sizes(self, effects: Sequence[tuple[str, str]]) -> dict[str, dict[str, float]]:
        """From the largest torque, current or voltage recorded, and the play of the meshes."""
        found = {}
        for effect, place in effects:
            if not _core.effect_type(effect).structural:
                continue
            trial = self.core.copy()
            label = trial.add_effect(effect, place)
            [own] = [e for e in trial.effects if e["label"] == label]
            found[label] = sizes_of_part(trial, own, self.records)
        return found

    def sizes(self) -> dict[str, float]:
        """Spread of the drives' torque carried to the table, N*m, of its speed, and its travel.

        Beside them the spread of a motor's current, A.
        """
        torque = current = 0.0
        for record in self.records:
            for motor in self.core.motors:
                n, constant = motor.rpartition("_")[2], self.core.get(f"{motor}.K_d")
                for name, factor in ((f"T_{n}", 1.0), (f"I_{n}", constant)):
                    if name in record.trace:
                        spread = factor * float(np.std(record.trace[name]))
                        torque = max(torque, ratio_to_table(self.core, motor) * spread)
                        current = max(current, spread / constant)
        speed = max(float(np.std(np.gradient(r.reference, r.t))) for r in self.records)
        travel = max(float(np.ptp(r.reference)) for r in self.records)
        return {
            "torque": torque,
            "speed": speed,
            "travel": travel,
            "current": current,
            "delay": _SHORTEST,
        }
