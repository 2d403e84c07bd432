"""The unknowns of a fit: parameters with their priors, starting points and bounds.

A quantity that is positive by its declaration and has a nominal value moves on a logarithm, so that
it stays positive and a tolerance in per cent is a Gaussian. One that may be zero moves on its own
scale, from a usual size where it stands at zero: there its partners (an asymmetry, a phase) would
have no gradient.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: a number believed more firmly is held, and its square ends in rounding
_NARROWEST = 1e-6
#: relative one-sigma tolerance of a nominal value by the parameter's name, unless told: inertias
#: come from drawings, stiffness and play from catalogues, viscous friction from experience
TOLERANCES = {"J": 0.1, "stiffness": 0.2, "gap": 0.2, "b": 0.5, "damping": 0.5}
_OTHERWISE = 0.1
#: of an effect's parameter that has a value already; one at zero has no prior
_EFFECT = 1.0
#: numbers whose zero is another machine: one without a delay line, without flanks
_STRUCTURE = ("time", "delta_c", "delta_t", "gap")
_FURTHEST = 200.0  # e-fold of a logarithmic number


@dataclass(frozen=True)
class Unknown:
    """One number to fit: value = start, or nominal·exp(u), or scale·u, or scale/u.

    sigma: one-sigma width of the prior in u, infinite where there is none
    reciprocal: of a stiffness put in: compliances add, so that a fit can leave the rigid end
    strength: zero of it switches its effect off, and it is never negative
    """

    path: str
    unit: str
    nominal: float
    low: float
    high: float
    scale: float
    logarithmic: bool
    centre: float
    start: float
    sigma: float
    reciprocal: bool = False
    strength: bool = False

    def value(self, u: float) -> float:
        """The number in SI at u, inside its bounds whatever rounding does."""
        if self.reciprocal:
            plain = self.scale / u if u > 0.0 else math.inf
        else:
            plain = self.scale * (_power(u) if self.logarithmic else u)
        return min(max(plain, self.low), self.high)

    def slope(self, u: float) -> float:
        """Derivative of the value by u."""
        if self.reciprocal:
            return -self.scale / u**2
        return self.scale * _power(u) if self.logarithmic else self.scale

    def coordinate(self, value: float) -> float:
        """The u of a value, infinite at the open end of a logarithm or a reciprocal."""
        if self.reciprocal:
            return self.scale / value if value > 0.0 else math.inf
        if not self.logarithmic:
            return value / self.scale
        return (
            -math.inf
            if value <= 0
            else math.inf
            if math.isinf(value)
            else math.log(value / self.scale)
        )

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest u."""
        low, high = sorted((self.coordinate(self.low), self.coordinate(self.high)))
        return low, high


def _power(u: float) -> float:
    """exp(u), as far as a number that is open at zero stays above it and finite."""
    return math.exp(min(max(u, -_FURTHEST), _FURTHEST))


@dataclass(frozen=True)
class StateUnknown:
    """An initial state of one record, believed to be `centre` within `sigma`."""

    record: int
    state: str
    unit: str
    centre: float
    sigma: float


def default_free(core: Any) -> list[str]:
    """Nominal mechanical parameters as tie groups, and every parameter of every effect.

    Data sheets state inertias, stiffness and play with a tolerance; ratios are counted and settings
    are read from the drive, so those stay. What an effect lends (`gearbox_backlash@gearboxes.gap`)
    is the effect's, without a nominal value.
    """
    own = [f"{e['label']}.{name}" for e in core.effects for name in e["parameters"]]
    own = [path for path in own if not core.parameter(path).counted and not core.unread(path)]
    lent = {member for path in own for member in core.members(path)}
    found = []
    for parameter in core.parameters():
        place, _, name = parameter.path.rpartition(".")
        if "@" in place or name not in TOLERANCES or not parameter.value > 0.0:
            continue
        if parameter.path in lent:
            continue
        if place not in core.connections or core.kind(place) != "rigid":
            found.append(_tied(core, parameter.path))
    taken: set[str] = set()
    # two effects at one joint share its stiffness: it is free once, under the wider name
    for path in sorted(own, key=lambda path: -len(core.members(path))):
        if not taken & set(core.members(path)):
            found.append(path)
            taken |= set(core.members(path))
    return list(dict.fromkeys(found))


def seen_in_balance(core: Any, path: str) -> bool:
    """Whether the torques of the whole machine contain a number.

    Those of a sensor or a limit are in no balance; a joint's torque cancels in the total.
    """
    label = path.rpartition(".")[0]
    own = [effect for effect in core.effects if effect["label"] == label]
    return all(effect["in_balance"] and not effect["structural"] for effect in own)


def default_tolerances(core: Any, free: Sequence[str]) -> dict[str, float]:
    """Relative one-sigma tolerance of each path that has one: an effect at zero has none."""
    widths = {
        p: _width(p, p.rpartition(".")[2], None, "@" in p, core.get(p), core.members(p)[0] != p)
        for p in free
    }
    return {path: width for path, width in widths.items() if math.isfinite(width)}


