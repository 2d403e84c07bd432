"""A record made ready for a machine's equations: one filter for all channels, noise beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.clocks import clock_of
from dualdrive.compare.controller import asked_torques, commanded_record
from dualdrive.compare.noise import like_noise
from dualdrive.compare.where import standing
from dualdrive.identify import Processing, Standstill
from dualdrive.identify.filtering import ANGLES, Piece, pieces
from dualdrive.identify.standstill import at_rest
from dualdrive.traces import Trace

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Samples = Mapping[str, Array]

DRIVES = tuple(angle for angle in ANGLES if angle != "theta_m")
#: no controller's law, which answers smoothed motion, is believed better than this share
LAW = 0.03
_MEDIAN = 0.6745  # of a normal distribution's deviation: the median of its size


@dataclass(frozen=True, eq=False)
class Held:
    """A record after one and the same zero-phase filter for angles and torques, decimated.

    samples:  names as the core's torque balance reads them -> shape (n,)
    noisy:    the same with as much noise again as the sensors make
    keep:     samples at which no body stands still, shape (n,)
    encoders: angles of drives whose zero against the table's is not known
    asked:    torque of the controller's law less the measured one, of each motor, shape (m, n);
              none where the law is not asked, or not known
    doubt:    what noise leaves of that, shape (m,)
    """

    record: str
    t: Array
    samples: Samples
    noisy: Samples
    keep: Flags
    equations: tuple[str, ...]
    encoders: tuple[str, ...]
    step: float
    asked: Array
    doubt: Array

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of all rows of a residual: equations of motion, then one of the law per motor."""
        return (*self.equations, *(f"controller_{k + 1}" for k in range(len(self.asked))))


def hold(
    core: Any,
    trace: Trace,
    record: str,
    processing: Processing,
    standstill: Standstill | None = None,
    *,
    law: bool = False,
) -> Held:
    """Filter a record once, as it is and with as much noise again as its sensors make.

    law: whether the controller is asked for its torques, too, which simulates it twice

    Raises ValueError as :func:`dualdrive.identify.torque_balance` does.
    """
    parts = list(pieces(trace, record, processing))
    equations = _equations(core, trace)
    rest = standstill or Standstill()
    limits = rest.limits(parts)
    noisy = list(pieces(shaken(core, trace, record, processing, rest), record, processing))
    apart = equations != ("total",) and "theta_m" in trace
    t = np.concatenate([p.t[processing.kept(len(p), p.step)] for p in parts])
    known = _asked(core, trace, record, parts, noisy, processing) if law else None
    asked, doubt = known or (np.zeros((0, len(t))), np.zeros(0))
    return Held(
        record,
        t,
        _filtered(parts, processing),
        _filtered(noisy, processing),
        np.concatenate([_moving(p, equations, limits, processing, rest) for p in parts]),
        equations,
        tuple(angle for angle in DRIVES if angle in trace) if apart else (),
        parts[0].step,
        asked,
        doubt,
    )


def shaken(
    core: Any, trace: Trace, record: str, processing: Processing, standstill: Standstill
) -> Trace:
    """The trace with as much noise again as its sensors and its clock make."""
    random, clock = np.random.default_rng(1), clock_of(trace, record)
    if "theta_ref" in trace:
        still = standing(trace.t, trace["theta_ref"])
    else:
        parts = list(pieces(trace, record, processing))
        still = _resting(trace.t, parts, _equations(core, trace), standstill.limits(parts))
    noisy = trace
    for name in trace:
        values = trace[name]
        noise = like_noise(trace.t, values, still, random)
        wrong = random.normal(0.0, clock.wrong, len(trace)) * np.gradient(values, trace.t)
        noisy = noisy.with_channel(name, values + noise + wrong)
    return noisy


def floor_of_noise(plain: Array, noisy: Array, counts: Flags) -> float:
    """RMS of what noise changes in an equation, (n,) each, as its median tells: it has no tails.

    Where noise turns the sign of a speed friction jumps: that is standstill, and no noise.
    """
    apart = (noisy - plain)[counts]
    return float(np.sqrt(np.median(apart**2)) / _MEDIAN) if len(apart) else 0.0


