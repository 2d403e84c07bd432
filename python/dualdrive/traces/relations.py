"""What columns say of each other by their values, where their names say nothing.

A command and its reading run together, a speed is the rate of an angle, and a torque moves an
inertia against friction. All of it holds in any units.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .rates import rate_ratio

__all__ = ["Found", "related"]

Floats = NDArray[np.float64]
#: column -> its channel, and why
Found = dict[str, tuple[str, str]]

_TOGETHER: Final = 0.05  # of its spread, by which a reading may part from its command
_EXPLAINED: Final = 0.5  # share of a torque's power that inertia and friction must explain
_SAMPLES: Final = 200  # fewer say nothing
_MOST: Final = 24  # columns without a meaning; beyond it pairs are chance


def related(t: Floats | None, columns: Mapping[str, Floats]) -> tuple[Found, float | None]:
    """Channels of columns without telling names, with reasons, and the step of a missing clock.

    t: s, shape (n,), or None where there is no clock; then the step comes from an angle and its
       speed, both in SI, if there are any

    One machine with one drive is looked for: command, reading, torque.
    """
    moving = {n: v for n, v in columns.items() if np.isfinite(v).all() and np.ptp(v) > 0}
    count = len(next(iter(moving.values()), ()))
    if count < _SAMPLES or len(moving) > _MOST:
        return {}, None
    clock = np.arange(float(count)) if t is None else t
    rates = _rates(clock, moving)
    pairs = _together(moving)
    found: Found = {}
    speeds = set(rates.values())
    for command, reading in pairs:
        stem = "omega" if command in speeds or reading in speeds else "theta"
        if f"{stem}_ref" in {channel for channel, _ in found.values()}:
            continue
        found[command] = (f"{stem}_ref", f"runs with {reading}, and is the smoother of both")
        found[reading] = (f"{stem}_m", f"runs with {command}, and is the rougher of both")
    for angle, speed in rates.items():
        if not found.keys() & {angle, speed}:
            found[angle] = ("theta_m", f"its rate is {speed}")
            found[speed] = ("omega_m", f"the rate of {angle}")
            break
    table = {channel: name for name, (channel, _) in found.items()}
    if torque := _torque(clock, moving, table):
        found[torque[0]] = torque[1]
    return found, _step(clock, moving, table) if t is None else None


def _rates(t: Floats, columns: Mapping[str, Floats]) -> dict[str, str]:
    """Angle -> the column that is its rate, the surest first.

    Of a sine the rate of the speed looks like the angle again, so no column is both.
    """
    none = np.array([], dtype=np.int64)
    sure = {
        (angle, speed): abs(float(np.corrcoef(np.gradient(values, t), rate)[0, 1]))
        for angle, values in columns.items()
        for speed, rate in columns.items()
        if speed != angle and rate_ratio(t, values, rate, none) is not None
    }
    found: dict[str, str] = {}
    for angle, speed in sorted(sure, key=lambda pair: -sure[pair]):
        if angle not in found and angle not in found.values() and speed not in found:
            found[angle] = speed
    return found


def _together(columns: Mapping[str, Floats]) -> list[tuple[str, str]]:
    """Pairs (command, reading) that run together; the command is the smoother one."""
    names, found = list(columns), []
    for k, one in enumerate(names):
        for other in names[k + 1 :]:
            a, b = columns[one], columns[other]
            if np.std(a - b) < _TOGETHER * min(np.std(a), np.std(b)):
                rough = {name: float(np.std(np.diff(columns[name], 2))) for name in (one, other)}
                found.append((min(rough, key=rough.__getitem__), max(rough, key=rough.__getitem__)))
    return found


def _torque(
    t: Floats, columns: Mapping[str, Floats], table: Mapping[str, str]
) -> tuple[str, tuple[str, str]] | None:
    """The one column that an inertia with friction explains best."""
    name = next((table[c] for c in ("omega_ref", "omega_m") if c in table), None)
    angle = next((table[c] for c in ("theta_ref", "theta_m") if c in table), None)
    if name is None and angle is None:
        return None
    speed = columns[name] if name else np.gradient(columns[str(angle)], t)
    design = np.column_stack([np.gradient(speed, t), speed, np.sign(speed), np.ones_like(speed)])
    shares = {}
    for other in columns.keys() - set(table.values()):
        y = columns[other] - columns[other].mean()
        left = y - design @ np.linalg.lstsq(design, y, rcond=None)[0]
        shares[other] = 1.0 - float(np.dot(left, left) / np.dot(y, y))
    best = max(sorted(shares), key=lambda n: shares[n], default=None)
    if best is None or shares[best] < _EXPLAINED:
        return None
    why = f"an inertia with friction explains {shares[best]:.0%} of it: a torque, or what makes it"
    return best, ("T_1", why)


def _step(t: Floats, columns: Mapping[str, Floats], table: Mapping[str, str]) -> float | None:
    """Seconds per row under which the speed in rad/s is the rate of the angle in rad."""
    for end in ("ref", "m"):
        if f"theta_{end}" in table and f"omega_{end}" in table:
            angle, speed = columns[table[f"theta_{end}"]], columns[table[f"omega_{end}"]]
            ratio = rate_ratio(t, angle, speed, np.array([], dtype=np.int64))
            return None if ratio is None else float(f"{abs(ratio):.3g}")
    return None
