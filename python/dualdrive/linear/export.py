"""State space for python-control, one contact mode at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dualdrive import _core
from dualdrive.assembly import core_of
from dualdrive.linear.closing import Closed
from dualdrive.linear.contacts import Modes
from dualdrive.linear.eq23 import Mode
from dualdrive.linear.errors import LinearError
from dualdrive.linear.frequency import outputs_of
from dualdrive.linear.realise import ORDER, realise
from dualdrive.linear.small_signal import small_signal
from dualdrive.linear.twin import late_paths
from dualdrive.machine import Machine

if TYPE_CHECKING:
    import control

__all__ = ["state_space"]


def state_space(
    machine: Machine | _core.Machine | Mode,
    modes: Modes = None,
    *,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    cut: Sequence[str] = (),
    delay_order: int = ORDER,
    friction: str = "forward",
    state: Mapping[str, float] | None = None,
) -> control.StateSpace:
    """A python-control StateSpace with named states, inputs and outputs; SI.

    Points in names become underscores: sensed_table.

    machine:  with its controller, or one Mode of Eq. 23 (then inputs are the voltages, outputs X)
    inputs:   as of `frequency_response`; default: all. theta_ref stands for the angle alone;
              omega_ref is its rate, which a feed-forward takes
    outputs:  signals; default: all
    cut, modes, friction, state: as of `frequency_response`
    delay_order: of the Padé approximants of delays

    Raises LinearError, also where python-control is not installed.
    """
    library = _control()
    if isinstance(machine, Mode):
        return _of_mode(library, machine, inputs, outputs)
    core = core_of(machine)
    system = small_signal(core, modes, friction=friction, state=state)
    whole = realise(Closed(system, late_paths(core), outputs_of(core, cut)), delay_order)
    columns = [_index(name, whole.inputs, "input") for name in inputs or whole.inputs]
    rows = [_index(name, whole.signals, "signal") for name in outputs or whole.signals]
    return library.ss(
        whole.A,
        whole.B[:, columns],
        whole.C[rows],
        whole.D[rows][:, columns],
        states=[_plain(name) for name in whole.states],
        inputs=[_plain(whole.inputs[k]) for k in columns],
        outputs=[_plain(whole.signals[k]) for k in rows],
    )


def _plain(name: str) -> str:
    """A name that python-control takes: sensed_table for sensed.table."""
    return name.replace(".", "_")


def _of_mode(library: Any, mode: Mode, inputs: Sequence[str], outputs: Sequence[str]) -> Any:
    columns = [_index(name, mode.inputs, "input") for name in inputs or mode.inputs]
    rows = [_index(name, mode.states, "state") for name in outputs or mode.states]
    return library.ss(
        mode.A,
        mode.B[:, columns],
        np.eye(len(mode.states))[rows],
        np.zeros((len(rows), len(columns))),
        states=list(mode.states),
        inputs=[mode.inputs[k] for k in columns],
        outputs=[mode.states[k] for k in rows],
    )


def _index(name: str, names: Sequence[str], what: str) -> int:
    if name not in names:
        raise LinearError(f"state_space: no {what} {name!r}; there are {', '.join(names)}")
    return names.index(name)


def _control() -> Any:
    try:
        import control as library
    except ImportError:
        raise LinearError(
            "python-control is not installed; pip install 'dualdrive[control]' brings it"
        ) from None
    return library
