"""Steps 6 and 8: what both axes must have alike; acceleration, jerk and feed-forward."""

from __future__ import annotations

import math

import numpy as np

from dualdrive.linear.contacts import closed
from dualdrive.linear.stability import least_damped
from dualdrive.machine import Machine
from dualdrive.motion import Motion, move
from dualdrive.tune.assess import assess
from dualdrive.tune.edge import GAIN, find_edge, gain_range
from dualdrive.tune.job import Draft, Job, decoupled
from dualdrive.tune.limits import MotionLimits
from dualdrive.tune.result import Assessment, Curve, Panel
from dualdrive.units import human

__all__ = ["adjust_motion", "alike"]

_WEIGHT = "controller.f_v"
_WEIGHTS = (0.0, 0.5, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0)
_TORQUE = 0.8  # of the largest torque, so that something is left against cutting forces
_SLOWER, _TIMES = 0.85, 20


def alike(job: Job) -> Draft:
    """Step 6: feed-forward, its time, DSC, SOFT, acceleration, jerk alike in both axes.

    In the machine the slave takes the master's set-point, so that they are one number each; what
    can part the drives is the slave's lag.
    """
    machine = job.machine.copy()
    lag = machine.get("controller.delta_t")
    done = [
        "feed-forward, acceleration and jerk: one number for both axes; type both in alike",
        _stiffness_control(job),
        _soft(job),
        "no lag of the slave"
        if lag == 0.0
        else f"the slave lags by {human(lag, 's')} (controller.delta_t): with feed-forward that is "
        "a difference of speed while it accelerates; set it to 0 if the control can",
    ]
    run = assess(machine, job.motion).run
    panels: tuple[Panel, ...] = ()
    if run is not None:
        speeds = tuple(
            Curve(name, run.t, run[signal])
            for name, signal in (("master", "omega_1"), ("slave", "omega_2"))
        )
        panels = (Panel("Speeds of both motors", "time [s]", "motor speed [rad/s]", speeds),)
    return Draft(machine, done, panels)


def _stiffness_control(job: Job) -> str:
    """DSC: the position loop in the drive, in the clock of the speed loop."""
    words = "DSC, dynamic stiffness control (MD32640): alike in both axes"
    slow, fast = (job.machine.get(f"controller.{loop}_sample") for loop in ("position", "speed"))
    if slow <= fast:
        return (
            f"{words}; the position loop is no slower than the speed loop here: it is as with DSC"
        )
    in_drive = decoupled(job.machine)
    in_drive.core.set("controller.position_sample", fast)
    in_drive.core.set("controller.position_latency", 0.0)
    edges = [
        find_edge(one, GAIN, *gain_range(one), job.state).lowest
        for one in (decoupled(job.machine), in_drive)
    ]
    now, then = ("none" if edge is None else human(edge, "1/s") for edge in edges)
    return (
        f"{words}; with the position loop every {human(slow, 's')} the edge of vibration is at "
        f"{now}, in the drive's {human(fast, 's')} it would be at {then}"
    )


def _soft(job: Job) -> str:
    """SOFT: acceleration that rises over time, the paper's axial impact limit."""
    words = "SOFT, acceleration with a limited jerk (the paper's axial impact limit)"
    if job.limits is None:
        return f"{words}: alike in both axes; the test motion has no jerk to compare"
    if not math.isfinite(job.limits.jerk):
        return f"{words}: the test move has none, as with BRISK; switch SOFT on in both axes"
    rise = human(job.limits.acceleration / job.limits.jerk, "s")
    return f"{words}: alike in both axes; on in the test move, {rise} to full acceleration"


def adjust_motion(job: Job) -> Draft:
    """Step 8: weight of the feed-forward, then jerk and acceleration.

    Feed-forward: the weight of least RMS following error on a move so long that it reaches its
    speed; on a short one the lag at speed would not count. Jerk: the acceleration rises over one
    period of the worst damped vibration or longer, which then ends where it began (the zero of a
    moving average: Biagiotti & Melchiorri 2008, section 7). Acceleration: as asked for, unless a
    motor needs more than 80 % of its largest torque.
    """
    machine = job.machine.copy()
    longer = _cruising(job.motion)
    tried = [(weight, _with(machine, weight, longer)) for weight in _WEIGHTS]
    sound = [(w, a.figures["following error, RMS"]) for w, a in tried if a.stable]
    if not sound:
        return Draft(machine, [], reason="the loop is unstable: nothing to adjust a motion by")
    weight = min(sound, key=lambda pair: pair[1])[0]
    machine.core.set(_WEIGHT, weight)
    done = [f"feed-forward weight {weight:g}: least RMS following error"]
    panels = [_weights(machine, sound, weight)]
    limits, slower = job.limits, None
    if limits is None:
        done.append(
            f"acceleration and jerk: the test motion ({job.motion.kind}) has none to adjust"
        )
    else:
        limits, said = _limits(machine, job, limits)
        slower = _with_limits(machine, job, limits)
        done += said
        if slower is not None:
            names = ("following error, largest", "torque ripple 1", "flank changes")
            gave = "; ".join(f"{name} {slower.spoken(name)}" for name in names)
            done.append(f"with these limits: {gave}")
    panels += _errors(job, machine, slower)
    return Draft(machine, done, tuple(panels), limits=limits)


