"""Torque balance: every equation of motion on the recorded motion is a series.

For traces whose controller is unknown. Angles and torques pass one zero-phase filter; samples at
which any body stands are left out, because dry friction may take any value there. Where the bodies
move apart, the sum at the table stands beside the drives' own equations: mesh torques, whose
reading multiplies an encoder's noise by a stiffness, cancel in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.compare.excuses import first_zeros
from dualdrive.compare.held import Held, floor_of_noise, hold
from dualdrive.compare.laws import shifted
from dualdrive.diagnose.balance_motion import calm, sizes_of, usual_zero
from dualdrive.diagnose.confront import Series, Tolerance, believable, nominal_unknowns
from dualdrive.estimation.unknowns import Unknown, default_free
from dualdrive.identify import Processing, Standstill, with_torques
from dualdrive.identify.filtering import ANGLES, for_records
from dualdrive.identify.model import TORQUES
from dualdrive.identify.readings import before_sensors
from dualdrive.replay.record import with_settings
from dualdrive.traces import Trace

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: constant torque of an equation, as a share of the spread of its measured torque
CONSTANT = 0.5
_FAINTEST = 1e-6  # of the largest torque: no floor lies below
_TOO_FEW = 40  # samples that count, of the best equation


class TorqueBalance:
    """A machine confronted with records: what it leaves, and how that moves with what is not known.

    Nuisances: nominal numbers, then per record the zero of every drive's encoder against the
    table's and a constant torque per equation that has a motor.

    core:    the core's machine, its nominal numbers as they stand
    nominal: the machine's numbers that are refitted under every hypothesis
    series:  every equation on every record
    start:   where a refit begins, shape (m,)
    centre, sigma: of the prior of all nuisances, shape (m,); low, high: their bounds
    """

    def __init__(
        self,
        core: Any,
        traces: Mapping[str, Trace],
        settings: Mapping[str, Mapping[str, float]] | None = None,
        processing: Processing | None = None,
        standstill: Standstill | None = None,
        *,
        apart: bool = True,
        tolerance: Tolerance = None,
    ) -> None:
        """Draw up the balance.

        Args:
            core: the core's machine.
            traces: name -> trace.
            settings: of each trace.
            processing: filters.
            standstill: what is done near standstill.
            apart: whether the drives' own equations stand beside the sum; not where an encoder is
                late, which a stiffness turns into torque.
            tolerance: of the nominal numbers.

        """
        self.core, self.tolerance = core, tolerance
        self.settings = [dict((settings or {}).get(name, {})) for name in traces]
        whole = {name: with_torques(core, trace) for name, trace in traces.items()}
        process = for_records(processing, whole)
        self.held = [hold(core, t, name, process, standstill) for name, t in whole.items()]
        self.equations = _chosen(self.held[0]) if apart else ("total",)
        zeros = [
            first_zeros(with_settings(core, s), h)
            for s, h in zip(self.settings, self.held, strict=True)
        ]
        self.zeros = [
            (k, angle, zero)
            for k, own in enumerate(zeros)
            for angle, zero in own.items()
            if self.equations != ("total",)  # in the sum no twist counts
        ]
        self._scale = [usual_zero(core, self.held[k], angle) for k, angle, _ in self.zeros]
        self.nominal = self._free()
        raw = [self._evaluate(core, h, h.samples) for h in self.held]
        self._measured = [m for _, m in raw]
        self.constants = [
            (k, e)
            for k, m in enumerate(self._measured)
            for e in range(len(self.equations))
            if np.any(m[e] != 0.0)
        ]
        self.start = np.concatenate(
            [
                [p.start for p in self.nominal],
                np.zeros(len(self.zeros) + len(self.constants)),
            ]
        )
        rest = len(self.zeros)
        self.centre = self.start.copy()
        self.centre[: len(self.nominal)] = [p.centre for p in self.nominal]
        self.sigma = np.concatenate(
            [
                [p.sigma for p in self.nominal],
                np.full(rest, np.inf),
                np.full(len(self.constants), CONSTANT),
            ]
        )
        bounds = [p.bounds for p in self.nominal]
        free = np.full(rest + len(self.constants), np.inf)
        low = np.concatenate([[b[0] for b in bounds], -free])
        high = np.concatenate([[b[1] for b in bounds], free])
        self.low, self.high = believable(low, high, self.centre, self.sigma)
        self.series = self._series()
        if not any(s.keep.sum() > _TOO_FEW for s in self.series):
            raise ValueError(
                f"{', '.join(traces)}: no motion between standstills that outlasts the filter; "
                "record longer moves, or faster"
            )

    # --- what the confrontation offers --------------------------------------------------------

    def left(self, core: Any, u: Array) -> list[Array] | None:
        """What `core`, its nominal numbers moved to u, leaves of every series, (n,) each.

        `core` may carry effects that the machine of this balance lacks; None where no balance shows
        one of them.
        """
        own = self.machine_at(core, u)
        try:
            return [row for k in range(len(self.held)) for row in self._left_on(k, own, u)]
        except ValueError:
            return None  # an effect that no balance shows

    def slopes(self, core: Any, u: Array) -> list[Array] | None:
        """Derivative of the same by the nuisances, (n, m) each.

        By differences: of a machine's number on all records, of a zero on its own one. A constant
        stands in its own series alone.
        """
        here = self.left(core, u)
        if here is None:
            return None
        numbers, count = len(self.nominal), len(self.equations)
        found = [np.zeros((len(part), len(u))) for part in here]
        for j in range(self._first_constant):
            of_machine = j < numbers
            step = 1e-4 if of_machine else 1e-3
            moved = u.copy()
            moved[j] += step if u[j] + step <= self.high[j] else -step
            there = self.machine_at(core, moved)
            for k in range(len(self.held)) if of_machine else [self.zeros[j - numbers][0]]:
                try:
                    rows = self._left_on(k, there, moved)
                except ValueError:
                    return None
                for at, row in enumerate(rows, k * count):
                    found[at][:, j] = (row - here[at]) / (moved[j] - u[j])
        for j, (k, e) in enumerate(self.constants, self._first_constant):
            found[k * count + e][:, j] = self._level(k * count + e)
        return found

    def machine_at(self, core: Any, u: Array) -> Any:
        """The core's machine with the nominal numbers of u."""
        own = core.copy()
        for p, x in zip(self.nominal, u, strict=False):
            own.set(p.path, p.value(float(x)))
        return own

    def levelled(self, core: Any, u: Array) -> Array:
        """Constants of the equations where the means of what they leave vanish."""
        left, level = self.left(core, u), u.copy()
        for j, (k, e) in enumerate(self.constants):
            at = k * len(self.equations) + e
            if left is not None:
                s = self.series[at]
                mean = float(np.mean(left[at][s.keep])) if s.keep.any() else 0.0
                level[self._first_constant + j] -= mean / self._level(at)
        return level

    @property
    def one_clock(self) -> bool:
        """Whether a single angle is recorded, or speed: a delay would have no witness."""
        seen = [a for a, (rate, _) in ANGLES.items() if rate in self.held[0].samples]
        return len(seen) < 2

    @property
    def channels(self) -> list[str]:
        """Recorded torques; an angle's channel is its sensor, which is a place of its own."""
        return [name for name in TORQUES if name in self.held[0].samples]

    def headline(self, left: Sequence[Array]) -> float:
        """RMS over the spread of the measured torque: of the sum at the table, or of all."""
        count = len(self.equations)
        wanted = {"total"} if "total" in self.equations else set(self.equations)
        rows = [k for k in range(len(left)) if self.equations[k % count] in wanted]
        rows = [k for k in rows if self.series[k].spread > 0]
        square = sum(float(np.sum(left[k][self.series[k].keep] ** 2)) for k in rows)
        whole = sum(float(self.series[k].keep.sum()) * self.series[k].spread ** 2 for k in rows)
        return float(np.sqrt(square / whole)) if whole > 0 else float("nan")

    def columns(self, k: int) -> Mapping[str, Array]:
        """Filtered signals at the samples of series k."""
        found: Mapping[str, Array] = self.held[k // len(self.equations)].samples
        return found

    def sizes(self) -> dict[str, float]:
        """Spread of the torque carried to the table, N*m, of its speed, and its travel."""
        return sizes_of(self.core, self.held)

    # --- parts --------------------------------------------------------------------------------

    @property
    def _first_constant(self) -> int:
        return len(self.nominal) + len(self.zeros)

    def _level(self, at: int) -> float:
        """What a constant of a series is counted in: its spread, or its size where it is steady."""
        own = self.series[at].measured
        return self.series[at].spread or float(np.max(np.abs(own), initial=0.0)) or 1.0

    def _free(self) -> list[Unknown]:
        """Nominal numbers that move the balance on these records, and those of sensors' laws."""
        outside = {e["label"]: e["effect"] for e in self.core.effects if not e["in_balance"]}
        every = default_free(self.core)
        paths = [path for path in every if path.rpartition(".")[0] not in outside]
        moved = np.zeros(len(paths), dtype=bool)
        for held in self.held:
            found = _core.torque_balance(self.core, dict(held.samples), paths)
            rows = [found["equations"].index(name) for name in self.equations]
            size = np.abs(found["jacobian"][rows]).max(axis=1)
            moved |= np.any(size > 0.0, axis=0)
        kept = {path for path, own in zip(paths, moved, strict=True) if own}
        sensors = {label for label, e in outside.items() if _core.effect_type(e).invertible}
        kept |= {path for path in every if path.rpartition(".")[0] in sensors}
        return nominal_unknowns(self.core, [p for p in every if p in kept], self.tolerance)

    def _residual(self, core: Any, held: Held, samples: Mapping[str, Array]) -> Array:
        """What the chosen equations leave, (m, n)."""
        found = _core.torque_balance(core, dict(before_sensors(core, samples)))
        rows = [found["equations"].index(name) for name in self.equations]
        residual: Array = found["residual"][rows]
        return residual

    def _left_on(self, k: int, own: Any, u: Array) -> list[Array]:
        """What a machine at its numbers leaves of the series of one record."""
        set_ = with_settings(own, self.settings[k])
        found: list[Array] = list(self._residual(set_, self.held[k], self._shifted(k, u)))
        for j, (record, e) in enumerate(self.constants, self._first_constant):
            if record == k:
                found[e] = found[e] + u[j] * self._level(k * len(self.equations) + e)
        return found

    def _evaluate(self, core: Any, held: Held, samples: Mapping[str, Array]) -> tuple[Array, Array]:
        """Residual and measured torque of the chosen equations, (m, n) each."""
        residual = self._residual(core, held, samples)
        idle = {**samples, **{n: 0.0 * samples[n] for n in TORQUES if n in samples}}
        return residual, self._residual(core, held, idle) - residual

    def _shifted(self, k: int, u: Array) -> dict[str, Array]:
        first = len(self.nominal)
        zeros = {
            angle: zero + self._scale[j] * float(u[first + j])
            for j, (record, angle, zero) in enumerate(self.zeros)
            if record == k
        }
        return dict(shifted(self.held[k].samples, zeros))

    def _series(self) -> list[Series]:
        found = []
        for k, held in enumerate(self.held):
            core = with_settings(self.core, self.settings[k])
            noisy = self._residual(core, held, held.noisy)
            plain, measured = self._evaluate(core, held, held.samples)
            zeros = {angle: zero for record, angle, zero in self.zeros if record == k}
            speed = np.abs(next(held.samples[r] for r, _ in ANGLES.values() if r in held.samples))
            for e, name in enumerate(self.equations):
                keep = held.keep & calm(self.core, held, name, zeros)
                floor = floor_of_noise(plain[e], noisy[e], keep)
                found.append(Series(held.record, name, held.t, measured[e], floor, speed, keep))
        # a record that shows neither motion nor noise is believed no better than the others allow
        least = _FAINTEST * max((s.spread for s in found), default=0.0)
        return [replace(s, floor=max(s.floor, least)) for s in found]


def _chosen(held: Held) -> tuple[str, ...]:
    """The sum at the table, and the drives' own equations where they are recorded."""
    drives = tuple(e for e in held.equations if e not in ("m", "total"))
    return ("total", *drives) if len(held.equations) > 1 else ("total",)
