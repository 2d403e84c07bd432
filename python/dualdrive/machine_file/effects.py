"""The entries [[effects]] of a machine file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dualdrive import _core
from dualdrive.traces.names import CHANNELS

from .layers import Layer, MachineError, expect
from .numbers import set_value
from .trains import Structure
from .user_laws import OWN_KEYS, USER_LAWS, add_user_law

__all__ = ["add_effect", "add_effects"]


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
        if label in inherited and entry["effect"] not in USER_LAWS:
            _set_values(core, s, label, entry, where)
        else:
            add_effect(core, s, entry, where)


def add_effect(core: _core.Machine, s: Structure, entry: Mapping[str, Any], where: str) -> str:
    """Add one effect, as a machine file states it; returns its label.

    entry:  effect, place and its parameters; for an expression formula, parameters
            {name = number or {value, unit}} and columns {name = unit}; for a spline coordinate,
            low, high, and values or knots (each once, or once per coordinate)

    Raises MachineError naming file, key, value and rule; nothing is added then.
    """
    for key in ("effect", "place"):
        if key not in entry:
            raise MachineError(f"{where}: {key} is missing; give effect and place")
        expect(entry[key], str, where, key, "text")
    before = {p.path: p.value for p in core.parameters()}
    try:
        if entry["effect"] in USER_LAWS:
            label = add_user_law(core, s, entry, where)
        else:
            label = core.add_effect(entry["effect"], entry["place"])
    except MachineError:
        raise
    except ValueError as error:
        raise MachineError(f"{where}: {error}") from None
    try:
        _set_values(core, s, label, entry, where)
        _refuse_no_channel(core, entry["place"])
    except ValueError as error:
        core.remove_effect(label)
        _restore(core, before)
        raise (
            error if isinstance(error, MachineError) else MachineError(f"{where}: {error}")
        ) from None
    return label


def _refuse_no_channel(core: _core.Machine, place: str) -> None:
    """What a recorder's effect sits at is written down of this machine. Compiles it, too."""
    signals = {name for name, _, _ in core.signals()}
    if place in set(_core.recorded_channels(core)) - signals:
        there = ", ".join(name for name in CHANNELS if name in signals)
        raise ValueError(f"place = {place!r}: no channel of this machine; there are {there}")


def _restore(core: _core.Machine, before: Mapping[str, float]) -> None:
    """Taking a structural effect out switches its part off; here it never was in."""
    for p in core.parameters():
        if p.value != before[p.path]:
            core.set(p.path, before[p.path])


def _set_values(
    core: _core.Machine, s: Structure, label: str, entry: Mapping[str, Any], where: str
) -> None:
    own = {"effect", "place"} | OWN_KEYS.get(entry["effect"], set())
    for key, value in entry.items():
        if key not in own:
            set_value(core, s, f"{label}.{key}", value, where)
