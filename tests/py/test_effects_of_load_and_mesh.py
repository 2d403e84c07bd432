"""Effects of friction, mesh and load as motion: against closed forms, and in the torque balance."""

from __future__ import annotations

from math import pi, sin, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq

from core_machines import Array, Run, drive_train, set_all
from dualdrive import _core


def rotor(effect: str, J: float = 2.0, **numbers: float) -> _core.Machine:
    """Return one free body with one effect."""
    machine = _core.Machine()
    machine.add_body("table")
    machine.set("table.J", J)
    set_all(machine, machine.add_effect(effect, "table"), numbers)
    return machine


def run(machine: _core.Machine, end: float, load: float = 0.0, **initial: float) -> Run:
    inputs = {"T_load": _core.constant(load)}
    raw = _core.simulate(machine, inputs, end=end, initial=initial)
    assert raw.status == "success", raw.message
    return Run(raw)


def test_inertia_that_varies_keeps_the_energy() -> None:
    """ω(θ) = ω0 √(J(0) / J(θ)), whatever the time it takes."""
    r = run(rotor("position_dependent_inertia", amplitude=0.6, order=2.0), 10.0, omega_m=1.0)
    expected = np.sqrt(1.6 / (1 + 0.6 * np.cos(2 * r["theta_m"])))
    np.testing.assert_allclose(r["omega_m"], expected, rtol=1e-8)
    assert r["theta_m"][-1] > 2 * pi


