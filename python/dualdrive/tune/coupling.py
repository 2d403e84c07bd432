"""Step 7: tension and torque equaliser, until the torque curves are smooth."""

from __future__ import annotations

import math

import numpy as np

from dualdrive.linear.contacts import closed
from dualdrive.machine import Machine
from dualdrive.optimise import LeastTension, OptimiseError, corners, least_tension
from dualdrive.optimise.objective import TENSION
from dualdrive.tune.assess import assess, begin_of, play, quiet
from dualdrive.tune.edge import GAIN, damping, find_edge
from dualdrive.tune.hold import hold
from dualdrive.tune.job import Draft, Job
from dualdrive.tune.result import Curve, Panel
from dualdrive.units import human

__all__ = ["couple"]

_EQUALISER, _TIME = "controller.g_E", "controller.T_E"
_HALF = 0.5  # loop gain: the small-gain theorem's 1 with a margin of 6 dB
_KEPT = 0.9  # of the damping without it, which the equaliser's integral action must leave
_RESERVE = 1.1  # on the least tension
_GRID = 0.05  # of the highest tension: less is none
_LOWER, _TIMES = 0.8, 12


def couple(job: Job) -> Draft:
    """Step 7: equaliser from 0 upwards, its integral time, then the tension.

    P gain: the loop from torque difference to torque difference is g_E times a current loop, which
    is below 1 wherever g_E is: half of 1 (or of an edge below it) is stable whatever comes late in
    it, with 6 dB in hand. Integral time: the shortest that leaves 90 % of the least damping.
    Tension: a tenth above the least that keeps every flank closed over the test move; where none
    within the rated torque does, the one of the smoothest torque at which the table stands still;
    where there is none either, the rated torque. Then raised, or the position gain lowered, until
    the table stands still after steps and reversals at its load and near it; where nothing does
    that, the step says what forbids it.
    """
    machine = job.machine.copy()
    core = machine.core
    if core.controller_options["tension"] != "constant":
        kind = core.controller_options["tension"]
        reason = f"controller.tension = {kind}: must be constant to be tuned; set it so first"
        return Draft(machine, [], reason=reason)
    done = [_gain(job, machine), _integral_time(job, machine)]
    try:
        found = least_tension(machine, job.motion, cases=corners(machine, {}))
    except OptimiseError as error:
        return Draft(machine, done, reason=str(error))
    tension, why = _tension(machine, job, found)
    core.set(TENSION, tension)
    done += [why, _reached(machine, job)]
    done += _calm(machine, job)
    held = hold(machine, job.motion)
    machine, done = held.machine, [*done, *held.done]
    panels = (_margins(found), *_torques(job, machine))
    details = {
        "least_tension": found.tension,
        "quiet_tension": _quiet_from(machine, found),
        "restless": held.failure.figures() if held.failure else None,
    }
    return Draft(machine, done, panels, held.reason, details)


def _gain(job: Job, machine: Machine) -> str:
    edge = find_edge(machine, _EQUALISER, 1e-2, 10.0, job.state)
    gain = _HALF * min(1.0, edge.lowest or 1.0)
    machine.core.set(_EQUALISER, gain)
    met = f"edge at {edge.lowest:.3g}" if edge.lowest else "no edge below 10"
    return f"equaliser from 0 up ({met}): loop gain {gain:.3g}, half of what small gain allows"


def _integral_time(job: Job, machine: Machine) -> str:
    core, sides = machine.core, closed(machine)
    core.set(_TIME, 0.0)
    without = damping(machine, sides, job.state)
    scale = 1.0 / core.get(GAIN)
    times = np.geomspace(1.0, 1e2, 80) * scale
    for time in times:
        core.set(_TIME, float(time))
        if damping(machine, sides, job.state) >= _KEPT * without:
            return f"its integral time {human(float(time), 's')}: least damping {_KEPT:.0%} kept"
    core.set(_TIME, 0.0)
    return "its integral action off: any takes too much of the damping"


