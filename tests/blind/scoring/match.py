"""When an answer is right: effect, place, equation, parameter; and which places are one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

Json = Mapping[str, Any]
#: with rigid gearboxes motor and pinion turn as one body; the ring is the table's gear
_ONE = {"motor": "drive", "pinion": "drive", "gearbox": "drive", "ring": "table"}
_PLURAL = {"motors": "drives", "pinions": "drives", "gearboxes": "drives"}
#: effects whose place the machine itself can not tell: two meshes, one ring
_MESHED = frozenset({"eccentricity", "wear", "transmission_error", "time_varying_mesh_stiffness"})


def same_place(effect: str, one: str, other: str) -> bool:
    """Whether two places are the same body, or for a mesh effect the same wheel."""
    return _body(effect, one) == _body(effect, other)


def _body(effect: str, place: str) -> str:
    if place in _PLURAL:
        return _PLURAL[place]
    stem, _, number = place.partition("_")
    if stem == "mesh" and effect in _MESHED:
        stem = "drive"
    if place == "meshes" and effect in _MESHED:
        return "drives"
    if stem in _ONE and (number.isdigit() or not number):
        return _ONE[stem] + ("_" + number if number else "")
    return place


def members(candidate: Json) -> list[tuple[str, str]]:
    """(effect, place) of a candidate, one or more."""
    if "@" in str(candidate.get("label", "")):
        parts = [one.partition("@") for one in str(candidate["label"]).split(" + ")]
        return [(effect, place) for effect, _, place in parts]
    more = candidate.get("with", [])
    return [(c["effect"], c["place"]) for c in (candidate, *more)]


def truths(label: Json) -> list[tuple[str, str]]:
    """(effect, place) of what is hidden."""
    return [(e["effect"], e["place"]) for e in label["effects"]]


def holds(candidate: Json, truth: tuple[str, str], place: bool = False) -> bool:
    """Whether the candidate names that effect (and its place)."""
    return any(
        effect == truth[0] and (not place or same_place(effect, where, truth[1]))
        for effect, where in members(candidate)
    )


def exact(candidate: Json, label: Json, place: bool = False) -> bool:
    """Whether the candidate names all that is hidden and nothing else."""
    wanted = truths(label)
    return len(members(candidate)) == len(wanted) and all(
        holds(candidate, truth, place) for truth in wanted
    )


_EQUATIONS = {
    "drive": ("motor", "motors", "pinion", "pinions", "drive", "drives", "gearbox", "gearboxes"),
    "mesh": ("mesh", "meshes", "ring", "gearbox", "gearboxes"),
    "controller": ("controller", "slave", "tension", "equaliser"),
    "sensors": ("sensor", "sensors", "encoder", "encoders", "recorder"),
    "table": ("table", "total"),
}


def right_equation(named: str, label: Json) -> bool:
    """Whether the equation at fault is one of those that the hidden effects stand in."""
    wanted = "|".join(one["equation"] for one in label["effects"]).split("|")
    return any(named.split("_")[0] in _EQUATIONS[equation] for equation in wanted)


def covered(parameter: str, interval: Json, truth: float) -> bool:
    """Whether the true value lies in the interval; phases are angles."""
    low, high = float(interval["low"]), float(interval["high"])
    if parameter in ("phase", "centre", "spacing"):
        middle, half = (low + high) / 2, (high - low) / 2
        return abs(math.remainder(truth - middle, 2 * math.pi)) <= half
    return low <= truth <= high


_PATHS = {
    "mesh_damping": "mesh_damping@meshes.coefficient",
    "dry_table": "coulomb@table.torque",
    "dry_pinions": "coulomb@pinions.torque",
}


def real_numbers(label: Json, moved: Mapping[str, Any]) -> dict[str, float]:
    """True values of the numbers that were refitted, by their paths.

    A rigid drive shows the sum of motor and pinion. Where only one of them was free it has to
    take what the other's sheet lacks.
    """
    real, sheet = label["real"], label["sheet"]
    numbers = {_PATHS.get(name, name): float(value) for name, value in real.items()}
    ratio = float(label["machine"]["gearboxes.ratio"]) ** 2
    for key in ("J", "b"):
        motor, pinion = f"motors.{key}", f"pinions.{key}"
        if pinion not in moved and motor in numbers and pinion in numbers:
            numbers[motor] += (real[pinion] - sheet[pinion]) / ratio
        elif motor not in moved and motor in numbers and pinion in numbers:
            numbers[pinion] += (real[motor] - sheet[motor]) * ratio
    return {path: value for path, value in numbers.items() if path in moved}
