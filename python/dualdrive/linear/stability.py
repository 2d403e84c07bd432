"""Whether a loop is stable at all, before anything is said of how good it is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dualdrive import _core
from dualdrive.linear.contacts import closed
from dualdrive.linear.eigenvalues import moving
from dualdrive.linear.frequency import poles
from dualdrive.machine import Machine

__all__ = ["growth", "least_damped", "worst_pole"]

_REAL = 1e-6  # of a pole's size: an imaginary part below it is rounding


def worst_pole(
    machine: Machine | _core.Machine,
    sides: tuple[int, ...],
    state: Mapping[str, float] | None = None,
) -> complex:
    """The pole of largest real part in this contact, friction sliding, 1/s.

    state: the operating point of laws that aren't affine (`poles`); others 0

    Poles at zero, of what nothing holds, are left out.
    """
    found = moving(poles(machine, modes=sides, state=state))
    return complex(found[np.argmax(found.real)])


def least_damped(
    machine: Machine | _core.Machine,
    sides: tuple[int, ...],
    state: Mapping[str, float] | None = None,
) -> complex | None:
    """The pole of the vibration of least damping ratio in this contact, 1/s; None without any."""
    found = poles(machine, modes=sides, state=state)
    vibrating = found[found.imag > _REAL * np.abs(found)]
    if not vibrating.size:
        return None
    return complex(vibrating[np.argmax(vibrating.real / np.abs(vibrating))])


def growth(
    machine: Machine, values: Mapping[str, float], state: Mapping[str, float] | None = None
) -> float:
    """Largest real part of a pole with all flanks closed and friction sliding, 1/s.

    Below 0 small disturbances die out. values: path -> SI value, put into a copy of the machine;
    state: the operating point of laws that aren't affine
    """
    changed = machine.core.copy()
    for path, value in values.items():
        changed.set(path, value)
    return worst_pole(changed, closed(changed), state).real
