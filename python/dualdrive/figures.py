"""The named figures that sum up a finished run: one number each, with unit and meaning.

Means over time follow the trapezoidal rule, so that uneven output times weigh what they should. A
figure that does not apply to a run (no standstill, say) is NaN; one that can never apply to a
machine (no controller, so no following error) is not declared for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dualdrive.machine import Machine
    from dualdrive.run import Event, Run

__all__ = ["STANDSTILL", "Figure", "declared", "figures", "is_controlled", "signals"]

#: s at the end of a run over which the standstill amplitude is taken
STANDSTILL: Final = 2.0

#: modes of a mesh in which a flank carries torque, and the side it does so on
_SIDE: Final = {"front": 1, "back": -1}


class Figure(NamedTuple):
    """What a figure is called, its SI unit ("" for a count or ratio), and what it says."""

    name: str
    unit: str
    long_name: str


def _plays(machine: Machine) -> list[str]:
    """Connections with play: those whose flanks can come and go."""
    core = machine.core
    return [name for name in core.connections if core.kind(name) == "gap"]


def is_controlled(machine: Machine) -> bool:
    """Whether there is a controller, and so a following error."""
    return bool(machine.core.controller_options["kind"] != "none")


def declared(machine: Machine) -> tuple[Figure, ...]:
    """Every figure a run of this machine has, in the order they are shown."""
    angle = machine.unit_of("e", "rad")
    errors = (
        Figure("peak_error", angle, "largest following error of the run, table frame"),
        Figure("rms_error", angle, "RMS following error over the run, table frame"),
        Figure(
            "standstill_amplitude", angle, "peak to peak of the following error at the end, at rest"
        ),
    )
    motors, meshes = machine.core.motors, _plays(machine)
    return (
        *(errors if is_controlled(machine) else ()),
        *(
            Figure(
                f"{motor}.torque_rms",
                machine.unit_of(_torque(motor), "N*m"),
                f"RMS torque of {motor} over the run, motor side",
            )
            for motor in motors
        ),
        *(
            Figure(f"{mesh}.reversals", "", f"how often {mesh} changed from one flank to the other")
            for mesh in meshes
        ),
        Figure("contact_events", "", "flanks that began or ceased to carry, all meshes"),
        Figure("events", "", "located switches of all kinds: flanks, friction, limits, formulas"),
        Figure("energy_error", "", "worst error of the energy balance over the energy that moved"),
        Figure("steps", "", "integration steps"),
    )


def signals(machine: Machine) -> list[str]:
    """The signals that `figures` reads: what a run must record at least."""
    torques = [_torque(motor) for motor in machine.core.motors]
    return [*(["e"] if is_controlled(machine) else []), *torques]


def figures(run: Run) -> dict[str, float]:
    """Return every declared figure of a run, in SI units.

    The run must hold the signals that `signals` names; raises KeyError otherwise. A run that failed
    has no figures: all are NaN, since part of a run is not comparable with a whole one.
    """
    machine = run.machine
    names = [figure.name for figure in declared(machine)]
    if not run.ok:
        return dict.fromkeys(names, math.nan)
    found: dict[str, float] = {}
    if is_controlled(machine):
        error = run["e"]
        found["peak_error"] = float(np.abs(error).max())
        found["rms_error"] = _rms(run.t, error)
        found["standstill_amplitude"] = _standstill_amplitude(run.t, error, _rest_begin(run))
    for motor in machine.core.motors:
        found[f"{motor}.torque_rms"] = _rms(run.t, run[_torque(motor)])
    switches: dict[str, list[Event]] = {mesh: [] for mesh in _plays(machine)}
    for event in run.events:
        if event.element in switches:
            switches[event.element].append(event)
    for mesh, events in switches.items():
        found[f"{mesh}.reversals"] = float(_reversals(events))
    found["contact_events"] = float(sum(map(_contacts, switches.values())))
    found["events"] = float(len(run.events))
    found["energy_error"] = float(run.statistics["energy_error"])
    found["steps"] = float(run.statistics["steps"])
    return {name: found[name] for name in names}


def _torque(motor: str) -> str:
    """The signal of a motor's torque: T_1 for motor_1."""
    return f"T_{motor.removeprefix('motor_')}"


def _rms(t: NDArray[np.float64], x: NDArray[np.float64]) -> float:
    square = x * x
    integral = 0.5 * float(np.dot(square[1:] + square[:-1], np.diff(t)))
    return math.sqrt(integral / float(t[-1] - t[0]))


def _rest_begin(run: Run) -> float:
    """The time from which the commanded angle rests; infinite if it never does."""
    return float(run.motion.waveform.end()) if run.motion is not None else 0.0


def _standstill_amplitude(
    t: NDArray[np.float64], error: NDArray[np.float64], rest_begin: float
) -> float:
    """Peak to peak at the end: the last seconds, and never the first half of the rest.

    A hunting table still moves there; one that comes to rest has settled by then.
    """
    end = float(t[-1])
    begin = max(end - STANDSTILL, (rest_begin + end) / 2)
    return float(np.ptp(error[t >= begin])) if rest_begin < end else math.nan


def _reversals(events: Iterable[Event]) -> int:
    """Changes from one carrying flank to the other, through the gap or (gap 0) at once."""
    count, side = 0, 0
    for event in events:
        for mode in (event.from_, event.to):
            now = _SIDE.get(mode, 0)
            count += now == -side != 0
            side = now or side
    return count


def _contacts(events: Iterable[Event]) -> int:
    return sum((event.from_ in _SIDE) != (event.to in _SIDE) for event in events)
