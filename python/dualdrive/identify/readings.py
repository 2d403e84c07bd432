"""Laws of sensors taken back: what stood at a sensor when a record holds what it read.

A torque balance rests on recorded motion. What a sensor does to a reading is in no torque, so the
core's balance leaves it out; here the reading is turned back into the motion (or torque) that the
sensor was held to, by the core's own laws of sensors, and the balance rests on that.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.identify.filtering import ANGLES

Array = NDArray[np.float64]
Samples = Mapping[str, Array]

_PAUSE = 1.5  # sampling intervals: a longer step in time starts a new stretch


def before_sensors(core: Any, samples: Samples) -> Samples:
    """The samples without what the machine's sensor effects did to them.

    Args:
        core: the core's machine; its effects of sensors whose type is ``invertible`` are taken
            back, at a body (table, motors) or at a recorded channel.
        samples: name -> shape (n,), SI, as :func:`dualdrive.identify.filtering.pieces` makes them:
            angles with their two derivatives, torques, and the time ``t``, which delays need.

    Returns:
        The same names; arrays that no sensor touched are the same arrays.

    Raises:
        ValueError: where a reading belongs to more than one angle.

    """
    found = dict(samples)
    for effect in core.effects:
        kind = _core.effect_type(effect["effect"])
        if not kind.invertible:
            continue
        label = effect["label"]
        late = _core.delay_of(core, label)
        for member in effect["members"]:
            read = channel_of(member)
            names = [n for n in (read, *ANGLES.get(read, ())) if n in found]
            if read in ANGLES and len(names) < 3:
                continue  # an angle that was not recorded was not misread
            if late > 0.0 and names:
                _earlier(found, names, late)
            if read in ANGLES and "sensor reading" in kind.acts_on:
                motion = _core.taken_back(core, label, *(found[name] for name in names))
                found.update(zip(names, motion, strict=True))
    return found


def channel_of(member: str) -> str:
    """What the sensor at a body reads, ``motor_1`` -> ``theta_1``; a current's is its torque."""
    stem, _, number = member.partition("_")
    if stem == "I":
        return f"T_{number}"
    return {"table": "theta_m", "motor": f"theta_{number}", "pinion": f"theta_c{number}"}.get(
        stem, member
    )


def _earlier(found: dict[str, Array], names: list[str], late: float) -> None:
    """Late by so many seconds: reading(t) = signal(t - late), so signal(t) = reading(t + late)."""
    from scipy.interpolate import CubicSpline

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
