"""Which one parameter could make two drives answer differently.

The slave is taken as a copy of the master; then one number of it at a time is moved until the
responses computed come nearest to those seen, computed or measured. What a number explains is the
share of the squared difference, in logarithm of magnitude and in phase, that it removes. Numbers
that do alike can't be told apart by these responses, and all are named.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive.linear import DriveComparison, compare_drives
from dualdrive.linear.contacts import closed
from dualdrive.machine import Machine

__all__ = ["Cause", "causes"]

_WIDEST = 5.0  # factor either way
_NOTHING = 1e-2  # of the misfit
_POINTS = 40
_OWN = re.compile(r"(motor|pinion|gearbox|mesh)_2\.(J|b|K_d|stiffness|ratio)$|@\w+_2\.")


@dataclass(frozen=True)
class Cause:
    """A number of the slave, by how much it would have to differ, what that explains (0 to 1)."""

    path: str
    factor: float
    explains: float

    @property
    def text(self) -> str:
        """``mesh_2.stiffness at 70 % of mesh_1.stiffness explains 100 %``."""
        if math.isnan(self.factor):
            return (
                f"{self.path}, which the master has not got, explains {100 * self.explains:.0f} %"
            )
        other = self.path.replace("_2", "_1", 1)
        return (
            f"{self.path} at {100 * self.factor:.3g} % of {other} explains "
            f"{100 * self.explains:.0f} %"
        )


def causes(machine: Machine, seen: DriveComparison) -> list[Cause]:
    """Numbers of the slave that could explain what was seen, the best first."""
    f = seen.master.frequency_hz[seen.counts]
    grid = np.geomspace(f[0], f[-1], _POINTS)[1:-1]  # ends are rounded outward by geomspace
    wanted = np.concatenate([np.log(r.at(grid)) for r in (seen.master, seen.slave)])
    alike = _like_master(machine)

    def misfit(trial: Machine) -> float:
        found = compare_drives(trial, grid, modes=closed(trial))
        got = np.concatenate([np.log(r.response) for r in (found.master, found.slave)])
        return float(np.sum(np.abs(_wrapped(got - wanted)) ** 2))

    nothing = misfit(alike)
    found = []
    for path in _numbers(alike):
        factor, left = _fitted(alike, path, misfit, nothing)
        found.append(Cause(path, factor, 1.0 - left / nothing))
    for label in _own_effects(machine):
        trial = machine.copy()
        for other in _own_effects(machine):
            if other != label:
                trial.remove(other)
        _copy_numbers(trial)
        found.append(Cause(label, math.nan, 1.0 - misfit(trial) / nothing))
    return sorted(found, key=lambda cause: -cause.explains)


def _wrapped(difference: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Phases of a difference of logarithms within half a turn."""
    turned = (difference.imag + np.pi) % (2 * np.pi) - np.pi
    return np.asarray(difference.real + 1j * turned, np.complex128)


def _fitted(
    alike: Machine, path: str, misfit: Callable[[Machine], float], nothing: float
) -> tuple[float, float]:
    """The factor on one number that comes nearest, and what is left then.

    A number that does next to nothing at both ends of the range is not looked at further.
    """
    from scipy.optimize import minimize_scalar

    own = alike.get(path)

    def at(logarithm: float) -> float:
        trial = alike.copy()
        trial.core.set(path, own * math.exp(logarithm))
        return misfit(trial)

    best, widest = None, math.log(_WIDEST)
    if all(abs(at(end) - nothing) < _NOTHING * nothing for end in (-widest, widest)):
        return 1.0, nothing
    for low, high in ((-widest, 0.0), (0.0, widest)):
        tried = minimize_scalar(at, bounds=(low, high), method="bounded", options={"xatol": 1e-2})
        if best is None or tried.fun < best.fun:
            best = tried
    assert best is not None
    return math.exp(float(best.x)), float(best.fun)


def _like_master(machine: Machine) -> Machine:
    """The slave as a copy of the master, without effects of its own."""
    alike = machine.copy()
    for label in _own_effects(machine):
        alike.remove(label)
    _copy_numbers(alike)
    return alike


def _copy_numbers(machine: Machine) -> None:
    known = {p.path for p in machine.parameters()}
    for path in known:
        twin = path.replace("_2", "_1", 1)
        if re.search(r"_2\.", path) and twin in known:
            machine.core.set(path, machine.get(twin))


def _own_effects(machine: Machine) -> list[str]:
    """Effects that only the slave has."""
    labels = set(machine.effects)
    return [
        label
        for label in machine.effects
        if label.endswith("_2") and label.replace("_2", "_1") not in labels
    ]


def _numbers(machine: Machine) -> list[str]:
    """Numbers of the slave that a response could show: not zero, and read by a law."""
    return [
        p.path
        for p in machine.parameters()
        if _OWN.search(p.path)
        and p.value
        and math.isfinite(p.value)
        and not p.path.endswith("ratio")
        and not machine.core.unread(p.path)
    ]
