"""What recorded motion tells a torque balance: usual sizes, zeros, where contact stays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.held import Held
from dualdrive.identify.filtering import ANGLES
from dualdrive.replay import ratio_to_table

Flags = NDArray[np.bool_]

_GAPS = (0.7, 0.85, 1.0, 1.15, 1.3)  # of the nominal play: where contact may change
_REACH = 4  # samples on either side that the filter smears a change over


def sizes_of(core: Any, several: Sequence[Held]) -> dict[str, float]:
    """Spread of the torque carried to the table, N*m, of its speed, and its travel."""
    torque = speed = 0.0
    for held in several:
        for motor in core.motors:
            name = f"T_{motor.rpartition('_')[2]}"
            if name in held.samples:
                spread = float(np.std(held.samples[name]))
                torque = max(torque, ratio_to_table(core, motor) * spread)
        for _, (rate, _) in ANGLES.items():
            if rate in held.samples:
                part = {"omega_m": "table"}.get(rate) or _part(rate)
                own = float(np.std(held.samples[rate])) / ratio_to_table(core, part)
                speed = max(speed, own)
    travel = 0.0
    for angle in (a for held in several for a in ANGLES if a in held.samples):
        part = "table" if angle == "theta_m" else _part(angle.replace("theta", "omega"))
        own = max(float(np.ptp(h.samples[angle])) for h in several if angle in h.samples)
        travel = max(travel, own / ratio_to_table(core, part))
    return {"torque": torque, "speed": speed, "travel": travel}


def usual_zero(core: Any, held: Held, angle: str) -> float:
    """A usual error of an encoder's zero: its noise, or a hundredth of its drive's play."""
    n = angle[-1]
    noise = float(np.std(held.noisy[angle] - held.samples[angle]))
    mesh = f"mesh_{n}"
    play = core.get(f"{mesh}.gap") if mesh in core.connections else 0.0
    part = f"motor_{n}" if f"motor_{n}" in core.motors else f"pinion_{n}"
    ratio = ratio_to_table(core, part) / max(ratio_to_table(core, mesh), 1e-12)
    return max(noise, 0.01 * play * ratio, 1e-12)


def calm(core: Any, held: Held, equation: str, zeros: Mapping[str, float]) -> Flags:
    """Samples further from a change of contact than the filter reaches, (n,).

    A contact law on filtered motion is not the filtered law: where a flank meets or parts, a
    drive's own equation shows a spike that is no torque. The sum at the table has none.

    zeros: angle -> where its encoder's zero stands against the table's
    """
    n = equation[-1]
    mesh = f"mesh_{n}"
    every = np.ones(len(held.t), dtype=bool)
    if equation == "total" or mesh not in core.connections:
        return every
    own_zero = {a: zero for a, zero in zeros.items() if a[-1] == n}
    if not own_zero or core.kind(mesh) != "gap":
        return every
    [(angle, zero)] = own_zero.items()
    ratio = core.get(f"{mesh}.ratio")
    geared = angle == f"theta_{n}" and f"gearbox_{n}" in core.connections
    own = (held.samples[angle] - zero) / (core.get(f"gearbox_{n}.ratio") if geared else 1.0)
    twist, gap = own - ratio * held.samples["theta_m"], core.get(f"{mesh}.gap")
    near = np.zeros(len(twist), dtype=bool)
    for share in _GAPS:
        side = np.sign(twist) * (np.abs(twist) > share * gap)
        changes = np.flatnonzero(np.diff(side) != 0)
        for c in changes:
            near[max(0, c - _REACH) : c + 2 + _REACH] = True
    return ~near


def _part(rate: str) -> str:
    suffix = rate.removeprefix("omega_")
    return f"pinion_{suffix[1:]}" if suffix.startswith("c") else f"motor_{suffix}"
