"""What many ask of the assembly behind a machine."""

from __future__ import annotations

from typing import Any

from dualdrive import _core

__all__ = ["core_of", "gaps"]


def core_of(machine: Any) -> _core.Machine:
    """The assembly behind a `Machine`; an assembly stands for itself."""
    core: _core.Machine = getattr(machine, "core", machine)
    return core


def gaps(core: _core.Machine) -> list[str]:
    """Connections with play, whose flanks can come and go, in the machine's order."""
    return [name for name in core.connections if core.kind(name) == "gap"]
