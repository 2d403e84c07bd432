"""The entries [[effects]] of a machine file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from dualdrive import _core
from dualdrive.units import UnitError, parse

from .layers import Layer, MachineError, expect
from .numbers import set_value
from .trains import Structure

__all__ = ["add_effect", "add_effects"]

_NUMBER: Final = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


def add_effects(core: _core.Machine, s: Structure, layer: Layer) -> None:
    """Add a layer's effects; one that a lower layer has at the same place is changed instead.

    Raises MachineError naming file, entry, key, value and rule.
    """
    entries = layer.data.get("effects", [])
    if not isinstance(entries, list) or not all(isinstance(e, Mapping) for e in entries):
        raise MachineError(f"{layer.where}: effects: write each one under its own [[effects]]")
    inherited = {effect["label"] for effect in core.effects}
    for row, entry in enumerate(entries, 1):
        where = f"{layer.where}: effects {row}"
        label = f"{entry.get('effect')}@{entry.get('place')}"
        if label in inherited and entry["effect"] != "expression":
            _set_values(core, s, label, entry, where)
        else:
            add_effect(core, s, entry, where)


def add_effect(core: _core.Machine, s: Structure, entry: Mapping[str, Any], where: str) -> str:
    """Add one effect, as a machine file states it; returns its label.

    entry:  effect, place and its parameters; for an expression formula and parameters
            {name = number or {value, unit}}

    Raises MachineError naming file, key, value and rule; nothing is added then.
    """
    for key in ("effect", "place"):
        if key not in entry:
            raise MachineError(f"{where}: {key} is missing; give effect and place")
        expect(entry[key], str, where, key, "text")
    before = {p.path: p.value for p in core.parameters()}
    try:
        if entry["effect"] == "expression":
            parameters = _formula_parameters(entry, where)
            formula = expect(entry.get("formula"), str, where, "formula", "text, e.g. 'c*omega_m'")
            _check_units(core, s, formula, parameters)
            label = core.add_expression(entry["place"], formula, parameters)
        else:
            label = core.add_effect(entry["effect"], entry["place"])
    except MachineError:
        raise
    except ValueError as error:
        raise MachineError(f"{where}: {error}") from None
    try:
        _set_values(core, s, label, entry, where)
        core.signals()  # compiles the machine, formulas included
    except ValueError as error:
        core.remove_effect(label)
        _restore(core, before)
        raise (
            error if isinstance(error, MachineError) else MachineError(f"{where}: {error}")
        ) from None
    return label


def _restore(core: _core.Machine, before: Mapping[str, float]) -> None:
    """Taking a structural effect out switches its part off; here it never was in."""
    for p in core.parameters():
        if p.value != before[p.path]:
            core.set(p.path, before[p.path])


def _set_values(
    core: _core.Machine, s: Structure, label: str, entry: Mapping[str, Any], where: str
) -> None:
    own = {"effect", "place"}
    if entry["effect"] == "expression":
        own |= {"formula", "parameters"}
    for key, value in entry.items():
        if key not in own:
            set_value(core, s, f"{label}.{key}", value, where)


def _stated(value: Any) -> dict[str, Any]:
    """A parameter of a formula has the unit that it is given in: ``"3 N*m*s/rad"``."""
    match = _NUMBER.match(value) if isinstance(value, str) else None
    if match is None:
        return {"value": value}
    return {"value": match[0], "unit": value[match.end() :].strip()}


def _check_units(
    core: _core.Machine, s: Structure, formula: str, parameters: list[tuple[str, str, float]]
) -> None:
    """Refuse a formula that is no torque, where every unit is known.

    A bare number has no unit to check by, nor has a recorded column; a linear axis counts its table
    side in other units than the core declares.
    """
    known = {"t": "s", "angle": "rad", "speed": "rad/s"}
    known |= {name: unit for name, unit, _ in core.signals()}
    known |= {name: unit for name, unit, _ in parameters}
    bare = {name for name, unit, _ in parameters if not unit}
    names = set(_core.formula_names(formula))
    if s.axis != "rotary" or names & bare or not names <= known.keys():
        return
    found = _core.formula_unit(formula, {name: known[name] for name in names})
    if found != "N*m":
        raise ValueError(f"formula = {formula!r} gives {found}, not a torque in N*m")


def _formula_parameters(entry: Mapping[str, Any], where: str) -> list[tuple[str, str, float]]:
    table = expect(entry.get("parameters", {}), Mapping, where, "parameters", "a table")
    found = []
    for name, value in table.items():
        item = value if isinstance(value, Mapping) else _stated(value)
        for key in item:
            if key not in ("value", "unit"):
                raise MachineError(f"{where}: parameters.{name}.{key}: unknown; give value, unit")
        if "value" not in item:
            raise MachineError(f"{where}: parameters.{name}: value is missing; give value, unit")
        unit = expect(item.get("unit", ""), str, where, f"parameters.{name}.unit", "text")
        try:
            found.append((name, unit, parse(item["value"], unit, key=f"parameters.{name}")))
        except UnitError as error:
            raise MachineError(f"{where}: {error}") from None
    return found
