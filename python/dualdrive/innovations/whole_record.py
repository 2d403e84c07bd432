"""Records simulated whole: the filter without a torque of unknown course is a simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.noise import Noise, first_noise
from dualdrive.innovations.prediction import predicted
from dualdrive.innovations.records import Predictable
from dualdrive.innovations.variant import Variant

Array = NDArray[np.float64]

_STEPS = 4  # of Gauss-Newton
_BEGIN = 1e-4  # rad: first angles are believed no better, however well encoders read
_DIFFERENCE = 1e-3  # of a unit, for finite differences
_GAIN = 1e-3  # of the cost: a step that brings less ends the fit
_TWIN = 0.1  # of one reading's deviation: where a twin begins, which may part tenfold


@dataclass(frozen=True, eq=False)
class Simulated:
    """Records simulated whole.

    missed: measured less simulated of every record, SI, shape (rows, channels) each
    """

    missed: list[Array]
    _loop: _Loop = field(repr=False)
    _begin: Array = field(repr=False)

    def followed(self, noise: Noise) -> list[bool]:
        """Whether a simulation can follow each record at all.

        Where flanks or detents decide which way a motor falls, a machine parts from its own twin
        that begins as little elsewhere as no sensor can tell (sensitive dependence on the first
        state: Guckenheimer & Holmes, Nonlinear Oscillations, section 2.2). A record on which the
        twins leave more between them than the sensors' noise says nothing about a simulated
        machine, right or wrong; nor does one on which the twin is lost.

        Args:
            noise: of the sensors, which tells how well a first state is known.

        """
        return self._loop.followed(self._begin, self.missed, noise)

    def creeping(self, noise: Noise) -> Simulated | None:
        """The same where what dry friction holds follows its creep; None where that is lost.

        A simulation holds it, and goes on elsewhere: of friction that is not so dry that says more
        than of the machine. Nothing else is corrected by the record.

        Args:
            noise: of the sensors, and how fast what is held creeps.

        """
        loop = copy(self._loop)
        loop.gains = loop.grey.steady(loop.core, noise.of_a_simulation(loop.grey.records))
        missed = loop.residuals(self._begin)
        if missed is None:
            return None
        whole = [part * scale for part, scale in zip(missed, loop.scale, strict=True)]
        return replace(self, missed=whole, _loop=loop)


def simulated(grey: GreyBox, variant: Variant, theta: Array) -> Simulated | None:
    """Every record simulated whole, from where it fits best.

    The machine's numbers are held; what belongs to the records is fitted by Gauss-Newton: the
    sensors' constants, and at which angles of table and meshes, and with which tension, each record
    begins. None where the machine does not run.

    Args:
        grey: records and their sensors.
        variant: the machine.
        theta: its numbers, shape (unknowns,).

    """
    loop = _Loop(grey, variant, theta)
    x = np.zeros(loop.size)
    first = loop.residuals(x)
    if first is None:
        return None
    # every channel counts by what is left of it at first: beside the spread of a signal what a
    # sensor's constant takes away would weigh less than what is believed of the constant
    now = loop.weighted(first)
    for _ in range(_STEPS):
        J = loop.slopes(x, now)
        r = np.concatenate([part.ravel() for part in now])
        d = np.linalg.solve(J @ J.T + np.eye(loop.size), J @ r + x)
        cost = float(r @ r + x @ x)
        trials = [(y, loop.residuals(y)) for y in (x - d, x - 0.3 * d)]
        costs = [_square(f) + float(y @ y) if f else np.inf for y, f in trials]
        k = int(np.argmin(costs))
        if not costs[k] < cost:
            break
        x, now = trials[k][0], trials[k][1] or now
        if costs[k] > (1.0 - _GAIN) * cost:
            break
    return Simulated([part * loop.scale[k] for k, part in enumerate(now)], loop, x)


def _square(parts: Sequence[Array]) -> float:
    return float(sum(np.einsum("ij,ij->", part, part) for part in parts))


class _Loop:
    """Residuals of simulations, every channel over its spread, at what belongs to the records."""

    def __init__(self, grey: GreyBox, variant: Variant, theta: Array) -> None:
        self.grey, self.core = grey, grey.machine(variant, theta)
        self.constants = grey.constants(theta)
        spread: dict[str, float] = {}
        for r in grey.records:
            for kind, y in zip(r.kinds, r.measured.T, strict=True):
                spread[kind] = max(spread.get(kind, 0.0), float(np.std(y)))
        noise = Noise(spread, dict.fromkeys(spread, 0.0), {})
        self.gains = grey.steady(self.core, noise)
        self.scale = [np.array([spread[kind] for kind in r.kinds]) for r in grey.records]
        known = {state for state, _ in self.core.states()}
        angles = [s for s in ("theta_m", *_twists(self.core)) if s in known]
        unsure = dict.fromkeys(angles, _BEGIN)
        # the first reading of an encoder is as uncertain as any other
        readings = first_noise(self.core, grey.records, 0.0)
        for r in grey.records:
            first = _resolution(self.core, r, readings.variance(r))
            for state, sigma in (*first.items(), *r.unsure.items()):
                if state in known:
                    unsure[state] = max(unsure.get(state, 0.0), sigma)
        self.begins = unsure
        self.size = len(grey.offsets) + len(grey.records) * len(self.begins)

    def residuals(self, x: Array) -> list[Array] | None:
        """Per record; None where one is lost."""
        found = self._runs([(k, x) for k in range(len(self.grey.records))])
        return None if any(f is None for f in found) else [f for f in found if f is not None]

    def weighted(self, found: Sequence[Array]) -> list[Array]:
        """The same residuals, from now on each kind of channel over its RMS in them."""
        squares: dict[str, list[float]] = {}
        for part, r in zip(found, self.grey.records, strict=True):
            for kind, mean in zip(r.kinds, np.mean(part**2, axis=0), strict=True):
                squares.setdefault(kind, []).append(float(mean))
        left = {kind: float(np.sqrt(np.mean(s))) or 1.0 for kind, s in squares.items()}
        factors = [np.array([left[kind] for kind in r.kinds]) for r in self.grey.records]
        self.scale = [scale * f for scale, f in zip(self.scale, factors, strict=True)]
        return [part / f for part, f in zip(found, factors, strict=True)]

    def slopes(self, x: Array, now: Sequence[Array]) -> Array:
        """Derivatives, shape (unknowns, residuals); a record's own angles move no other one."""
        shared, own = len(self.grey.offsets), len(self.begins)
        jobs: list[tuple[int, Array]] = []
        rows: list[int] = []
        for k in range(len(now)):
            first = shared + k * own
            for u in (*range(shared), *range(first, first + own)):
                y = x.copy()
                y[u] += _DIFFERENCE
                jobs.append((k, y))
                rows.append(u)
        ends = np.cumsum([0, *(part.size for part in now)])
        J = np.zeros((self.size, ends[-1]))
        for (k, _), u, f in zip(jobs, rows, self._runs(jobs), strict=True):
            if f is not None:
                J[u, ends[k] : ends[k + 1]] = (f - now[k]).ravel() / _DIFFERENCE
        return J

    def followed(self, x: Array, missed: Sequence[Array], noise: Noise) -> list[bool]:
        """Per record, whether a twin stays within the noise; see `Simulated.followed`."""
        shared, own = len(self.grey.offsets), len(self.begins)
        known = [noise.variance(r) for r in self.grey.records]
        y = x.copy()
        for k, (r, variance) in enumerate(zip(self.grey.records, known, strict=True)):
            seen = _resolution(self.core, r, variance)
            moved = [min(_TWIN * seen.get(s, s0), s0) / s0 for s, s0 in self.begins.items()]
            y[shared + k * own : shared + (k + 1) * own] += moved
        found = list[bool]()
        twins = self._runs([(k, y) for k in range(len(known))])
        for k, (twin, one, variance) in enumerate(zip(twins, missed, known, strict=True)):
            if twin is None:
                found.append(False)
                continue
            parted = np.mean((twin * self.scale[k] - one) ** 2, axis=0)
            allowed = np.array([variance[c] for c in self.grey.records[k].channels])
            found.append(bool(np.all(parted <= allowed)))
        return found

    def _runs(self, jobs: Sequence[tuple[int, Array]]) -> list[Array | None]:
        self.grey.counter.add(len(jobs))
        return list(self.grey.pool.map(lambda job: self._run(*job), jobs))

    def _run(self, k: int, x: Array) -> Array | None:
        if self.gains is None:
            return None
        record, shared, own = self.grey.records[k], len(self.grey.offsets), len(self.begins)
        constants = dict(self.constants)
        for (channel, sigma), value in zip(self.grey.offsets.items(), x[:shared], strict=True):
            constants[channel] += sigma * float(value)
        first = x[shared + k * own : shared + (k + 1) * own]
        moved = {
            s: sigma * float(v) for (s, sigma), v in zip(self.begins.items(), first, strict=True)
        }
        return _missed(self.core, constants, record, self.gains[k], moved, self.scale[k])


