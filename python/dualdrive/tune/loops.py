"""Steps 2, 4 and 5: current and speed loop, the edge of vibration, the position gain set back."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dualdrive.linear import frequency_response
from dualdrive.linear.contacts import closed
from dualdrive.linear.stability import least_damped
from dualdrive.machine import Machine
from dualdrive.tune.edge import CLOSED, GAIN, Edge, damping, find_edge, gain_range, measured_edge
from dualdrive.tune.filters import from_response, propose
from dualdrive.tune.job import Draft, Job, decoupled
from dualdrive.tune.result import Curve, Panel
from dualdrive.units import human

__all__ = ["inner_loops", "position_gain", "set_back"]

Array = NDArray[np.float64]

_BANDWIDTH, _SPEED, _INTEGRAL = "controller.omega_ci", "controller.k_p", "controller.T_N"
_USUAL_SAMPLE = 125e-6  # s, of a drive's speed loop, where the model states none
_KEPT = 0.9  # of the damping without it, which an integral action must leave
_DAMPED = 0.3  # least damping ratio of a vibration with the position loop closed
_PAPER_GAIN = 10.0  # K_s of the paper's step (5)
_MARGIN = 2.0  # gain margin, 6 dB: half the edge (Ziegler & Nichols 1942)


# --- step 2 ---------------------------------------------------------------------------------------


def inner_loops(job: Job) -> Draft:
    """Step 2: the same numbers for both drives, by rules.

    Current loop: as fast as its lateness T, 1/(2 T), and the voltage allow: a step to rated current
    at the largest speed must find its voltage, omega_ci L I + R I + C_e omega <= U_max.
    Speed loop: the highest P gain that leaves 90 % of the best damping, all flanks closed, integral
    action and position loop off, and not above the modulus optimum of the drive by itself, J/(2 T),
    T the sum of small lags; then the shortest integral time that leaves 90 % of what is left.
    Set-point filter: where a vibration above the speed loop's rate stops the gain short of that
    ceiling, or a measured response has a peak, and a filter lets it rise.
    """
    machine = decoupled(job.machine)
    done = [_current(machine)]
    for name in (GAIN, "controller.K_i", "controller.K_d"):  # position loop open
        machine.core.set(name, 0.0)
    ceiling = _modulus_optimum(machine)
    gains = np.geomspace(ceiling / 100.0, ceiling, 60)
    machine.core.set(_INTEGRAL, 0.0)
    damped = _damped_at(job, machine, gains)
    if damped.max() <= 0.0:
        reason = "a vibration grows at any speed gain, position loop open: look at the speed loop"
        return Draft(job.machine.copy(), done, reason=reason)
    tuned = job.machine.copy()
    filtered = _filter(job, machine, tuned, gains, damped)
    damped = _damped_at(job, machine, gains)
    gain = _highest(gains, damped)
    best = _damped(job, machine, _SPEED, gain)
    where = "its ceiling, J/(2 T)" if gain > 0.999 * ceiling else "the highest that damps well"
    times = np.geomspace(1e-1, 1e3, 100) / _slow(job, machine)
    left = np.array([_damped(job, machine, _INTEGRAL, time) for time in times])
    time = float(times[np.argmax(left >= _KEPT * best)]) if (left >= _KEPT * best).any() else 0.0
    for path, value in ((_SPEED, gain), (_INTEGRAL, time)):
        tuned.core.set(path, value)
    if _BANDWIDTH in {p.path for p in machine.parameters()}:
        tuned.core.set(_BANDWIDTH, machine.get(_BANDWIDTH))
    done += [
        f"speed gain {human(gain, 'N*m*s/rad')} at the pinion, {where}: damping ratio {best:.3f}",
        f"integral time {human(time, 's')}, the shortest that leaves {_KEPT:.0%} of that damping"
        if time
        else "integral action off: any takes too much of the damping",
        *filtered,
        *_unsampled(machine, job.machine.get(_SPEED), gain),
    ]
    panels = (
        _damping_by("speed gain, integral action off", "gain at the pinion [N·m·s/rad]",
                    gains, damped, gain),
        _damping_by("integral time", "integral time [s]", times, left, time),
    )  # fmt: skip
    return Draft(tuned, done, panels, details={"ceiling": ceiling, "damping": best})


def _damped_at(job: Job, machine: Machine, gains: Array) -> Array:
    return np.array([_damped(job, machine, _SPEED, gain) for gain in gains])


def _highest(gains: Array, damped: Array, best: float | None = None) -> float:
    """The highest gain that leaves 90 % of the best damping; 0 where none does."""
    enough = np.flatnonzero(damped >= _KEPT * (damped.max() if best is None else best))
    return float(gains[enough[-1]]) if enough.size else 0.0


def _filter(job: Job, machine: Machine, tuned: Machine, gains: Array, damped: Array) -> list[str]:
    """Put a set-point filter into both machines where one is asked for; what is said of it."""
    if job.measured is not None:
        found = [(n, from_response(r)) for n, r in zip("12", job.measured.pair, strict=True)]
        asked = [(n, one) for n, one in found if one is not None]
        if asked:
            number, (peak, notch, left) = max(asked, key=lambda pair: pair[1][0].db)
            for each in (machine, tuned):
                notch.on(each)
            after = (
                "no peak" if left is None else f"{left.db:+.1f} dB at {left.frequency_hz:.4g} Hz"
            )
            return [
                f"set-point filter: the measured response of drive {number} peaks by "
                f"{peak.db:+.1f} dB at {peak.frequency_hz:.4g} Hz: {notch.text} in both drives "
                f"leaves {after}"
            ]
        return ["set-point filter: no peak of the measured responses asks for one"]
    gain = _highest(gains, damped)
    hertz, rate = _limiting(job, machine, float(gains[-1])), gain / _inertia(machine) / math.tau
    if gain > 0.999 * gains[-1] or hertz <= rate:
        return [
            f"set-point filter: none; no vibration above the speed loop's own {rate:.3g} Hz stops "
            "its gain"
        ]
    best = float(damped.max())
    found_here = propose(
        machine, hertz, gain, lambda trial: _highest(gains, _damped_at(job, trial, gains), best)
    )
    if found_here is None:
        return [
            f"set-point filter: none; {hertz:.4g} Hz stops the gain, but no notch or low-pass lets "
            "it rise by a quarter"
        ]
    one, higher = found_here
    for each in (machine, tuned):
        one.on(each)
    return [
        f"set-point filter: {hertz:.4g} Hz stops the gain at {human(gain, 'N*m*s/rad')}; with "
        f"{one.text} in both drives it reaches {human(higher, 'N*m*s/rad')}, as well damped"
    ]


def _limiting(job: Job, machine: Machine, gain: float) -> float:
    """Frequency of the least damped vibration at a speed gain, Hz; 0 where nothing vibrates."""
    trial = machine.copy()
    trial.core.set(_SPEED, gain)
    pole = least_damped(trial, closed(trial), job.state)
    return 0.0 if pole is None else abs(pole) / math.tau


def _unsampled(machine: Machine, before: float, gain: float) -> list[str]:
    """Where nothing in the loops is late: that this is why the gain is so high, and what to do."""
    core = machine.core
    late = ("speed_sample", "speed_latency", "current_sample", "current_latency")
    if any(core.get(f"controller.{name}") for name in late):
        return []
    core.set("controller.speed_sample", _USUAL_SAMPLE)
    core.set("controller.speed_latency", _USUAL_SAMPLE)
    usual = _modulus_optimum(machine)
    sampled = human(_USUAL_SAMPLE, "s")
    return [
        f"the loops of this machine are continuous: no sampling bounds that gain, "
        f"{gain / before:.3g} times the one found. Sampled every {sampled} and as late again, its "
        f"ceiling J/(2 T) is {human(usual, 'N*m*s/rad')}: set controller.speed_sample and "
        "controller.speed_latency to those of the drive and tune again"
    ]


def _damping_by(what: str, x: str, values: Array, ratios: Array, chosen: float) -> Panel:
    return Panel(
        f"Damping by {what}", x, "least damping ratio", (Curve(CLOSED, values, ratios),),
        ((chosen, "chosen"),) if chosen else (), log_x=True,
    )  # fmt: skip


def _current(machine: Machine) -> str:
    """Set the bandwidth of the current loop and say by which rule."""
    core = machine.core
    if core.controller_options["current"] != "cascade" or core.kind("motor_1") != "armature":
        return "current loop: none in this machine; the torque is taken as it is asked for"
    limits = {"as it is": core.get(_BANDWIDTH)}
    for motor in core.motors:
        rated = core.get(f"{motor}.T_rated") / core.get(f"{motor}.K_d")
        taken = core.get(f"{motor}.R") * rated + core.get(f"{motor}.C_e") * core.get(
            f"{motor}.omega_max"
        )
        room = (core.get(f"{motor}.U_max") - taken) / (core.get(f"{motor}.L") * rated)
        if math.isfinite(room) and room > 0:
            limits[f"voltage of {motor}"] = room
    late = 1.5 * core.get("controller.current_sample") + core.get("controller.current_latency")
    if late:
        limits["sampling"] = 1.0 / (2.0 * late)
        del limits["as it is"]
    rule = min(limits, key=lambda name: limits[name])
    core.set(_BANDWIDTH, limits[rule])
    return f"current loop {human(limits[rule], '1/s')} in both drives, by: {rule}"


def _modulus_optimum(machine: Machine) -> float:
    """Highest P gain of a drive with open flanks: J/(2 T) at the pinion, T all small lags."""
    core = machine.core
    lags = core.get("controller.speed_sample") / 2 + core.get("controller.speed_latency")
    lags += core.get("controller.current_sample") / 2 + core.get("controller.current_latency")
    if core.kind("motor_1") == "armature" and core.controller_options["current"] == "cascade":
        lags += 1.0 / core.get(_BANDWIDTH)
    return _inertia(machine) / (2.0 * lags) if lags else 4.0 * core.get(_SPEED)


def _inertia(machine: Machine) -> float:
    """Of the lesser drive with open flanks, at the pinion."""
    core = machine.core
    return min(
        core.get(f"gearbox_{n}.ratio") ** 2 * core.get(f"motor_{n}.J") + core.get(f"pinion_{n}.J")
        for n in (1, 2)
    )


def _damped(job: Job, machine: Machine, path: str, value: float) -> float:
    machine.core.set(path, value)
    return damping(machine, closed(machine), job.state)


def _slow(job: Job, machine: Machine) -> float:
    """Frequency of the least damped vibration, rad/s: the measure of an integral time."""
    pole = least_damped(machine, closed(machine), job.state)
    return 1.0 / 0.1 if pole is None else abs(pole)


# --- step 4 ---------------------------------------------------------------------------------------


def position_gain(job: Job) -> Draft:
    """Step 4: raise the gain to the edge, by eigenvalues and by simulation; half of it is left.

    Eigenvalues in three contacts: all flanks closed, and either drive off its flanks, where the
    other one moves the table alone for a moment. Simulation with all flanks closed.
    """
    machine = decoupled(job.machine)
    edge = find_edge(machine, GAIN, *gain_range(machine), job.state)
    tuned = job.machine.copy()
    done, details = [_as_found(job)], {"edges": {k: list(v) for k, v in edge.found.items()}}
    if edge.lowest is None:
        tuned.core.set(GAIN, edge.searched / _MARGIN)
        done.append(f"no vibration up to {human(edge.searched, '1/s')}, the speed loop's own rate")
        return Draft(tuned, done, (_growth(edge, None),), details={**details, "simulated": None})
    done += [
        f"edge by eigenvalues, {contact}: {human(gain, '1/s')}, {hertz:.3g} Hz"
        for contact, (gain, hertz) in edge.found.items()
    ]
    if edge.lowest <= 1.001 * edge.gains[0]:
        reason = "a vibration grows at any position gain: the speed loop by itself is unstable"
        return Draft(tuned, done, (_growth(edge, None),), reason, details)
    known, simulated = [edge.lowest], None
    if edge.value is not None and edge.frequency_hz:
        simulated = measured_edge(machine, GAIN, edge.value, edge.frequency_hz)
        known.append(simulated or edge.value)
        done.append(
            f"edge by simulation of the whole machine, {CLOSED}: {human(simulated, '1/s')}"
            if simulated
            else f"edge by simulation, {CLOSED}: none from a tenth to 1.25 times of that"
        )
    gain = min(known) / _MARGIN
    tuned.core.set(GAIN, gain)
    done.append(f"set back to half of the lowest, a gain margin of 6 dB: {human(gain, '1/s')}")
    return Draft(
        tuned, done, (_growth(edge, simulated),), details={**details, "simulated": simulated}
    )


def _as_found(job: Job) -> str:
    """The edge before step 2 changed the speed loop, to tell what that was worth."""
    machine = decoupled(job.first)
    edge = find_edge(machine, GAIN, *gain_range(machine), job.state)
    if edge.value is None:
        return f"as found: no edge up to {human(edge.searched, '1/s')}, {CLOSED}"
    return f"as found: edge at {human(edge.value, '1/s')}, {edge.frequency_hz:.3g} Hz, {CLOSED}"


def _growth(edge: Edge, simulated: float | None) -> Panel:
    curves = tuple(Curve(name, edge.gains, rates) for name, rates in edge.growth.items())
    marks = [(gain, f"edge, {contact}") for contact, (gain, _) in edge.found.items()]
    if simulated:
        marks.append((simulated, f"simulated, {CLOSED}"))
    top = float(np.max(list(edge.growth.values())))
    return Panel(
        "Growth of the worst vibration", "position gain [1/s]", "growth [1/s]", curves,
        tuple(marks), log_x=True, y_range=(-max(10.0, top), max(2.0, top)),
    )  # fmt: skip


# --- step 5 ---------------------------------------------------------------------------------------


def set_back(job: Job) -> Draft:
    """Step 5: play and friction looked at; the gain lowered until vibrations are damped."""
    from scipy.optimize import brentq

    machine = decoupled(job.machine)
    core = machine.core
    done = _mechanics(machine)
    top = core.get(GAIN)
    gains = np.geomspace(1e-2 * top, 2.0 * top, 60)
    ratios = np.array([_damped(job, machine, GAIN, gain) for gain in gains])
    wanted = min(_DAMPED, _KEPT * float(ratios[0]))
    gain = top
    if _damped(job, machine, GAIN, top) < wanted:
        gain = float(
            brentq(lambda k: _damped(job, machine, GAIN, k) - wanted, gains[0], top, xtol=1e-6)
        )
    tuned = job.machine.copy()
    tuned.core.set(GAIN, gain)
    done.append(
        f"position gain {human(gain, '1/s')}: every vibration damped by {wanted:.2f} or more"
        if gain < top
        else f"position gain stays at {human(gain, '1/s')}: every vibration is damped by "
        f"{wanted:.2f} or more"
    )
    panel = _damping_by("position gain", "position gain [1/s]", gains, ratios, gain)
    said, product = _servo_gain(job, tuned)
    return Draft(tuned, [*done, said], (panel,), details={"damping": wanted, "servo_gain": product})


def _servo_gain(job: Job, machine: Machine) -> tuple[str, dict[str, float]]:
    """K_s = K_1 K_2 K_3 K_p of the paper's step (5), and its 10.

    The paper does not say what K_1 to K_3 are. Read along the loop: K_1 from the table's speed to
    the motor's, K_2 what the closed speed loop makes of a set-point in the long run, K_3 back from
    the motor to the table; K_p is the position controller. A speed loop that holds its set-point
    has K_2 = 1, and K_s is K_v.
    """
    trial = decoupled(machine)
    core = trial.core
    up = core.get("gearbox_1.ratio") * core.get("mesh_1.ratio")
    slow = [1e-4 * core.get(GAIN) / math.tau]
    answer = frequency_response(
        trial, "Omega_1", "omega_m", slow, modes=closed(trial), cut=["position"], state=job.state
    )
    kept = float(abs(answer.response[0])) * core.get("mesh_1.ratio")
    product = up * kept / up * core.get(GAIN)
    factors = f"{up:.4g} · {kept:.3f} · 1/{up:.4g} · {human(core.get(GAIN), '1/s')}"
    said = (
        f"K_s = K_1 K_2 K_3 K_p = {factors} = {human(product, '1/s')}; the paper sets 10, without "
        "a "
        f"unit: read as 1/s, this is {product / _PAPER_GAIN:.2g} times it"
    )
    return said, {"K_1": up, "K_2": kept, "K_3": 1.0 / up, "K_s": product}


def _mechanics(machine: Machine) -> list[str]:
    """What to look at before the gain is blamed: play of both meshes, friction of the table."""
    core, angle = machine.core, machine.unit_of("e", "rad")
    plays = [2 * core.get(f"mesh_{n}.gap") / core.get(f"mesh_{n}.ratio") for n in (1, 2)]
    done = [f"play at the table: {', '.join(human(p, angle) for p in plays)}"]
    if not math.isclose(*plays, rel_tol=0.1):
        done.append("the plays differ by more than a tenth: look at the mesh with more of it")
    for path in (p.path for p in machine.parameters() if p.path.endswith("@table.torque")):
        size = core.get(path)
        done.append(
            f"friction of the table {human(size, machine.parameter(path).unit)}: more oil film "
            "on the hydrostatic guide lowers it"
        )
    return done
