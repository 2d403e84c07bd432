"""Laws of sensors taken back: what stood at a sensor when a record holds what it read.

A torque balance rests on recorded motion. What a sensor does to a reading is in no torque, so the
core's balance leaves it out; here the reading is turned back into the motion (or torque) that the
sensor was held to, by the equations of the effects library, and the balance rests on that.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.filtering import ANGLES

Array = NDArray[np.float64]
Samples = Mapping[str, Array]

_PAUSE = 1.5  # sampling intervals: a longer step in time starts a new stretch
_ROUNDS = 20  # of the fixed point for an eccentric disc; each gains a factor of its amplitude


def before_sensors(core: Any, samples: Samples) -> Samples:
    """The samples without what the machine's sensor effects did to them.

    Args:
        core: the core's machine; its ``sensor_delay`` and ``encoder_eccentricity`` are taken back,
            at a body (table, motors) or at a recorded channel.
        samples: name -> shape (n,), SI, as :func:`dualdrive.identify.filtering.pieces` makes them:
            angles with their two derivatives, torques, and the time ``t``, which delays need.

    Returns:
        The same names; arrays that no sensor touched are the same arrays.

    """
    found = dict(samples)
    for effect in core.effects:
        take_back = TAKEN_BACK.get(effect["effect"])
        if take_back is None:
            continue
        values = {
            name: float(core.get(f"{effect['label']}.{name}")) for name in effect["parameters"]
        }
        for member in effect["members"]:
            read = channel_of(member)
            names = [n for n in (read, *ANGLES.get(read, ())) if n in found]
            if read in ANGLES and len(names) < 3:
                continue  # an angle that was not recorded was not misread
            take_back(found, names, values)
    return found


def channel_of(member: str) -> str:
    """What the sensor at a body reads, ``motor_1`` -> ``theta_1``; a current's is its torque."""
    stem, _, number = member.partition("_")
    if stem == "I":
        return f"T_{number}"
    return {"table": "theta_m", "motor": f"theta_{number}", "pinion": f"theta_c{number}"}.get(
        stem, member
    )


def _earlier(found: dict[str, Array], names: list[str], values: Mapping[str, float]) -> None:
    """``sensor_delay``: reading(t) = signal(t - time), so signal(t) = reading(t + time)."""
    from scipy.interpolate import CubicSpline

    late = values["time"]
    if late == 0.0 or not names:
        return
    t = found["t"]
    steps = np.diff(t)
    for part in np.split(np.arange(len(t)), np.flatnonzero(steps > _PAUSE * np.median(steps)) + 1):
        if len(part) < 2:
            continue
        then = np.minimum(t[part] + late, t[part[-1]])
        for name in names:
            moved = found[name].copy()
            moved[part] = CubicSpline(t[part], moved[part])(then)
            found[name] = moved


def _centred(found: dict[str, Array], names: list[str], values: Mapping[str, float]) -> None:
    """``encoder_eccentricity``: reading = angle + amplitude * cos(angle + phase)."""
    amplitude, phase = values["amplitude"], values["phase"]
    if amplitude >= 1.0:
        raise ValueError(
            f"encoder_eccentricity: amplitude = {amplitude:g} rad at {names[0]} must be below 1: "
            "the centre would lie off the track, and no reading could be taken back"
        )
    if amplitude == 0.0 or len(names) < 3:
        return
    angle_, rate_, acceleration_ = names
    reading = angle = found[angle_]
    for _ in range(_ROUNDS):
        angle = reading - amplitude * np.cos(angle + phase)
    slope = 1.0 - amplitude * np.sin(angle + phase)
    rate = found[rate_] / slope
    bend = amplitude * np.cos(angle + phase) * rate**2
    found[angle_], found[rate_] = angle, rate
    found[acceleration_] = (found[acceleration_] + bend) / slope


#: effects of sensors that can be taken back
TAKEN_BACK = {"sensor_delay": _earlier, "encoder_eccentricity": _centred}
