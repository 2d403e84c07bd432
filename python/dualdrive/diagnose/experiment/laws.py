"""The same distance for an axis whose controller is unknown: torques that two machines ask for.

The axis is taken to follow the command; each machine's equations of motion, closed at the table,
say what torque that takes. Nearly linear in every number, so that one step of least squares moves
machine B as near to A as its beliefs allow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.experiment.distance import Noise, beliefs
from dualdrive.motion import Motion
from dualdrive.replay import ratio_to_table

Array = NDArray[np.float64]

_SAMPLES = 3000
_STANDSTILL = 0.01  # share of the greatest speed below which dry friction is open
_TOTAL = "total"


def kinematics(core: Any, motion: Motion) -> dict[str, Array]:
    """Angles, speeds and accelerations of every body on a rigid train that follows the command."""
    t = np.linspace(0.0, motion.end, _SAMPLES)
    wave = motion.waveform
    table = {"theta": wave.value(t), "omega": wave.rate(t), "alpha": wave.acceleration(t)}
    found: dict[str, Array] = {"t": t}
    for body in core.bodies:
        ratio, suffix = ratio_to_table(core, body), _suffix(body)
        found |= {f"{what}_{suffix}": ratio * values for what, values in table.items()}
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        found[f"T_{n}"] = np.zeros(len(t))
        for what, values in table.items():
            found.setdefault(f"{what}_{n}", ratio_to_table(core, motor) * values)
    return found


def asked(core: Any, motion: Motion) -> tuple[Array, Array] | None:
    """Torque at the table that a motion takes, N*m, and the samples that count; shapes (n,)."""
    channels = kinematics(core, motion)
    slow = _STANDSTILL * float(np.max(np.abs(channels["omega_m"])))
    try:
        found = _core.torque_balance(core, channels, [], slow)
    except ValueError:
        return None
    row = list(found["equations"]).index(_TOTAL) if _TOTAL in found["equations"] else 0
    return found["residual"][row], found["standstill"][row] == 0


def share_of_limits(core: Any, torque: Array) -> float:
    """Largest share of the motors' greatest torque together that the motion takes."""
    most = sum(core.get(f"{m}.T_max") * ratio_to_table(core, m) for m in core.motors)
    return float(np.max(np.abs(torque))) / most if math.isfinite(most) and most > 0 else 0.0


def apart(
    core: Any,
    law: tuple[Array, Array],
    motion: Motion,
    noise: Noise,
    known: Mapping[str, float] | None = None,
) -> float:
    """Squared distance of the torque that a machine asks for, its numbers free, from a law's.

    law:   torque and samples that count, as of `asked`
    known: see `beliefs`
    """
    (torque, counted), free = law, beliefs(core, known)
    channels = kinematics(core, motion)
    try:
        found = _core.torque_balance(core, channels, [p.path for p in free])
    except ValueError:
        return math.inf
    row = list(found["equations"]).index(_TOTAL) if _TOTAL in found["equations"] else 0
    step = motion.end / (_SAMPLES - 1)
    keep = counted.astype(bool)
    weight = math.sqrt(step / noise.spacing) / torque_noise(core, noise)
    left = weight * (found["residual"][row] - torque)[keep]
    at = [p.coordinate(float(core.get(p.path))) for p in free]
    slopes = np.array([p.slope(u) for p, u in zip(free, at, strict=True)])
    columns = weight * found["jacobian"][row][keep] * slopes
    return _projected(left, columns, np.array([p.sigma for p in free]), weight)


def _projected(left: Array, columns: Array, sigma: Array, weight: float) -> float:
    """Squares left after the columns and a constant, within the beliefs, have done their best."""
    believed = np.where(np.isfinite(sigma), 1.0 / sigma, 0.0)
    constant = np.full((len(left), 1), weight)
    rows = np.block([[columns, constant], [np.diag(believed), np.zeros((len(sigma), 1))]])
    target = np.concatenate([left, np.zeros(len(sigma))])
    size = np.linalg.norm(rows, axis=0)
    size[size == 0.0] = 1.0
    move = np.linalg.lstsq(rows / size, -target, rcond=1e-9)[0]
    rest = target + rows / size @ move
    return float(rest @ rest)


def torque_noise(core: Any, noise: Noise) -> float:
    """RMS noise of the total at the table: given as such, or from the motors' torques.

    Raises:
        ValueError: neither is there.

    """
    if _TOTAL in noise.rms:
        return noise.rms[_TOTAL]
    own = [
        noise.rms[f"T_{n}"] * ratio_to_table(core, motor)
        for motor in core.motors
        if f"T_{(n := motor.rpartition('_')[2])}" in noise.rms
    ]
    own = own or [value for name, value in noise.rms.items() if name in ("m", "c1", "motor_1")]
    if not own:
        raise ValueError("noise: no torque among it; give that of total, or of T_1 and T_2")
    return math.hypot(*own)


def _suffix(body: str) -> str:
    """How channels call a body: m, c1, 1."""
    stem, _, n = body.rpartition("_")
    return {"motor": n, "pinion": f"c{n}"}.get(stem, "m")
