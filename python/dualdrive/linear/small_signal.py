"""The whole machine around an operating point, with a way in at every set-point of its loops.

    dz/dt = A z + B u,    signals = C z + D u

All of it is the core's model. A loop is entered where it can be limited: a block at its limit
passes on the limit in place of its own law, so that the limit is an input at that place.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.linear.contacts import Modes, frozen
from dualdrive.linear.errors import LinearError
from dualdrive.linear.twin import continuous_twin, motor_numbers

__all__ = ["SmallSignal", "loops_of", "push", "small_signal", "state_matrix"]

Array = NDArray[np.float64]

_AT_ITS_LIMIT: Final = "high, unwinding"  # its integrator goes on by its own law


@dataclass(frozen=True, eq=False)
class SmallSignal:
    """A machine in frozen modes, all loops closed and free of delays; SI.

    inputs:  theta_ref, omega_ref, T_load; a torque on a body (torque@motor_1, ...); what is added
             at a set-point (Omega_1, equaliser, Omega_1*, T_1*, U_1, ...) or to what a sensor
             reads (sensed.table, ...)
    signals: every signal of a run, and ``equaliser``, the correction y of the speeds
    A, B, C, D: shapes (states, states), (states, inputs), (signals, states), (signals, inputs)
    modes:   of every switching element that isn't the core's default
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    signals: tuple[str, ...]
    units: Mapping[str, str]
    A: Array
    B: Array
    C: Array
    D: Array
    modes: Mapping[str, str]


def loops_of(core: _core.Machine) -> dict[str, str]:
    """Block of the control -> the signal that it puts out, outermost first.

    position -> Omega_1, equaliser -> equaliser, speed_1 -> T_1*, current_1 -> U_1; those of them
    that the machine has. With more than two drives every slave has an equaliser, and none is named.
    """
    elements = _core.possible_modes(continuous_twin(core))
    numbers = motor_numbers(core)
    all_blocks = {"position": "Omega_1"}
    all_blocks |= {"equaliser": "equaliser"} if len(core.motors) == 2 else {}
    all_blocks |= {f"speed_{n}": f"T_{n}*" for n in numbers}
    all_blocks |= {f"current_{n}": f"U_{n}" for n in numbers}
    return {b: output for b, output in all_blocks.items() if _element(b) in elements}


def _element(block: str) -> str:
    """The core's name of a block's limiter."""
    return f"controller.{'equaliser_2' if block == 'equaliser' else block}"


def small_signal(
    core: _core.Machine,
    modes: Modes = None,
    *,
    friction: str = "forward",
    state: Mapping[str, float] | None = None,
) -> SmallSignal:
    """Linearise the machine in given modes; see `frequency_response` for the arguments.

    Sampled loops are taken as continuous and delays as none. Raises LinearError for modes or
    states that the machine doesn't have.
    """
    with _named(core):
        return _linearised(core, modes, friction, state).result()


def state_matrix(
    core: _core.Machine,
    modes: Modes = None,
    *,
    friction: str = "forward",
    state: Mapping[str, float] | None = None,
) -> Array:
    """A of `small_signal` alone, whose inputs take forty times as long; shape (states, states)."""
    with _named(core):
        return np.array(_linearised(core, modes, friction, state).base.A)


def _linearised(
    core: _core.Machine, modes: Modes, friction: str, state: Mapping[str, float] | None
) -> _Linearised:
    twin = continuous_twin(core)
    return _Linearised(twin, frozen(twin, modes, friction), dict(state or {}))


@contextmanager
def _named(core: _core.Machine) -> Iterator[None]:
    """What the core refuses, with the machine's name before it."""
    try:
        yield
    except LinearError:
        raise
    except ValueError as error:
        raise LinearError(f"{core.name or 'machine'}: {error}") from None


def push(core: _core.Machine, body: str) -> str:
    """Put a free torque on a body, N m (N on a linear axis); returns the input that sets it."""
    probe = f"torque_on_{body}"
    core.add_expression(body, f"in.{probe}")
    return probe