def _cruising(motion: Motion) -> Motion:
    """The test move made three times as long as it takes to reach its speed."""
    if motion.kind != "move" or not math.isfinite(motion.arguments["j"]):
        return motion
    v, a, j = (motion.arguments[name] for name in "vaj")
    return move(
        3.0 * v * (v / a + a / j), v, a, j, motion.arguments["start"], motion.arguments["settle"]
    )


def _with(machine: Machine, weight: float, motion: Motion) -> Assessment:
    trial = machine.copy()
    trial.core.set(_WEIGHT, weight)
    return assess(trial, motion)


def _limits(machine: Machine, job: Job, limits: MotionLimits) -> tuple[MotionLimits, list[str]]:
    """Acceleration by torque, jerk by vibration."""
    highest = _TORQUE * min(machine.get(f"motor_{n}.T_max") for n in (1, 2))
    a, motion, done = limits.acceleration, job.motion, []
    peak = _peak(machine, motion)
    for _ in range(_TIMES):
        if peak <= highest or job.motion.kind != "move":
            break
        a *= _SLOWER
        motion = _slower(job.motion, a, min(limits.jerk, a * limits.jerk / limits.acceleration))
        peak = _peak(machine, motion)
    room = f"largest torque {human(peak, 'N*m')} of {human(highest, 'N*m')} allowed"
    angle = machine.unit_of("e", "rad")
    kept = "as asked for" if a == limits.acceleration else "lowered"
    done.append(f"acceleration {human(a, f'{angle}/s^2')} {kept}: {room}")
    hertz = _vibration(job, machine)
    jerk = min(limits.jerk, a * hertz) if hertz else limits.jerk
    done.append(
        f"jerk {human(jerk, f'{angle}/s^3')}: {human(a / jerk, 's')} to rise"
        + (f", one period of {hertz:.3g} Hz is {human(1 / hertz, 's')}" if hertz else "")
        if math.isfinite(jerk)
        else "jerk: no limit asked for, no vibration to limit it by"
    )
    return MotionLimits(a, jerk), done


def _with_limits(machine: Machine, job: Job, limits: MotionLimits) -> Assessment | None:
    """The test move with the limits found; None where they are those it has."""
    if job.motion.kind != "move" or limits == job.limits:
        return None
    return assess(machine, _slower(job.motion, limits.acceleration, limits.jerk))


def _slower(motion: Motion, a: float, j: float) -> Motion:
    given = {**{k: motion.arguments[k] for k in ("distance", "v", "start")}, "a": a, "j": j}
    return move(**given, settle=motion.end - motion.waveform.end())


def _peak(machine: Machine, motion: Motion) -> float:
    run = assess(machine, motion).run
    return math.inf if run is None else max(float(np.abs(run[f"T_{n}"]).max()) for n in (1, 2))


def _vibration(job: Job, machine: Machine) -> float | None:
    """Frequency of the worst damped vibration, Hz; None where nothing vibrates."""
    pole = least_damped(machine, closed(machine), job.state)
    return None if pole is None else abs(pole) / math.tau


def _weights(machine: Machine, sound: list[tuple[float, float]], weight: float) -> Panel:
    unit, size = _readable(machine)
    x, y = (np.array(column) for column in zip(*sound, strict=True))
    curve = Curve("test move", x, y / size)
    return Panel("RMS following error by feed-forward", "weight", f"error [{unit}]", (curve,),
                 ((weight, "chosen"),))  # fmt: skip


def _errors(job: Job, machine: Machine, slower: Assessment | None) -> list[Panel]:
    unit, size = _readable(machine)
    found = {
        "before this step": assess(job.machine, job.motion),
        "after it": assess(machine, job.motion),
        "with the limits found": slower,
    }
    curves = tuple(
        Curve(name, one.run.t, one.run["e"] / size)
        for name, one in found.items()
        if one is not None and one.run is not None
    )
    return [Panel("Following error on the test move", "time [s]", f"error [{unit}]", curves)]


def _readable(machine: Machine) -> tuple[str, float]:
    if machine.unit_of("e", "rad") == "rad":
        return "arcsec", math.pi / 648000.0
    return "µm", 1e-6