def _missed(
    core: Any,
    constants: Mapping[str, float],
    record: Predictable,
    gains: Any,
    moved: Mapping[str, float],
    scale: Array,
) -> Array | None:
    try:
        found = predicted(core, constants, record, gains, moved=moved, states=True)
    except (ValueError, RuntimeError):
        return None
    if not found["finite"]:
        return None
    return np.asarray(found["innovations"]) / scale


def _resolution(core: Any, record: Predictable, variance: Mapping[str, float]) -> dict[str, float]:
    """State -> standard deviation with which one reading of an encoder tells it, rad."""
    table, found = variance.get("theta_m"), dict[str, float]()
    if table is not None:
        found["theta_m"] = float(np.sqrt(table))
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        mesh, gearbox = f"mesh_{n}", f"gearbox_{n}"
        for channel, geared in (
            (f"theta_{n}", gearbox in core.connections),
            (f"theta_c{n}", False),
        ):
            if channel in record.channels and mesh in core.connections:
                ratio = core.get(f"{gearbox}.ratio") if geared else 1.0
                of_table = core.get(f"{mesh}.ratio") ** 2 * (table or 0.0)
                found[f"{mesh}.twist"] = float(np.sqrt(variance[channel] / ratio**2 + of_table))
    return found


def _twists(core: Any) -> list[str]:
    return [f"{name}.twist" for name in core.connections]