def _tied(core: Any, path: str) -> str:
    """The group that a member belongs to where all its members agree, else the path itself."""
    place, _, name = path.rpartition(".")
    stem, _, number = place.rpartition("_")
    if not stem or not number.isdigit():
        return path
    group = f"{stem}es.{name}" if stem.endswith(("sh", "x")) else f"{stem}s.{name}"
    try:
        core.get(group)
        return group if len(core.members(group)) > 1 else path
    except ValueError:
        return path


def unknowns(
    core: Any,
    free: Sequence[str],
    tolerance: float | Mapping[str, float] | None,
    sizes: Mapping[str, float],
) -> list[Unknown]:
    """What is known of each free path.

    Args:
        core: the core's machine.
        free: parameter paths or tie groups.
        tolerance: relative one-sigma tolerance of the nominal values, for all or by path; infinite
            for none. Effects have none unless named.
        sizes: path -> usual size of an effect's number, where the declaration's is too general.

    Raises:
        ValueError: unknown path, one that is not for fitting, or one named twice.

    """
    taken: dict[str, str] = {}
    found = []
    for path in free:
        for member in core.members(path):
            if member in taken:
                raise ValueError(f"free: {path} and {taken[member]} both move {member}; keep one")
            taken[member] = path
        found.append(_unknown(core, path, tolerance, sizes))
    if isinstance(tolerance, Mapping) and (stray := set(tolerance) - set(free)):
        raise ValueError(f"tolerance: {', '.join(sorted(stray))} is not among the free parameters")
    return found


def _unknown(
    core: Any, path: str, tolerance: float | Mapping[str, float] | None, sizes: Mapping[str, float]
) -> Unknown:
    declared = core.parameter(core.members(path)[0])
    name = path.rpartition(".")[2]
    if name == "ratio" or name.endswith(("_sample", "_latency")):
        raise ValueError(f"free: {path} is counted or set, not fitted; sweep it instead")
    try:
        nominal = float(core.get(path))
    except ValueError as error:
        raise ValueError(f"free: {error}") from None
    if math.isinf(nominal) and path in sizes:
        nominal = sizes[path]  # a limit that is off begins where the record would meet it
    if not math.isfinite(nominal):
        raise ValueError(
            f"free: {path} is {nominal:g}, a limit that is off; set it before fitting it"
        )
    effect = "@" in path
    lent = effect and declared.path != path  # a structural effect's: the part's own number
    width = _width(path, name, tolerance, effect, nominal, lent)
    low = declared.low
    if effect and name in _STRUCTURE:
        low = 1e-6
    usual = declared.typical
    if effect:
        usual = sizes.get(path, usual)
    # a limit is met from one torque on: it moves on the scale of torques
    on_logarithm = not effect or name == "stiffness" or (declared.low_excluded and not lent)
    if nominal > 0 and declared.low >= 0 and on_logarithm:
        numbers = (nominal, low, declared.high, nominal, True, 0.0, 0.0, width)
        return Unknown(path, declared.unit, *numbers)
    scale = abs(nominal) or usual or 1.0
    if declared.low_excluded:
        low += 1e-6 * scale
    strength = _strength(declared, name)
    begin = usual if nominal == 0.0 and strength else nominal
    begin = min(max(begin, low), declared.high) / scale
    numbers = (nominal, low, declared.high, scale, False, nominal / scale, begin, width)
    return Unknown(path, declared.unit, *numbers, strength=strength)


def _width(
    path: str,
    name: str,
    tolerance: float | Mapping[str, float] | None,
    effect: bool,
    nominal: float,
    lent: bool = False,
) -> float:
    """One-sigma width of the prior, relative."""
    given = tolerance.get(path) if isinstance(tolerance, Mapping) else tolerance
    if isinstance(tolerance, Mapping) or not effect:
        width = TOLERANCES.get(name, _OTHERWISE) if given is None else given
    if effect and (given is None or not isinstance(tolerance, Mapping)):
        # a limit, or a stiffness that is nearly rigid, is where one begins, not what one believes
        width = _EFFECT if nominal != 0.0 and not lent else math.inf
    if not width >= _NARROWEST:
        rule = f"must be positive, {_NARROWEST:g} at least"
        raise ValueError(f"tolerance of {path}: {width:g} {rule}; or leave the path out")
    return width


def _strength(declared: Any, name: str) -> bool:
    """Whether zero of it switches the effect off: never negative and zero by default."""
    return bool(declared.low >= 0.0 and declared.standard == 0.0 and name != "phase")


def values_at(list_of: Sequence[Unknown], u: Array) -> dict[str, float]:
    """Path -> SI value."""
    return {x.path: x.value(float(v)) for x, v in zip(list_of, u, strict=True)}
