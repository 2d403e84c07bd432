"""The case that every engine runs: one closed loop with many impacts, and its exact solution.

Eleven states, mesh 1e8 N m/rad, 10 s of a sine, output every millisecond. The numbers are those of
`speed_study` in tests/py/reference_machine.py. Errors are measured against dualdrive's exact engine
in long double; `agreement` says how near the independent solution beside it, in double, comes
to it. The error of a run is that of the worst of the eight states of Eq. 23, each over its own
peak: reached, not asked for.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "py"))

import core_machines
import reference_model as reference
from dualdrive import _core

Array = NDArray[np.float64]

VARIANT = "H"
SPAN = 10.0  # s
AMPLITUDE, FREQUENCY = 0.02, 0.5  # rad, Hz
#: the eight states of Eq. 23 as the core names them
PLANT = ["omega_c1", "omega_c2", "theta_c1", "theta_c2", "I_1", "I_2", "theta_m", "omega_m"]


def machine() -> reference.Machine:
    return reference.speed_study(VARIANT)


def motion() -> reference.Motion:
    return reference.sine(AMPLITUDE, FREQUENCY)


@cache
def core() -> tuple[_core.Machine, dict[str, _core.Waveform]]:
    """The case for dualdrive."""
    return core_machines.core_machine(machine()), core_machines.core_inputs(motion())


def simulate(**options: Any) -> core_machines.Run:
    """The case in dualdrive; raises RuntimeError where it fails."""
    given: dict[str, Any] = {"end": SPAN, "signals": PLANT, "energy": False} | options
    raw = _core.simulate(*core(), **given)
    if raw.status != "success":
        raise RuntimeError(raw.message)
    return core_machines.Run(raw)


@cache
def truth() -> reference.Trajectory:
    """The independent solution, mode by mode, in double."""
    return reference.simulate(machine(), motion(), SPAN)


@cache
def finest() -> Array:
    """What errors are measured against: shape (times, 8), order of Eq. 23."""
    return simulate(engine="exact", long_double=True).X


def agreement() -> float:
    return error_of(truth().X)


@cache
def spread() -> float:
    """How far a shift of 1e-12 of the gap at the start carries: no two solvers can agree better."""
    shifted = reference.simulate(machine(), motion(), SPAN, perturbation=1e-12)
    return _apart(shifted.X, truth().X)


def error_of(X: Array) -> float:
    """The worst state's largest error over its own peak; X is shape (times, 8), order of Eq. 23."""
    return _apart(X, finest())


def _apart(X: Array, true: Array) -> float:
    return float((np.abs(X - true).max(axis=0) / np.abs(true).max(axis=0)).max())


def grid() -> Array:
    return np.asarray(truth().t)


def plain(value: Any) -> Any:
    """What JSON can say: no NaN, no infinity."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value
