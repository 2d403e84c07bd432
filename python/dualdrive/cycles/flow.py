"""The machine at standstill as a flow on its states: where it is after some time.

Every switch on the way is located by the core, so that the map over a period is as smooth as the
machine is, and its derivatives by the initial state are differences of runs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.cycles.errors import CycleError, NoCycleError
from dualdrive.linear.twin import late_paths
from dualdrive.machine import Machine

__all__ = ["SIGNALS", "Flow"]

Array = NDArray[np.float64]

#: what is kept of an orbit, as far as the machine has it
SIGNALS = ("theta_m", "omega_m", "e", "mesh_1.twist", "mesh_2.twist", "mesh_1.torque",
           "mesh_2.torque", "T_1", "T_2")  # fmt: skip

_DIFFERENCE = 1e-4  # of a state's size: errors of 1e-8 by curvature, of 1e-9 by rounding


class Flow:
    """A machine whose command stands still. States are arrays in the core's order.

    Raises CycleError for a machine without controller, or one whose state is more than numbers
    now: with delays or sampled loops.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.core = machine.core
        name = machine.name
        if self.core.controller_options["kind"] == "none":
            raise CycleError(
                f"{name}: has no controller, and nothing that would keep a cycle going"
            )
        late = late_paths(self.core)
        if late:
            raise CycleError(
                f"{name}: {late[0].reason}: shooting needs a machine without delays and sampled "
                "loops; set that time to 0"
            )
        self.states = [state for state, _ in self.core.states()]
        self.inputs = {"theta_ref": _core.constant(0.0)}

    def run(self, state: Array, span: float, *, points: int = 1) -> _core.Trajectory:
        """Simulate for `span` s with `points` output steps. Raises NoCycleError if that fails."""
        known = {name for name, _, _ in self.core.signals()}
        found = _core.simulate(
            self.core,
            self.inputs,
            end=span,
            output_step=span / points,
            initial=dict(zip(self.states, state.tolist(), strict=True)),
            signals=[name for name in SIGNALS if name in known],
            energy=False,
        )
        if found.status != "success":
            raise NoCycleError(f"{self.machine.name}: the simulation ended early: {found.message}")
        return found

    def after(self, state: Array, span: float) -> Array:
        """The state `span` s later."""
        return np.array(self.run(state, span).final_state)

    def rate(self, state: Array, span: float) -> Array:
        """How fast the state changes at the end of `span`, per s, by a central difference."""
        h = 1e-5 * span
        return (self.after(state, span + h) - self.after(state, span - h)) / (2 * h)

    def along(self, state: Array, span: float, count: int = 24) -> Array:
        """States at `count` even times, the first included, shape (count, states)."""
        found = [state]
        for _ in range(count - 1):
            found.append(self.after(found[-1], span / count))
        return np.array(found)

    def monodromy(
        self, state: Array, span: float, scale: Array, after: Array | None = None
    ) -> Array:
        """d(state after span) / d(state), shape (states, states), by central differences.

        With `after`, the state after span, by forward ones: half the runs, good enough to search.
        """
        columns = []
        for k, size in enumerate(scale * _DIFFERENCE):
            step = np.zeros(len(state))
            step[k] = size
            ahead = self.after(state + step, span)
            behind, width = (self.after(state - step, span), 2) if after is None else (after, 1)
            columns.append((ahead - behind) / (width * size))
        return np.column_stack(columns)
