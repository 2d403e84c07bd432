"""Machines of the reference model built part by part in the core, and their runs read alike.

`core_machine(reference)` says in the core's words what a reference Machine says in its own; nothing
of either model's law is used for that, only names and units.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isinf

import numpy as np

import reference_model as reference
from dualdrive import _core

Array = reference.Array
ENGINE = "auto"  # of runs that name none; the fixture `both_engines` sets it
DEFAULT_RTOL = 1e-10  # of _core.simulate; test_oracle_switching.py holds it to that
FLANKS = {"front": 1, "back": -1}  # every other mode of a mesh transmits nothing


# ---------------------------------------------------------------------------------- assemblies


def drive_train(drives: int = 2, mesh: str = "gap") -> _core.Machine:
    """Return motors, rigid reducers, pinions and one table, all numbers still at their defaults."""
    machine = _core.Machine()
    numbers = range(1, drives + 1)
    for n in numbers:
        machine.add_body(f"motor_{n}")
        machine.add_body(f"pinion_{n}")
    machine.add_body("table")
    for n in numbers:
        machine.connect(f"gearbox_{n}", f"motor_{n}", f"pinion_{n}", "rigid", "driven")
        machine.connect(f"mesh_{n}", f"pinion_{n}", "table", mesh, "driver")
    for n in numbers:
        machine.add_motor(f"motor_{n}")
    return machine


def locked_pinions() -> _core.Machine:
    """Return a table between two pinions that are held, without motors."""
    machine = _core.Machine()
    for n in (1, 2):
        machine.add_body(f"pinion_{n}", locked=True)
    machine.add_body("table")
    for n in (1, 2):
        machine.connect(f"mesh_{n}", f"pinion_{n}", "table", "gap", "driver")
    return machine


def set_all(machine: _core.Machine, prefix: str, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        machine.set(f"{prefix}.{name}", value)


def add_friction(machine: _core.Machine, place: str, levels: tuple[float, float]) -> None:
    """Add dry friction of (forward, backward) level, N m."""
    if not any(levels):
        return
    label = machine.add_effect("coulomb", place)
    forward, backward = levels
    machine.set(f"{label}.torque", (forward + backward) / 2)
    machine.set(f"{label}.asymmetry", (forward - backward) / (forward + backward))


def core_machine(machine: reference.Machine) -> _core.Machine:
    """Return the same machine in the core."""
    core = drive_train()
    set_all(core, "table", {"J": machine.J_m, "b": machine.b_m})
    add_friction(core, "table", machine.friction)
    for n, drive in enumerate(machine.drives, 1):
        set_all(core, f"motor_{n}", {
            "J": drive.J_d, "b": drive.b_d, "K_d": drive.K_d, "C_e": drive.C_e, "R": drive.R,
            "L": drive.L, "T_max": drive.T_max, "U_max": drive.U_max,
        })  # fmt: skip
        set_all(core, f"pinion_{n}", {"J": drive.J_c, "b": drive.b_c})
        core.set(f"gearbox_{n}.ratio", drive.i)
        set_all(core, f"mesh_{n}", {"ratio": machine.i_m, "stiffness": drive.K_t, "gap": drive.gap})
        add_friction(core, f"pinion_{n}", drive.friction)
        if drive.c:
            label = core.add_effect("mesh_damping", f"mesh_{n}")
            core.set(f"{label}.coefficient", drive.c)
    if machine.controller is not None:
        add_controller(core, machine.controller, machine.drives[0])
    return core


def add_controller(core: _core.Machine, law: reference.Controller, drive: reference.Drive) -> None:
    """Set the core's controller; in the core 0 turns an integral time off, and k_p is a torque."""
    receives = {(-1.0, 1.0): "both", (0.0, 1.0): "slave", (-1.0, 0.0): "master"}
    voltage = law.omega_ci is None  # U = (R / K_d) T*, and the reference gives U per speed
    core.set_controller(
        equaliser=receives[law.equalises], current="voltage" if voltage else "cascade"
    )
    k_p = law.k_p * drive.i * drive.K_d / drive.R if voltage else law.k_p
    set_all(core, "controller", {
        "K_v": law.K_v, "K_i": law.K_i, "K_d": law.K_d, "tau_d": law.tau_d, "f_v": law.f_v,
        "k_p": k_p, "T_N": off(law.T_N), "g_E": 2 * law.K_E * k_p / drive.i, "T_E": off(law.T_E),
        "Omega_E": law.Omega_E, "w": law.w, "T_ten": law.T_ten, "tau_t": law.tau_t,
    })  # fmt: skip
    if law.omega_ci is not None:
        core.set("controller.omega_ci", law.omega_ci)
    core.set("motors.omega_max", law.Omega_max * drive.i)


def off(integral_time: float) -> float:
    return 0.0 if isinf(integral_time) else integral_time


# --------------------------------------------------------------------------------------- inputs


