"""Is one channel late against another? A time skew in a recording poses as compliance, or as play.

Two encoders on one train differ by their zeros, by what is between them (a twist that grows with
the torque, and turns over with it where there is play), by a friction that turns over with speed,
and by a delay, which grows with speed. A torque and the motion that it makes differ by a delay
where the torque follows the acceleration's *rate*. Both are fitted by least squares on signals that
have passed one and the same zero-phase filter, with intervals that allow for coloured residuals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.clocks import in_time
from dualdrive.identify import Processing, with_torques
from dualdrive.identify.filtering import ANGLES, Piece, pieces
from dualdrive.identify.regression import Prior, Rows, solve
from dualdrive.replay import core_of, named, ratio_to_table
from dualdrive.traces import Trace

Array = NDArray[np.float64]

_FILTER = Processing(decimate=10)

_DEVIATIONS = 4.0  # from zero, of an estimate that is told
_LEAST = 0.1  # of a sample: less does no harm
_MOST = 20.0  # samples: more is another motion, not a delay
_PART = 0.02  # of what it is fitted to that a delay must explain
_STANDS = 0.02
#: samples that a torque may act late and be none the worse: computed in one, held for the next
_HELD = 1.5
#: share of a torque's mean square that its fit may leave: beyond, other laws are at work
_UNCLEAR = 0.05


@dataclass(frozen=True)
class Skew:
    """By how much `late` comes later than `early`, s, with its 95 % interval.

    pose: the delay that is none: between encoders viscous friction over stiffness, by the machine's
          own numbers; of a torque the time for which a drive computes and holds it
    apart, left: between encoders, RMS about its mean of what they part by at the table, as recorded
          and with the delay put right, rad; of a torque not a number
    """

    record: str
    early: str
    late: str
    seconds: float
    low: float
    high: float
    step: float
    pose: float
    significant: bool
    apart: float = math.nan
    left: float = math.nan

    @property
    def message(self) -> str:
        """What was found, what it would be taken for, and what to do if it is real."""
        time = f"{1e3 * self.seconds:.3g} ms"
        span = f"{1e3 * self.low:.3g} to {1e3 * self.high:.3g} ms"
        samples = f"{self.seconds / self.step:.2g} samples"
        encoders = not self.late.startswith("T_") and not self.early.startswith("T_")
        like = "compliance or backlash" if encoders else "a lag of the drive or a lighter inertia"
        share = ""
        if self.left < self.apart:  # known, between encoders, and no play hides it
            share = f"; it makes {1.0 - self.left / self.apart:.0%} of what they part by"
        return (
            f"{self.record}: {self.late} lags {self.early} by {time} ({span}; {samples}){share}. "
            f"Uncorrected, this looks like {like}. If it is real: dualdrive add MACHINE "
            f"sensor_delay@{self.late} --set time={1e3 * self.seconds:.3g}ms"
        )


def skews(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    *,
    processing: Processing | None = None,
) -> list[Skew]:
    """Delays between the encoders of each drive and the table's, and of torques and encoders.

    Args:
        machine: a machine, or the core's: its ratios, stiffness and friction; delays of recorders
            that it knows already are taken off.
        traces: one trace, several, or name -> trace.
        processing: filters; a tenth of the sampling rate unless given.

    Returns:
        Every pair that could be estimated; those that matter are `significant`. Records too short
        for the filters have none.

    """
    core = core_of(machine)
    found: list[Skew] = []
    for name, trace in named(traces).items():
        try:
            known = in_time(core, with_torques(core, trace))
            parts = list(pieces(known, name, processing or _FILTER))
        except ValueError:
            continue
        for motor in core.motors:
            found += _of_drive(core, name, parts, motor)
    return found


def _of_drive(core: Any, record: str, parts: Sequence[Piece], motor: str) -> list[Skew]:
    n, samples = motor.rpartition("_")[2], parts[0].samples
    angle = next((a for a in (f"theta_{n}", f"theta_c{n}") if a in samples), None)
    torque = f"T_{n}" if f"T_{n}" in samples else None
    found: list[Skew | None] = []
    if angle and "theta_m" in samples:
        part = motor if angle == f"theta_{n}" else f"pinion_{n}"
        ratio = ratio_to_table(core, part)
        pose = _posing(core, n)
        found.append(_between_encoders(record, parts, angle, ratio, torque, pose))
    seen = angle or ("theta_m" if "theta_m" in samples else None)
    if torque and seen:
        found.append(_of_torque(record, parts, torque, seen))
    return [skew for skew in found if skew is not None]


def _posing(core: Any, n: str) -> float:
    """Viscous friction behind the drive over the stiffness before it: a delay that is none."""
    mesh = f"mesh_{n}"
    if mesh not in core.connections or core.kind(mesh) == "rigid":
        return 0.0
    down = core.get(f"{mesh}.ratio") if core.get(f"{mesh}.ratio") else 1.0
    share = sum(c.startswith("mesh_") for c in core.connections)
    behind = core.get("table.b") / down**2 / share
    return float(behind / core.get(f"{mesh}.stiffness"))


def _between_encoders(
    record: str, parts: Sequence[Piece], angle: str, ratio: float, torque: str | None, pose: float
) -> Skew | None:
    """Twist = zero + delay · speed + slip · angle + torque / stiffness + play · flank."""

    def row(p: Piece) -> tuple[Array, list[Array]]:
        speed = p.samples["omega_m"]
        twist = p.samples[angle] / ratio - p.samples["theta_m"]
        load = p.samples[torque] if torque else p.samples["alpha_m"]
        turned = p.samples["theta_m"] - np.mean(p.samples["theta_m"])
        moving = np.where(np.abs(speed) > _STANDS * np.max(np.abs(speed)), np.sign(speed), 0.0)
        return twist, [speed, turned, load, np.sign(load), moving]

    fitted = _fitted(parts, row, _FILTER)
    if fitted is None:
        return None
    value, sigma, part = fitted
    found = _told(record, angle, "theta_m", value, sigma, part, parts[0].step, pose)
    seen = [(*row(p), p.step) for p in parts]
    apart = [_FILTER.reduce(twist, step) for twist, _, step in seen]
    left = [_FILTER.reduce(twist - value * own[0], step) for twist, own, step in seen]
    return replace(found, apart=_spread(apart), left=_spread(left))


def _spread(parts: Sequence[Array]) -> float:
    """RMS about the mean."""
    return float(np.std(np.concatenate(parts)))


def _of_torque(record: str, parts: Sequence[Piece], torque: str, angle: str) -> Skew | None:
    """Torque = J (acceleration − delay · its rate) + friction + constant."""
    speed_of, rate_of = ANGLES[angle]

    def row(p: Piece) -> tuple[Array, list[Array]]:
        speed, rate = p.samples[speed_of], p.samples[rate_of]
        moving = np.where(np.abs(speed) > _STANDS * np.max(np.abs(speed)), np.sign(speed), 0.0)
        return p.samples[torque], [np.gradient(rate, p.step), rate, speed, moving]

    fitted = _fitted(parts, row, _FILTER, over=1)
    if fitted is None:
        return None
    value, sigma, part = fitted
    step = parts[0].step
    return _told(record, angle, torque, -value, sigma, part, step, _HELD * step)


def _told(
    record: str,
    early: str,
    late: str,
    value: float,
    sigma: float,
    part: float,
    step: float,
    pose: float,
) -> Skew:
    if value < 0.0:
        early, late, value = late, early, -value
    clear = value > max(_DEVIATIONS * sigma + 2.0 * pose, _LEAST * step) and part > _PART
    reach = 1.96 * sigma
    return Skew(
        record,
        early,
        late,
        value,
        value - reach,
        value + reach,
        step,
        pose,
        bool(clear and value < _MOST * step),
    )


def _fitted(
    parts: Sequence[Piece], row: Any, processing: Processing, over: int | None = None
) -> tuple[float, float, float] | None:
    """First coefficient, its deviation, and the share of the target that its column explains.

    over: the coefficient is told over this other one, whose deviation counts too
    """
    targets, columns = [], []
    for p in parts:
        target, own = row(p)
        every = np.stack([*own, np.ones(len(target))])
        targets.append(processing.reduce(target, p.step))
        columns.append(processing.reduce(every, p.step).T)
    target, design = np.concatenate(targets), np.concatenate(columns)
    count = design.shape[1]
    size = np.linalg.norm(design, axis=0)
    if len(target) < 5 * count or size[0] == 0.0 or float(np.std(target)) == 0.0:
        return None
    scaled = design / np.where(size > 0.0, size, 1.0)
    keep = np.ones((1, len(target)), dtype=bool)
    rows = Rows(-target[None], scaled[None], target[None], keep)
    none = np.full(count, np.inf)
    found = solve([rows], Prior(np.zeros(count), none), -none, none)
    values = found.step / np.where(size > 0.0, size, 1.0)
    spread = np.sqrt(np.maximum(np.diag(found.covariance), 0.0)) / np.where(size > 0.0, size, 1.0)
    others = scaled[:, 1:]
    alone = scaled[:, 0] - others @ np.linalg.lstsq(others, scaled[:, 0], rcond=None)[0]
    gain = float(np.sum((alone * found.step[0]) ** 2))
    left = float(np.sum((target - scaled @ found.step) ** 2))
    part = gain / (gain + left) if gain + left > 0.0 else 0.0
    if over is None:
        return float(values[0]), float(spread[0]), part
    unclear = left > _UNCLEAR * float(np.sum((target - np.mean(target)) ** 2))
    if unclear or abs(values[over]) < 5.0 * spread[over]:
        return None
    value = float(values[0] / values[over])
    relative = np.hypot(spread[0] / values[over], value * spread[over] / values[over])
    return value, float(relative), part
