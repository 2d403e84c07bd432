"""Whether the loop is stable at all, before anything is said of how good it is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core, linear
from dualdrive.assembly import gaps
from dualdrive.linear.contacts import frozen
from dualdrive.linear.twin import late_paths
from dualdrive.machine import Machine

__all__ = ["closed", "growth", "poles", "worst_pole"]

_NEAR_ZERO = 1e-7  # of the fastest pole


def closed(machine: Machine) -> tuple[int, ...]:
    """Every flank closed: the contact in which a loop must be stable by itself."""
    return tuple(1 for _ in gaps(machine.core))


def poles(core: _core.Machine, sides: tuple[int, ...]) -> NDArray[np.complex128]:
    """Of the whole machine in this contact, friction sliding, 1/s; delays and sampling included.

    Where nothing is late the core's matrix is the whole machine, sixty times as fast.
    """
    if late_paths(core):
        return linear.poles(core, modes=sides)
    system = _core.linearise(core, modes=frozen(core, sides))
    return np.linalg.eigvals(np.array(system.A)).astype(np.complex128)


def worst_pole(core: _core.Machine, sides: tuple[int, ...]) -> complex:
    """The pole of largest real part; those at zero, of what nothing holds, are left out."""
    found = poles(core, sides)
    moving = found[np.abs(found) > _NEAR_ZERO * np.abs(found).max(initial=0.0)]
    return complex(moving[np.argmax(moving.real)])


def growth(machine: Machine, values: Mapping[str, float]) -> float:
    """Largest real part of a pole with all flanks closed and friction sliding, 1/s.

    Below 0 small disturbances die out. values: path -> SI value, put into a copy of the machine.
    """
    changed = machine.core.copy()
    for path, value in values.items():
        changed.set(path, value)
    return worst_pole(changed, closed(machine)).real
