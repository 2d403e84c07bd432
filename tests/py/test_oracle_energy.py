"""Oracle 4: energy closes to integration error in every machine, and nothing passive gives any."""

from __future__ import annotations

import numpy as np
import pytest

from core_machines import Array, Run
from core_random import RandomMachine
from dualdrive import _core

MACHINES, BLOCK = 200, 20
LOSSES = ("copper", "viscous", "mesh")  # of the ledger: these never give
DISSIPATIVE = ("viscous", "coulomb", "stribeck", "mesh_damping", "sensor_delay", "sensor_offset",
               "eccentricity", "angle_dependent_friction", "load_dependent_mesh_loss",
               "hydrostatic_drag", "transmission_error", "time_varying_mesh_stiffness", "wear",
               "hertzian_stiffness", "position_dependent_inertia", "dead_time", "quantisation",
               "encoder_eccentricity", "radial_shift", "table_tilt", "pitch_error",
               "tension_mismatch", "current_limit", "voltage_limit",
               "transport_delay", "gearbox_backlash", "shaft_compliance")  # fmt: skip
SUFFIX = {"table": "m"} | {f"pinion_{n}": f"c{n}" for n in "123"} | {f"motor_{n}": n for n in "123"}


def run(machine: RandomMachine, rtol: float) -> Run:
    trajectory = _core.simulate(
        machine.machine, machine.inputs, end=0.3, rtol=rtol, initial=machine.initial
    )
    assert trajectory.status == "success", (machine.notes, trajectory.message)
    return Run(trajectory)


def stored(machine: _core.Machine, run: Run) -> Array:
    """Return kinetic, elastic and magnetic energy from speeds, deflections and currents alone."""
    energy = sum(0.5 * inertia(machine, run, b) * speed(run, b) ** 2 for b in machine.bodies)
    for connection in machine.connections:
        kind, x = machine.kind(connection), run[f"{connection}.deflection"]
        if kind == "rigid":
            continue
        gap, stiffness, growth = mesh(machine, run, connection)
        if kind == "gap":
            x = x - np.clip(x, -gap, gap)
        energy = energy + 0.5 * stiffness * x**2
        for share, overlap in growth:
            u, small = (x / overlap) ** 2 + 1e-4, 1e-4**1.25  # the rounding of the root is 0.01
            energy = energy + 0.4 * stiffness * share * overlap**2 * (u**1.25 - small)
        if kind == "compliant":
            energy = energy + machine.get(f"{connection}.preload") * x
    for motor in machine.motors:
        if machine.kind(motor) == "armature":
            energy = energy + 0.5 * machine.get(f"{motor}.L") * run[f"I_{SUFFIX[motor]}"] ** 2
    return np.asarray(energy)


def speed(run: Run, body: str) -> Array:
    return run[f"omega_{SUFFIX[body]}"]


def angle(run: Run, body: str) -> Array:
    return run[f"theta_{SUFFIX[body]}"]


def numbers(machine: _core.Machine, kind: str, place: str) -> list[dict[str, float]]:
    """Return the parameters of every effect of a kind at a place."""
    return [
        {p.path.rpartition(".")[2]: p.value for p in machine.parameters()
         if p.path.rpartition(".")[0] == effect["label"]}
        for effect in machine.effects if effect["effect"] == kind and effect["place"] == place
    ]  # fmt: skip


def inertia(machine: _core.Machine, run: Run, body: str) -> float | Array:
    J: float | Array = machine.get(f"{body}.J")
    for p in numbers(machine, "position_dependent_inertia", body):
        J = J * (1 + p["amplitude"] * np.cos(p["order"] * angle(run, body) + p["phase"]))
    return J


def mesh(
    machine: _core.Machine, run: Run, connection: str
) -> tuple[float | Array, float | Array, list[tuple[float, float]]]:
    """Return half gap, stiffness and (growth, reference overlap) as effects leave them."""
    gap: float | Array = machine.get(f"{connection}.gap")
    stiffness: float | Array = machine.get(f"{connection}.stiffness")
    pinion = connection.replace("mesh", "pinion").replace("gearbox", "motor")
    for p in numbers(machine, "wear", pinion) if connection.startswith("mesh") else []:
        off = np.cos(angle(run, pinion) - p["centre"]) - 1
        gap = gap + p["depth"] * np.exp(off / p["width"] ** 2)
    for p in numbers(machine, "time_varying_mesh_stiffness", connection):
        swing = np.cos(p["teeth"] * angle(run, pinion) + p["phase"])
        stiffness = stiffness * (1 + p["amplitude"] * swing)
    growth = [
        (p["growth"], p["overlap"]) for p in numbers(machine, "hertzian_stiffness", connection)
    ]
    return gap, stiffness, growth


@pytest.mark.parametrize("first", range(0, MACHINES, BLOCK))
def test_energy_closes_and_losses_only_lose(first: int) -> None:
    for seed in range(first, first + BLOCK):
        machine = RandomMachine(seed)
        rough, fine = run(machine, 1e-6), run(machine, 1e-9)
        errors = [r.raw.statistics["energy_error"] for r in (rough, fine)]
        assert errors[0] < 5e-3, machine.notes
        assert errors[1] < 5e-6, machine.notes
        # powers of what a tick sets off and what then dies away are a polynomial through nodes
        assert errors[1] < max(errors[0] / 5, 1e-7), machine.notes
        check_ledger(machine, fine)


def check_ledger(machine: RandomMachine, run: Run) -> None:
    work, names = run.raw.work, run.raw.work_names
    energy = stored(machine.machine, run)
    moved = max(np.abs(work).max(), np.abs(energy).max())
    np.testing.assert_allclose(run["energy.stored"], energy, atol=1e-12 * moved, rtol=1e-9)
    assert np.abs(energy - energy[0] - work.sum(axis=1)).max() < 1e-5 * moved, machine.notes
    losses = list(LOSSES)
    if all(effect["effect"] in DISSIPATIVE for effect in machine.machine.effects):
        losses.append("effects")
    for name in losses:
        gained = np.diff(work[:, names.index(name)])
        assert gained.max() < 1e-7 * moved, (name, machine.notes)


def test_the_suite_meets_every_effect_and_structure() -> None:
    machines = [RandomMachine(seed) for seed in range(MACHINES)]
    effects = {effect["effect"] for m in machines for effect in m.machine.effects}
    assert effects == {kind.name for kind in _core.effect_types()} | {"expression"}
    notes = {note for m in machines for note in m.notes}
    assert {"1 drives", "2 drives", "3 drives", "direct", "rigid", "compliant", "gap", "no gap",
            "slave lag", "latency", "tight T_max", "tight U_max", "falling", "voltage",
            "moving start"} <= notes  # fmt: skip
    assert {f"sampled {loop}" for loop in ("position", "tension", "speed", "current")} <= notes
