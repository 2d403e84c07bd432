"""From the layers of a machine file to an assembled core machine."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dualdrive import _core

from .choices import structure_of
from .effects import add_effects
from .layers import Layer, MachineError
from .numbers import apply_numbers, check_complete
from .trains import Structure, assemble

__all__ = ["build"]


def build(layers: Sequence[Layer]) -> tuple[_core.Machine, Structure]:
    """Assemble the machine that the layers describe, base first.

    Raises MachineError naming file, key, value, rule and way out.
    """
    structure = structure_of(layers)
    where = layers[-1].where
    try:
        core = assemble(structure)
    except ValueError as error:
        raise MachineError(f"{where}: {error}") from None
    for layer in layers:
        apply_numbers(core, structure, layer)
    check_complete(core, layers)
    for layer in layers:
        add_effects(core, structure, layer)
    core.name = str(layers[-1].data.get("name", Path(where).stem))
    try:
        core.validate()
        core.signals()  # compiles the layout, which finds rigid loops and places that don't exist
    except ValueError as error:
        raise MachineError(f"{where}: {error}") from None
    return core, structure