def core_inputs(motion: reference.Motion) -> dict[str, _core.Waveform]:
    """Return theta_ref and T_load of a reference Motion."""
    state = dict.fromkeys(reference.COMMAND, 0.0)
    knots: list[float] = []
    angle, load = [[0.0] * 4], [[0.0] * 2]
    for at, changes in motion.breakpoints:
        if knots:
            state = drift(state, at - knots[-1])
        state |= dict(changes)
        if knots and at == knots[-1]:
            del knots[-1], angle[-1], load[-1]
        knots.append(at)
        angle.append([state["theta_ref"], state["omega_ref"], state["alpha_ref"] / 2,
                      state["jerk_ref"] / 6])  # fmt: skip
        load.append([state["T_load"], state["load_rate"]])
    waves = [_core.sine(amplitude, hertz, phase) for amplitude, hertz, phase in motion.sines]
    return {
        "theta_ref": _core.sum([_core.Waveform(knots, angle), *waves]),
        "T_load": _core.Waveform(knots, load),
    }


def drift(state: Mapping[str, float], span: float) -> dict[str, float]:
    theta, omega, alpha, jerk, load, rate = (state[name] for name in reference.COMMAND)
    return {
        "theta_ref": theta + omega * span + alpha * span**2 / 2 + jerk * span**3 / 6,
        "omega_ref": omega + alpha * span + jerk * span**2 / 2,
        "alpha_ref": alpha + jerk * span,
        "jerk_ref": jerk,
        "T_load": load + rate * span,
        "load_rate": rate,
    }


# ----------------------------------------------------------------------------------------- runs


@dataclass
class Run:
    """A trajectory of the core by signal name."""

    raw: _core.Trajectory

    def __getitem__(self, name: str) -> Array:
        return np.asarray(self.raw.values[:, self.raw.names.index(name)])

    @property
    def t(self) -> Array:
        return np.asarray(self.raw.t)

    @property
    def X(self) -> Array:
        """The state vector in the order of Eq. 23, shape (times, 8)."""
        names = [name.replace("x_", "theta_c") for name in reference.PLANT]
        return np.column_stack([self[name] for name in names])

    @property
    def contacts(self) -> list[tuple[float, int, int, int]]:
        """(time, mesh, flank before, flank after) of every contact made or lost."""
        changes = [
            (t, int(element[-1]), FLANKS.get(before, 0), FLANKS.get(after, 0))
            for t, element, before, after in self.raw.events
            if element.startswith("mesh")
        ]
        return [change for change in changes if change[2] != change[3]]

    def events(self, element: str) -> list[tuple[float, str, str]]:
        return [(t, a, b) for t, name, a, b in self.raw.events if name == element]

    def slope(self, signal: str, parameter: str) -> Array:
        """Return d signal / d parameter, shape (times,)."""
        s, p = self.raw.names.index(signal), self.raw.parameters.index(parameter)
        return np.asarray(self.raw.sensitivities[:, s, p])


def run(
    machine: _core.Machine,
    inputs: Mapping[str, _core.Waveform] | None = None,
    end: float = 1.0,
    *,
    initial: Mapping[str, float] | None = None,
    sensitivities: Sequence[str] = (),
    signals: Iterable[str] = (),
    times: Sequence[float] | Array = (),
    output_step: float = 1e-3,
    rtol: float | None = None,
    method: str = "auto",
    engine: str | None = None,
    start: float = 0.0,
) -> Run:
    """Simulate and insist on success."""
    trajectory = _core.simulate(
        machine, dict(inputs or {}), end=end, start=start, output_step=output_step,
        times=list(times), method=method, engine=engine or ENGINE, signals=list(signals),
        sensitivities=list(sensitivities), initial=dict(initial or {}),
        rtol=DEFAULT_RTOL if rtol is None else rtol,
    )  # fmt: skip
    assert trajectory.status == "success", trajectory.message
    return Run(trajectory)


def run_like(
    machine: reference.Machine,
    motion: reference.Motion,
    end: float,
    *,
    initial: Mapping[str, float] | None = None,
    rtol: float | None = None,
    method: str = "auto",
    engine: str | None = None,
    output_step: float = 1e-3,
) -> Run:
    """Run a machine and motion of the reference model in the core."""
    names = {"x_1": "mesh_1.twist", "x_2": "mesh_2.twist"}
    start = {names.get(name, name): value for name, value in (initial or {}).items()}
    return run(
        core_machine(machine), core_inputs(motion), end, initial=start, rtol=rtol, method=method,
        engine=engine, output_step=output_step,
    )  # fmt: skip


def apart(run: Run, truth: reference.Trajectory) -> float:
    """Return the largest difference of the eight plant states, each over its own peak."""
    peak = np.abs(truth.X).max(axis=0)
    return float((np.abs(run.X - truth.X).max(axis=0) / np.where(peak > 0, peak, 1.0)).max())


def nearest_times(run: Run, truth: reference.Trajectory) -> float:
    """Return the largest distance of contact times, infinite if one is missed or invented."""
    mine, theirs = run.contacts, truth.contacts
    order = [sorted(c[1:] for c in contacts) for contacts in (mine, theirs)]
    if order[0] != order[1]:
        return inf
    return max((abs(a[0] - b[0]) for a, b in zip(mine, theirs, strict=True)), default=0.0)
