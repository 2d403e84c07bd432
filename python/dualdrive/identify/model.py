"""What the torque balance asks of a machine, and how the core answers it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.readings import before_sensors
from dualdrive.traces.names import DRIVES

Array = NDArray[np.float64]


#: channels of measured motor torque
TORQUES = tuple(f"T_{n}" for n in DRIVES)


@dataclass(frozen=True)
class Balance:
    """The equations of motion on recorded kinematics; shapes (equations, n[, parameters]).

    An equation is named after the body whose motion it governs (``m``, ``c1``, ``c2``), or
    ``total``: the sum at the table in which torques inside the train cancel, and with them
    stiffness and play of the meshes.

    ``residual`` is inertia times acceleration plus every torque of the model minus the measured
    motor torque; ``jacobian`` its derivative with respect to the parameters asked for;
    ``measured`` the measured part alone. Dry friction counts with the sign of the speed.
    """

    equations: tuple[str, ...]
    residual: Array
    jacobian: Array
    measured: Array

    def select(self, names: Sequence[str] | None) -> Balance:
        """The named equations; unless named, the total if there is one, else all.

        Raises:
            ValueError: an equation that the machine does not have.

        """
        if names is None:
            names = ("total",) if "total" in self.equations else self.equations
        for name in names:
            if name not in self.equations:
                raise ValueError(
                    f"equations: no equation {name!r}; there are {', '.join(self.equations)}"
                )
        rows = [self.equations.index(name) for name in names]
        return Balance(tuple(names), self.residual[rows], self.jacobian[rows], self.measured[rows])


@dataclass(frozen=True)
class Declared:
    """What is known of a parameter before any fit: SI value, unit, bounds, usual size."""

    path: str
    unit: str
    low: float
    high: float
    value: float
    typical: float = 1.0


@runtime_checkable
class BalanceModel(Protocol):
    """A machine that evaluates its equations of motion on recorded kinematics."""

    def parameters(self) -> Sequence[Declared]:
        """Every parameter, with its present value."""

    def declared(self, path: str) -> Declared:
        """One parameter or tie group.

        Raises:
            ValueError: no such path.

        """

    def with_values(self, values: Mapping[str, float]) -> BalanceModel:
        """A copy with other values."""

    def balance(self, samples: Mapping[str, Array], parameters: Sequence[str]) -> Balance:
        """The equations on these samples, all of one length."""


class CoreModel:
    """A machine of the core (or anything holding one as ``core``) as a balance model."""

    def __init__(self, machine: Any) -> None:
        self.machine = machine

    @property
    def _core(self) -> Any:
        return getattr(self.machine, "core", self.machine)

    def parameters(self) -> list[Declared]:
        """Every parameter, with its present value, in the units of the machine's axis."""
        return [_declared(p, self._unit(p.path, p.unit)) for p in self._core.parameters()]

    def torque_unit(self, equation: str) -> str:
        """What an equation closes in: N*m, or N where its body slides."""
        return self._unit("T_load" if equation in ("total", "m") else "T_1", "N*m")

    def _unit(self, name: str, unit: str) -> str:
        return str(self.machine.unit_of(name, unit)) if hasattr(self.machine, "unit_of") else unit

    def declared(self, path: str) -> Declared:
        """One parameter or tie group; the core names near paths where there is none."""
        for known in self.parameters():
            if known.path == path:
                return known
        value = self._core.get(path)
        last = path.rpartition(".")[2]
        member = next(p for p in self.parameters() if p.path.rpartition(".")[2] == last)
        return Declared(path, member.unit, member.low, member.high, value, member.typical)

    def with_values(self, values: Mapping[str, float]) -> CoreModel:
        """A copy with other values."""
        copy = self.machine.copy()
        core = getattr(copy, "core", copy)
        for path, value in values.items():
            core.set(path, value)
        for known in core.parameters():
            if known.path.endswith(".J") and known.value == 0.0 and known.path in values:
                core.set(known.path, 1e-9 * known.typical)  # nothing that moves is without inertia
        return CoreModel(copy)

    def balance(self, samples: Mapping[str, Array], parameters: Sequence[str]) -> Balance:
        """The equations on these samples, from the same effect hooks as a simulation."""
        from dualdrive import _core

        channels = {
            name: np.ascontiguousarray(x) for name, x in before_sensors(self._core, samples).items()
        }
        idle = {name: 0.0 * x if name in TORQUES else x for name, x in channels.items()}
        found = _core.torque_balance(self._core, channels, list(parameters))
        # the measured part is what the balance loses with the motors' torque
        without = _core.torque_balance(self._core, idle)
        return Balance(
            tuple(found["equations"]),
            found["residual"],
            found["jacobian"],
            without["residual"] - found["residual"],
        )


def as_model(machine: Any) -> BalanceModel:
    """The machine itself if it is a balance model, else the core's answer for it."""
    return machine if isinstance(machine, BalanceModel) else CoreModel(machine)


def _declared(parameter: Any, unit: str) -> Declared:
    low = parameter.low + (1e-9 * parameter.typical if parameter.low_excluded else 0.0)
    return Declared(parameter.path, unit, low, parameter.high, parameter.value, parameter.typical)