def _tension(machine: Machine, job: Job, found: LeastTension) -> tuple[float, str]:
    """The tension to set, and why."""
    most = machine.get("motor_1.T_rated")
    if found.tension is not None:
        tension = min(_RESERVE * found.tension, most)
        return tension, (
            f"tension {human(tension, 'N*m')}: flanks stay closed over the whole move from "
            f"{human(found.tension, 'N*m')} on"
        )
    smooth = _smoothest(machine, job, found)
    if smooth is None:
        return most, (
            f"tension {human(most, 'N*m')}, the rated torque: with this position gain the table "
            "hunts at every one"
        )
    return smooth, (
        f"tension {human(smooth, 'N*m')}: no tension up to the rated torque keeps the flanks "
        "closed while it accelerates; with this one it stands still, and no other one is smoother"
    )


def _smoothest(machine: Machine, job: Job, found: LeastTension) -> float | None:
    """The tension of least torque ripple among those at which the table stands still."""
    still, trial = _quiet_from(machine, found), machine.copy()
    ripples = {}
    for design in found.designs:
        tension = design.values[TENSION]
        if still is not None and tension >= max(still, _GRID * found.designs[-1].values[TENSION]):
            trial.core.set(TENSION, tension)
            ripples[tension] = assess(trial, job.motion).figures.get("torque ripple 1", math.inf)
    return min(ripples, key=lambda tension: ripples[tension]) if ripples else None


def _quiet_from(machine: Machine, found: LeastTension) -> float | None:
    """The least tension tried from which on the table never hunts."""
    limit = 0.02 * play(machine)
    least = None
    for design in reversed(found.designs):
        if design.hunting is None or design.hunting > limit:
            break
        least = design.values[TENSION]
    return least


def _reached(machine: Machine, job: Job) -> str:
    """The equaliser's limit must leave room for the tension to build up."""
    limit = "controller.Omega_E"
    for _ in range(_TIMES):
        run = assess(machine, job.motion).run
        if run is None:
            return "the tension's build-up can't be seen: the loop is unstable"
        k = int(np.searchsorted(run.t, begin_of(job.motion)))
        share = float(run["T_1"][k] - run["T_2"][k]) / machine.get(TENSION)
        if share >= 0.95 or not math.isfinite(machine.get(limit)):
            break
        machine.core.set(limit, 1.5 * machine.get(limit))
    return f"at the first command {share:.0%} of the tension is there"


def _calm(machine: Machine, job: Job) -> list[str]:
    """Lower the position gain while the table hunts in spite of the tension."""
    for lowered in range(_TIMES):
        if quiet(machine, assess(machine, job.motion)):
            gain = human(machine.get(GAIN), "1/s")
            return [f"it hunted still: position gain lowered to {gain}"] if lowered else []
        machine.core.set(GAIN, _LOWER * machine.get(GAIN))
    return []


def _margins(found: LeastTension) -> Panel:
    sound = [d for d in found.designs if d.margin is not None]
    x = np.array([d.values[TENSION] for d in sound])
    y = np.array([d.margin for d in sound], float)
    marks = () if found.tension is None else ((found.tension, "least"),)
    return Panel(
        "Least torque that holds a flank closed", "tension [N·m]", "torque at the motor [N·m]",
        (Curve("over the test move", x, y),), marks,
    )  # fmt: skip


def _torques(job: Job, machine: Machine) -> list[Panel]:
    """Figure 6 of the paper: torques of both motors before and after."""
    panels = []
    for title, one in (("Torques before this step", job.machine), ("Torques after it", machine)):
        run = assess(one, job.motion).run
        if run is not None:
            curves = tuple(
                Curve(name, run.t, run[signal])
                for name, signal in (("master", "T_1"), ("slave", "T_2"))
            )
            panels.append(Panel(title, "time [s]", "motor torque [N·m]", curves))
    return panels
