"""The way back from a change: what a machine's last step replaced, kept in its history.

Every entry of the history that a command writes carries a line ``undo``, JSON text with

    set      path -> value before, of each number that the step changed
    effects  the entries that stood before, where effects came or went
    text     the machine file before, where the step changed a choice (other parts, other numbers)
    name, title    where those changed
    after    fingerprint of the machine as the step left it

so that a step is taken back exactly, and only from the machine that it made.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dualdrive import _core

from .construction import build
from .effects import add_effect
from .layers import Layer, MachineError, parse_layer
from .text import _entry as effect_entry
from .text import compose
from .trains import Structure

__all__ = ["State", "fingerprint", "undone", "way_back"]


@dataclass(frozen=True, eq=False)
class State:
    """A machine at one moment; its core is a copy that nobody changes."""

    core: _core.Machine
    structure: Structure
    layers: Sequence[Layer]
    title: str


def fingerprint(state: State) -> str:
    """A short name of everything that decides how the machine behaves; wording and notes do not."""
    core = state.core
    # the default of a number of a user's law is what its file says, and moves with it
    own = {e["label"] for e in core.effects if e["formula"] or e["axes"]}
    numbers = {
        p.path: p.value.hex()
        for p in core.parameters()
        if not _same(p.value, p.standard) or p.path.rpartition(".")[0] in own
    }
    effects = [(e["label"], e["formula"] or e["axes"] or "") for e in core.effects]
    spoken = repr((core.name, state.title, sorted(numbers.items()), effects, state.structure))
    return hashlib.sha256(spoken.encode()).hexdigest()[:16]


def _same(one: float, other: float) -> bool:
    return one == other or (math.isnan(one) and math.isnan(other))


def way_back(before: State, after: State) -> str:
    """The line ``undo`` of a step from one state to another."""
    found: dict[str, Any] = {}
    if before.core.name != after.core.name:
        found["name"] = before.core.name
    if before.title != after.title:
        found["title"] = before.title
    if before.structure != after.structure:
        found["text"] = compose(
            before.layers, before.core, name=before.core.name, title=before.title, history=()
        )
    else:
        then = {p.path: p.value for p in before.core.parameters()}
        now = {p.path: p.value for p in after.core.parameters()}
        if before.core.effects != after.core.effects:
            found["effects"] = [effect_entry(before.core, e) for e in before.core.effects]
            now = {path: value for path, value in now.items() if "@" not in path}
        found["set"] = {
            path: value
            for path, value in then.items()
            if path not in now or not _same(now[path], value)
        }
    found["after"] = fingerprint(after)
    return json.dumps(found)


def undone(state: State, entry: Mapping[str, str]) -> State:
    """The machine as it was before the step that this entry of its history tells of.

    Raises MachineError in one line where the entry lacks the way back, or the machine is no longer
    what the step had made of it.
    """
    name, change = state.core.name, entry.get("change", "the last change")
    if "undo" not in entry:
        raise MachineError(
            f"{name}: history: {change!r} was written without what stood there before; "
            "take it back by hand"
        )
    try:
        told: dict[str, Any] = json.loads(entry["undo"])
        made = told["after"]
    except (ValueError, KeyError, TypeError):
        raise MachineError(
            f"{name}: history: undo of {change!r} can't be read; take the change back by hand"
        ) from None
    if made != fingerprint(state):
        raise MachineError(
            f"{name}: the machine was changed after {change!r} without a line in its history; "
            "undoing that step alone would not give what stood before it; take both back by hand"
        )
    title = str(told.get("title", state.title))
    if "text" in told:
        layers = [parse_layer(name, told["text"])]
        core, structure = build(layers)
        return State(core, structure, layers, title)
    core = state.core.copy()
    core.name = str(told.get("name", name))
    if "effects" in told:
        for effect in reversed(core.effects):
            core.remove_effect(effect["label"])
        for own in told["effects"]:
            add_effect(core, state.structure, own, f"{name}: history")
    for path, value in told["set"].items():
        core.set(path, value)
    return State(core, state.structure, state.layers, title)