class _Linearised:
    """The columns of B and D, each the difference of two affine laws."""

    def __init__(self, core: _core.Machine, modes: dict[str, str], state: dict[str, float]) -> None:
        self.core, self.modes, self.state = core, modes, state
        self.base = _core.linearise(core, modes=modes, state=state)
        self.signals = (*self.base.signals, *(["equaliser"] if self._slaves() else []))
        self.row = {name: k for k, name in enumerate(self.signals)}

    def result(self) -> SmallSignal:
        columns = self._columns()
        units = {name: unit for name, unit, _ in self.core.signals()}
        return SmallSignal(
            states=tuple(self.base.states),
            inputs=tuple(columns),
            signals=self.signals,
            units={
                **units,
                "equaliser": units.get("Omega_1", ""),
                **{f"torque@{body}": units["T_load"] for body in self.core.bodies},
            },
            A=np.array(self.base.A),
            B=np.column_stack([B for B, _ in columns.values()]),
            C=self._with_equaliser(np.array(self.base.C)),
            D=np.column_stack([D for _, D in columns.values()]),
            modes=self.modes,
        )

    def _slaves(self) -> bool:
        return self.core.controller_options["kind"] != "none" and len(self.core.motors) == 2

    def _with_equaliser(self, signals: Array) -> Array:
        """Add the row of y, by which the equaliser moves the set-points apart."""
        if not self._slaves():
            return signals
        row = {name: k for k, name in enumerate(self.base.signals)}
        if self.core.controller_options["equaliser"] == "slave":
            y = signals[row["Omega_2*"]] - signals[row["Omega_1"]]
        else:
            y = signals[row["Omega_1"]] - signals[row["Omega_1*"]]
        return np.concatenate([signals, y[None]])

    def _columns(self) -> dict[str, tuple[Array, Array]]:
        found = {
            "theta_ref": self._input(theta_ref=_core.constant(1.0)),
            "omega_ref": self._input(theta_ref=_core.ramp(1.0)),
            "T_load": self._input(T_load=_core.constant(1.0)),
        }
        found |= {f"torque@{body}": self._torque(body) for body in self.core.bodies}
        if self.core.controller_options["kind"] == "none":
            del found["theta_ref"], found["omega_ref"]
            return found | {
                name: self._input(**{name: _core.constant(1.0)}) for name in self._free()
            }
        for block, output in loops_of(self.core).items():
            found[output] = self._behind(block, output)
        for member in (*self.core.motors, "table"):
            found[f"sensed.{member}"] = self._reading(member)
        for number, motor in zip(motor_numbers(self.core), self.core.motors, strict=True):
            found[f"Omega_{number}*"] = self._set_point(number, found[f"sensed.{motor}"])
        return found

    def _free(self) -> list[str]:
        """Inputs of a machine without controller: a voltage, or the torque of a direct drive."""
        return [
            ("U_" if self.core.kind(motor) == "armature" else "T_") + number
            for number, motor in zip(motor_numbers(self.core), self.core.motors, strict=True)
        ]

    def _difference(
        self, more: _core.LinearSystem, less: _core.LinearSystem
    ) -> tuple[Array, Array]:
        return np.array(more.a - less.a), self._with_equaliser(self._own(more) - self._own(less))

    def _own(self, system: _core.LinearSystem) -> Array:
        """The offsets of the signals that the machine has by itself."""
        rows = [system.signals.index(name) for name in self.base.signals]
        return np.asarray(system.c)[rows]

    def _input(self, **inputs: _core.Waveform) -> tuple[Array, Array]:
        more = _core.linearise(self.core, inputs, modes=self.modes, state=self.state)
        return self._difference(more, self.base)

    def _torque(self, body: str) -> tuple[Array, Array]:
        """What a torque on a body does besides all others."""
        pushed = self.core.copy()
        probe = push(pushed, body)
        inputs = {probe: _core.constant(1.0)}
        more = _core.linearise(pushed, inputs, modes=self.modes, state=self.state)
        return self._difference(more, self.base)

    def _behind(self, block: str, output: str) -> tuple[Array, Array]:
        """What is added behind a block: how its limit acts while it stands there."""
        modes = {**self.modes, _element(block): _AT_ITS_LIMIT}
        kind, _, number = block.partition("_")
        limit = {
            "position": f"{self.core.motors[0]}.omega_max",
            "equaliser": "controller.Omega_E",
            "speed": f"motor_{number}.T_max",
            "current": f"motor_{number}.U_max",
        }[kind]
        low, high = self.core.copy(), self.core.copy()
        low.set(limit, 1.0)
        high.set(limit, 2.0)
        B, D = self._difference(
            *(_core.linearise(m, modes=modes, state=self.state) for m in (high, low))
        )
        own = D[self.row[output]]  # 1 but for omega_max, which is one of the motor
        return B / own, D / own

    def _reading(self, member: str) -> tuple[Array, Array]:
        """What is added to a sensor's reading."""
        shifted = self.core.copy()
        label = shifted.add_effect("sensor_offset", member)
        shifted.set(f"{label}.value", 1.0)
        more = _core.linearise(shifted, modes=self.modes, state=self.state)
        return self._difference(more, self.base)

    def _set_point(self, number: str, reading: tuple[Array, Array]) -> tuple[Array, Array]:
        """A drive's own speed set-point: less speed read is as much more speed asked for."""
        gearbox = f"gearbox_{number}"
        ratio = self.core.get(f"{gearbox}.ratio") if gearbox in self.core.connections else 1.0
        B, D = (-ratio * part for part in reading)
        D[self.row[f"sensed.motor_{number}"]] = 0.0
        D[self.row[f"Omega_{number}*"]] += 1.0
        return B, D
