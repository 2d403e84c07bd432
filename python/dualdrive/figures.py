"""The named figures that sum up a finished run: one number each, with unit and meaning.

Means over time follow the trapezoidal rule, so that uneven output times weigh what they should. A
figure that does not apply to a run (no standstill, say) is NaN; one that can never apply to a
machine (no controller, so no following error) is not declared for it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

from dualdrive import _core
from dualdrive.assembly import gaps

if TYPE_CHECKING:
    from dualdrive.machine import Machine
    from dualdrive.motion import Motion
    from dualdrive.run import Run

__all__ = [
    "STANDSTILL",
    "Figure",
    "Reduction",
    "declared",
    "figures",
    "is_controlled",
    "reductions",
    "signals",
]

#: s at the end of a run over which the standstill amplitude is taken
STANDSTILL: Final = 2.0


class Figure(NamedTuple):
    """What a figure is called, its SI unit ("" for a count or ratio), and what it says."""

    name: str
    unit: str
    long_name: str


class Reduction(NamedTuple):
    """A signal summed up by the core over output times from begin to end, s, both included.

    measure: min, max, range, peak, mean, rms or final
    """

    signal: str
    measure: str
    begin: float = -math.inf
    end: float = math.inf


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
    motors, meshes = machine.core.motors, gaps(machine.core)
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
    return list(dict.fromkeys(r.signal for r in reductions(machine, None, 0.0).values()))


def reductions(machine: Machine, motion: Motion | None, end: float) -> dict[str, Reduction]:
    """The figures that the core sums up from signals, by name; the others are counts."""
    found: dict[str, Reduction] = {}
    if is_controlled(machine):
        found["peak_error"] = Reduction("e", "peak")
        found["rms_error"] = Reduction("e", "rms")
        begin = _standstill_begin(motion, end)
        found["standstill_amplitude"] = Reduction("e", "range", begin)
    for motor in machine.core.motors:
        found[f"{motor}.torque_rms"] = Reduction(_torque(motor), "rms")
    return found


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
    for name, of in reductions(machine, run.motion, float(run.t[-1])).items():
        (found[name],) = _core.reduce(run.t, run[of.signal], [(of.measure, of.begin, of.end)])
    found["contact_events"] = 0.0
    for mesh in gaps(machine.core):
        switches = [(event.from_, event.to) for event in run.events if event.element == mesh]
        contacts, reversals = _core.count_flanks(switches)
        found["contact_events"] += contacts
        found[f"{mesh}.reversals"] = float(reversals)
    found["events"] = float(len(run.events))
    found["energy_error"] = float(run.statistics["energy_error"])
    found["steps"] = float(run.statistics["steps"])
    return {name: found[name] for name in names}


def _torque(motor: str) -> str:
    """The signal of a motor's torque: T_1 for motor_1."""
    return f"T_{motor.removeprefix('motor_')}"


def _standstill_begin(motion: Motion | None, end: float) -> float:
    """From when on the table is looked at: the last seconds, never the first half of the rest.

    A hunting table still moves there; one that comes to rest has settled by then. Infinite where
    the commanded angle never rests.
    """
    rest = float(motion.waveform.end()) if motion is not None else 0.0
    return max(end - STANDSTILL, (rest + end) / 2) if rest < end else math.inf
