"""The entries [[history]] of a machine file: what was changed, when, and by which command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from .layers import Layer, MachineError, expect

__all__ = ["history_of"]

_KEYS: Final = ("date", "command", "change", "undo")


def history_of(layer: Layer) -> tuple[dict[str, str], ...]:
    """The history of a file, oldest first. Raises MachineError naming file, entry and rule."""
    entries = layer.data.get("history", [])
    if not isinstance(entries, list) or not all(isinstance(e, Mapping) for e in entries):
        raise MachineError(f"{layer.where}: history: write each entry under its own [[history]]")
    for row, entry in enumerate(entries, 1):
        where = f"{layer.where}: history {row}"
        for key, value in entry.items():
            if key not in _KEYS:
                raise MachineError(f"{where}: {key}: unknown key; use {', '.join(_KEYS)}")
            if key != "date":  # a date may be one of TOML's own
                expect(value, str, where, key, "text")
    return tuple({key: str(value) for key, value in entry.items()} for entry in entries)