def alike_in_rows(held: Sequence[Held]) -> list[Held]:
    """Records that can be weighed together: the law counts where all of them have it."""
    if len({h.rows for h in held}) == 1:
        return list(held)
    return [replace(h, asked=h.asked[:0], doubt=h.doubt[:0]) for h in held]


def _asked(
    core: Any,
    trace: Trace,
    name: str,
    parts: Sequence[Piece],
    noisy: Sequence[Piece],
    processing: Processing,
) -> tuple[Array, Array] | None:
    """The controller's law against the torques, filtered alike, and what noise leaves of that."""
    torques = [f"T_{motor.rpartition('_')[2]}" for motor in core.motors]
    record = commanded_record(core, trace, name) if len(parts) == 1 else None
    if record is None or not set(torques) <= set(trace):
        return None
    found = []
    for p in (parts[0], noisy[0]):
        law = asked_torques(core, record, p)
        if law is None:
            return None
        measured = processing.low_pass(np.stack([p.samples[name] for name in torques]), p.step)
        found.append(processing.reduce(law - measured, p.step))
    size = np.std(
        processing.reduce(np.stack([parts[0].samples[n] for n in torques]), p.step), axis=1
    )
    doubt = np.hypot(np.std(found[1] - found[0], axis=1), LAW * size)
    return found[0], np.asarray(doubt + 1e-300)


def _resting(
    t: Array, parts: Sequence[Piece], equations: Sequence[str], limits: Mapping[str, float]
) -> Flags:
    """Samples at which no body moves, of a record whose command is not known, shape (n,)."""
    found = np.zeros(len(t), dtype=bool)
    for p in parts:
        rest = at_rest(equations, p.samples, limits).all(axis=0)
        inside = (t >= p.t[0]) & (t <= p.t[-1])
        found[inside] = np.interp(t[inside], p.t, rest) == 1.0
    return found


def _moving(
    part: Piece,
    equations: Sequence[str],
    limits: Mapping[str, float],
    processing: Processing,
    standstill: Standstill,
) -> Flags:
    """Samples that every body's standstill is further from than the filter reaches."""
    if standstill.treatment == "keep":
        return np.ones(len(processing.kept(len(part), part.step)), dtype=bool)
    from scipy.ndimage import maximum_filter1d

    rest = at_rest(equations, part.samples, limits).any(axis=0)
    cutoff = processing.at(part.step).cutoff
    assert cutoff is not None
    reach = 2 * round(1.0 / (cutoff * part.step)) + 1
    near = maximum_filter1d(rest.astype(np.uint8), reach).astype(bool)
    return np.asarray(~near[processing.kept(len(part), part.step)])


def _filtered(parts: Sequence[Piece], processing: Processing) -> Samples:
    """Angles have passed the low-pass once already; now torques, and both once more."""

    def one(name: str, x: Array, step: float) -> Array:
        known = any(name in (a, *rates) for a, rates in ANGLES.items())
        return processing.reduce(x if known else processing.low_pass(x, step), step)

    return {
        name: np.ascontiguousarray(
            np.concatenate([one(name, p.samples[name], p.step) for p in parts])
        )
        for name in parts[0].samples
    }


def _equations(core: Any, trace: Trace) -> tuple[str, ...]:
    """Every body's equation where all bodies' motion is recorded, else their sum alone."""
    states = [name.removeprefix("omega_") for name, _ in core.states() if "omega_" in name]
    rigid = {n for n in "12" if _kind(core, f"gearbox_{n}") in ("rigid", None)}
    for body in states:
        n = body[-1]
        angles = {f"theta_{body}"} | ({f"theta_{n}", f"theta_c{n}"} if n in rigid else set())
        if len(states) == 1:
            angles = set(ANGLES)
        if not angles & set(trace):
            return ("total",)
    return tuple(states)


def _kind(core: Any, connection: str) -> str | None:
    return str(core.kind(connection)) if connection in core.connections else None
