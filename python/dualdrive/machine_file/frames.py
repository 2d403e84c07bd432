"""In whose angle a number is given: units of a linear axis, and play as drawings state it.

The core computes with one kind of axis. On a linear one the table's angle is its position in m and
its inertia a mass in kg; `ratio` of a mesh is then pinion angle per table travel, rad/m.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any, Final

from dualdrive.units import UnitError, parse

__all__ = ["half_gap_at_pinion", "linear_unit", "unit_on_axis"]

# A radius of 1 m: an angle becomes a length, a torque a force, an inertia a mass.
_LINEAR: Final = (
    (re.compile(r"\bkg\*m\^2(?!\d)"), "kg"),
    (re.compile(r"\bN\*m\b(?!\^)"), "N"),
    (re.compile(r"\brad\b"), "m"),
)
_TABLE_SIGNALS: Final = re.compile(
    r"(theta|omega|alpha)_(ref|m)|T_load|e|sensed\.table|.+@(table|ring)(#\d+)?(\..+)?|table\..+"
    r"|in\.(theta_ref|T_load)"
)
_AT_THE_PINION: Final = re.compile(
    r"(eccentricity|transmission_error)@.+\.amplitude|wear@.+\.depth"
)
# A number of a formula is what its author says it is: no declaration of the core is behind it.
_STATED: Final = re.compile(r"expression@[^.]+\..+")


def linear_unit(unit: str) -> str:
    """The unit that a rotary one becomes on the table side of a linear axis."""
    for rotary, linear in _LINEAR:
        unit = rotary.sub(linear, unit)
    return unit


def unit_on_axis(name: str, unit: str, *, axis: str, rigid: bool = False) -> str:
    """The unit of a parameter or signal on this kind of axis.

    rigid: the motor is joined to the table directly, so that its side is linear too.
    """
    if axis != "linear" or name.endswith(".phase"):
        return unit
    if _AT_THE_PINION.fullmatch(name) or _STATED.fullmatch(name):
        return unit
    if rigid:
        return linear_unit(unit)
    if re.fullmatch(r"mesh(es|_\d+)\.ratio", name):
        return "rad/m"
    return linear_unit(unit) if _TABLE_SIGNALS.fullmatch(name) else unit


def half_gap_at_pinion(
    entry: Mapping[str, Any], *, key: str, axis: str, ratio: Callable[[str], float]
) -> float:
    """Half the play at the pinion in rad, from play given in another frame or in full.

    entry:  value (a number or text with a unit), frame (pinion, table, motor or ring_mm: arc on
            the pitch circle, a plain number in mm), measure (half or full), and for ring_mm the
            pinion's pitch_radius
    ratio:  the ratio of "gearbox" or "mesh" beside this gap

    Raises UnitError naming key, value and rule.
    """
    known = {"value", "frame", "measure", "pitch_radius"}
    for name in entry:
        if name not in known:
            raise UnitError(f"{key}.{name}: unknown key; a gap takes {', '.join(sorted(known))}")
    if "value" not in entry:
        raise UnitError(
            f"{key}: value is missing; write {{ value = '22.7arcsec', frame = 'table' }}"
        )
    frame, measure = entry.get("frame", "pinion"), entry.get("measure", "half")
    if measure not in ("half", "full"):
        raise UnitError(f"{key}.measure = {measure!r}: unknown; choose half or full")
    if frame == "pinion":
        width = parse(entry["value"], "rad", key=key)
    elif frame == "table":
        width = parse(entry["value"], "m" if axis == "linear" else "rad", key=key) * ratio("mesh")
    elif frame == "motor":
        width = parse(entry["value"], "rad", key=key) / ratio("gearbox")
    elif frame == "ring_mm":
        width = _arc(entry["value"], key) / _pitch_radius(entry, key)
    else:
        rule = "unknown; choose pinion, table, motor or ring_mm"
        raise UnitError(f"{key}.frame = {frame!r}: {rule}")
    return width / 2 if measure == "full" else width


def _arc(value: Any, key: str) -> float:
    """An arc on the pitch circle in m; a number without a unit is in mm, as the frame says."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return parse(float(value) * 1e-3, "m", key=key)
    metres = parse(value, "m", key=key)
    bare = re.fullmatch(r"\s*[-+.\deE]+\s*", value) is not None
    return metres * 1e-3 if bare else metres


def _pitch_radius(entry: Mapping[str, Any], key: str) -> float:
    if "pitch_radius" not in entry:
        raise UnitError(
            f"{key}.pitch_radius: missing; an arc in mm needs the pinion's pitch radius"
        )
    radius = parse(entry["pitch_radius"], "m", key=f"{key}.pitch_radius")
    if not (radius > 0 and math.isfinite(radius)):
        raise UnitError(f"{key}.pitch_radius = {entry['pitch_radius']!r}: must be greater than 0")
    return radius