def test_an_unbalanced_body_swings_as_a_pendulum() -> None:
    """Small swings about the angle where gravity pulls it to: √(m g r / J)."""
    low = -pi / 2  # T = a cos(θ + φ) with φ = π: zero there, and pulling back
    machine = rotor("unbalance", J=2.0, amplitude=50.0, phase=pi)
    r = run(machine, 2 * pi / 5, theta_m=low + 1e-4)
    assert r["theta_m"][-1] - low == pytest.approx(1e-4, rel=1e-5)
    assert abs(r["theta_m"][len(r["theta_m"]) // 2] - low + 1e-4) < 1e-7


def test_quadratic_drag_slows_down_hyperbolically() -> None:
    r = run(rotor("hydrostatic_drag", J=2.0, quadratic=0.5), 4.0, omega_m=3.0)
    np.testing.assert_allclose(r["omega_m"], 3.0 / (1 + 3.0 * 0.5 / 2.0 * r.t), rtol=1e-7)


def test_friction_by_angle_stops_a_body_where_its_work_is_done() -> None:
    """½ J ω0² = F (θ + sin(n θ) / n)."""
    r = run(rotor("angle_dependent_friction", torque=10.0, order=5.0), 4.0, omega_m=3.0)
    stop = brentq(lambda a: 10.0 * (a + sin(5 * a) / 5) - 9.0, 0.0, 3.0)
    assert r["theta_m"][-1] == pytest.approx(stop, rel=1e-6)
    assert r["omega_m"][-1] == 0.0


def test_a_cut_takes_its_impulse_however_long_the_rest_before() -> None:
    """Half of entry and of exit count: ∫ T dt = mean (duration − rise)."""
    numbers = {"mean": 20.0, "start": 50.0, "duration": 0.1, "rise": 0.01}
    r = run(rotor("cutting_torque", J=2.0, **numbers), 100.0)
    assert r["omega_m"][-1] == pytest.approx(-20.0 * 0.09 / 2.0, rel=1e-8)
    assert r["theta_m"][-1] == pytest.approx(-0.9 * (50.0 - 0.05), rel=1e-8)


def held_table(effect: str, place: str = "mesh_1", **numbers: float) -> _core.Machine:
    machine = _core.Machine()
    machine.add_body("pinion_1", locked=True)
    machine.add_body("table")
    machine.connect("mesh_1", "pinion_1", "table", "gap", "driver")
    set_all(machine, "mesh_1", {"ratio": 5.0, "stiffness": 1e4, "gap": 1e-2})
    set_all(machine, "table", {"J": 1.0, "b": 500.0})
    set_all(machine, machine.add_effect(effect, place), numbers)
    return machine


def test_a_hertzian_mesh_yields_by_its_law() -> None:
    """A load on a table whose pinion is held: T_load / i_m = K ξ (1 + h √(ξ/ξ_r))."""
    machine = held_table("hertzian_stiffness", growth=0.5, overlap=1e-3)
    for load in (5.0, 50.0, 500.0):
        overlap = run(machine, 5.0, load)["mesh_1.deflection"][-1] - 1e-2
        force = 1e4 * overlap * (1 + 0.5 * sqrt(overlap / 1e-3))
        assert force == pytest.approx(load / 5.0, rel=1e-3)  # the root is rounded at light load


@pytest.mark.parametrize(("angle", "gap"), [(0.0, 3e-2), (0.5, 1e-2)])
def test_worn_teeth_give_way_further_where_they_are_worn(angle: float, gap: float) -> None:
    """The table rests against the flank a gap's width from the middle."""
    machine = held_table("wear", "table", depth=2e-2, centre=0.0, width=0.05)
    start = {"theta_m": angle, "mesh_1.twist": 0.0}
    r = run(machine, 20.0, 2.0, **start)
    assert r["mesh_1.flank"][-1] == 1
    assert r["mesh_1.deflection"][-1] == pytest.approx(gap, rel=2e-2)


def test_a_mesh_without_play_gains_some_where_it_is_worn() -> None:
    machine = held_table("wear", "table", depth=2e-2, width=0.05)
    machine.set("mesh_1.gap", 0.0)
    assert run(machine, 20.0, 2.0)["mesh_1.deflection"][-1] == pytest.approx(2e-2, rel=2e-2)
    compliant = drive_train(mesh="compliant")
    with pytest.raises(ValueError, match="no connection with play"):
        compliant.add_effect("wear", "table")


def dual(**numbers: float) -> _core.Machine:
    """Return two drives under constant torques on one table."""
    machine = _core.Machine()
    for body in ("pinion_1", "pinion_2", "table"):
        machine.add_body(body)
    for n in (1, 2):
        machine.connect(f"mesh_{n}", f"pinion_{n}", "table", "gap", "driver")
        set_all(machine, f"mesh_{n}", {"ratio": 4.0, "stiffness": 300.0, "gap": 5e-3})
        machine.add_motor(f"motor_{n}", f"pinion_{n}", "direct")
        set_all(machine, f"pinion_{n}", {"J": 3e-3, "b": 0.02})
        set_all(machine, machine.add_effect("mesh_damping", f"mesh_{n}"), {"coefficient": 0.2})
    set_all(machine, "table", {"J": 0.2, "b": 0.1})
    return machine


def test_a_mesh_loses_a_share_of_what_it_carries() -> None:
    """One drive drives, the other brakes; the loss is against the motion in both meshes."""
    machine = dual()
    set_all(machine, machine.add_effect("load_dependent_mesh_loss", "pinions"), {"fraction": 0.03})
    torques = {"T_1": _core.constant(1.2), "T_2": _core.constant(0.4)}
    raw = _core.simulate(machine, torques | {"T_load": _core.constant(2.0)}, end=20.0)
    r = Run(raw)
    carried = [r[f"mesh_{n}.torque"][-1] for n in (1, 2)]
    speed = r["omega_m"][-1]
    for n, torque in enumerate((1.2, 0.4)):  # steady: torque − drag − loss = what the mesh carries
        used = carried[n] + 0.03 * abs(carried[n])
        assert torque - 0.02 * 4.0 * speed == pytest.approx(used, rel=1e-6)
    assert carried[1] < 0 < carried[0]
    assert 4.0 * sum(carried) == pytest.approx(2.0 + 0.1 * speed, rel=1e-6)


EFFECTS = {
    "angle_dependent_friction@table": {"torque": 0.3, "order": 3.0, "phase": 0.4},
    "load_dependent_mesh_loss@pinions": {"fraction": 0.03},
    "load_dependent_mesh_loss@table": {"fraction": 0.03},
    "hertzian_stiffness@meshes": {"growth": 0.4, "overlap": 2e-3},
    "time_varying_mesh_stiffness@pinions": {"amplitude": 0.2, "teeth": 20.0, "phase": 0.3},
    "transmission_error@pinions": {"amplitude": 2e-4, "teeth": 20.0, "phase": 0.3},
    "wear@table": {"depth": 3e-3, "centre": 0.3, "width": 0.2},
    "unbalance@table": {"amplitude": 0.5, "phase": 0.3},
    "cutting_torque@table": {"mean": 0.5, "amplitude": 0.2, "start": 0.3, "duration": 0.5},
    "hydrostatic_drag@table": {"viscous": 0.1, "quadratic": 0.3},
    "position_dependent_inertia@table": {"amplitude": 0.3, "order": 2.0, "phase": 0.2},
}


def moved(machine: _core.Machine) -> dict[str, Array]:
    """Return what a record of a lively run holds, exact to the solver's tolerance."""
    inputs = {"T_1": _core.sine(2.0, 0.7) + _core.constant(0.5), "T_2": _core.sine(1.5, 0.4)}
    raw = _core.simulate(machine, inputs, end=1.5, output_step=1e-3, rtol=1e-10)
    assert raw.status == "success", raw.message
    r = Run(raw)
    names = [f"{kind}_{s}" for kind in ("theta", "omega", "alpha") for s in ("c1", "c2", "m")]
    return {"t": r.t} | {name: r[name] for name in ("T_1", "T_2", *names)}


@pytest.mark.parametrize("label", EFFECTS)
def test_the_torque_balance_of_a_run_closes(label: str) -> None:
    """Residuals vanish on the run's own kinematics, in the total and in every equation."""
    machine = dual()
    set_all(machine, machine.add_effect(*label.split("@")), EFFECTS[label])
    channels = moved(machine)
    balance = _core.torque_balance(machine, channels, numbers(label), 1e-6)
    moving = ~np.asarray(balance["standstill"]).any(axis=0)
    size = np.abs(channels["T_1"]).max()
    residual = np.asarray(balance["residual"])[:, moving]
    assert moving.sum() > 1000
    assert np.abs(residual).max() < 2e-5 * size
    set_all(machine, label, {"fraction": 0.0} if "loss" in label else dict.fromkeys(
        (strength(label),), 0.0))  # fmt: skip
    without = np.asarray(_core.torque_balance(machine, channels, [], 1e-6)["residual"])
    assert np.abs(without).max() > 1e-2 * size  # the effect matters in this run


@pytest.mark.parametrize("label", EFFECTS)
def test_its_slopes_agree_with_differences(label: str) -> None:
    machine = dual()
    set_all(machine, machine.add_effect(*label.split("@")), EFFECTS[label])
    channels = {k: v[::10] for k, v in moved(machine).items()}
    paths = numbers(label)
    balance = _core.torque_balance(machine, channels, paths, 1e-6)
    jacobian = np.asarray(balance["jacobian"])
    moving = ~np.asarray(balance["standstill"]).any(axis=0)
    for k, path in enumerate(paths):
        value, sides = machine.get(path), []
        h = 1e-5 * (abs(value) or 1.0)
        for side in (value + h, value - h):
            machine.set(path, side)
            sides.append(np.asarray(_core.torque_balance(machine, channels, [], 1e-6)["residual"]))
        machine.set(path, value)
        slope = (sides[0] - sides[1]) / (2 * h)
        error = np.abs(jacobian[..., k] - slope)[:, moving]
        # a flank that changes within the difference is no slope
        assert np.quantile(error, 0.98) < 1e-4 * max(np.abs(slope[:, moving]).max(), 1e-6), path


def numbers(label: str) -> list[str]:
    kind = _core.effect_type(label.split("@")[0])
    return [f"{label}.{p.path}" for p in kind.parameters]


def strength(label: str) -> str:
    """The parameter that is zero by default."""
    kind = _core.effect_type(label.split("@")[0])
    return str(next(p.path for p in kind.parameters if p.standard == 0.0))


def test_losses_show_where_only_the_table_and_the_torques_are_recorded() -> None:
    """Without a deflection the load of a mesh follows from its motor's torque."""
    machine = dual()
    label = machine.add_effect("load_dependent_mesh_loss", "pinions")
    machine.set("load_dependent_mesh_loss@pinions.fraction", 0.03)
    machine.set("meshes.stiffness", 3e4)
    n = 400
    t = np.linspace(0.0, 1.0, n)
    speed, rate = 0.3 + 0.1 * np.sin(4 * t), 0.4 * np.cos(4 * t)
    channels = {"t": t, "theta_m": np.zeros(n), "omega_m": speed, "alpha_m": rate}
    carried = [1.0 + 0.3 * np.sin(3 * t), -0.6 + 0.0 * t]
    # of rigid meshes: J α + b ω + carried + lost
    for k, torque in enumerate(carried, 1):
        inner = 3e-3 * 4 * rate + 0.02 * 4 * speed
        channels[f"T_{k}"] = inner + torque + 0.03 * np.abs(torque)
    table = 4.0 * (carried[0] + carried[1])
    balance = _core.torque_balance(machine, channels, [f"{label}.fraction"], 1e-6)
    total = np.asarray(balance["residual"])[0]
    np.testing.assert_allclose(total, 0.2 * rate + 0.1 * speed - table, atol=1e-5)
    # at given motor torques |T| is what the drive gives over 1 + μ; where the mesh brakes, 1 − μ
    lost = 4.0 * (np.abs(carried[0]) / 1.03 + np.abs(carried[1]) / 0.97)
    np.testing.assert_allclose(np.asarray(balance["jacobian"])[0, :, 0], lost, rtol=1e-5)
