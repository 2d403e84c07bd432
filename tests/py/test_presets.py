"""The machines that come along: the numbers they were designed with, and what they then do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dualdrive import Machine, Run, default_motion, parse_motion, simulate
from dualdrive.machine import DEFAULT, presets
from heavy_table import STUDY, heavy

ARCSEC = math.pi / 648000
HEAVY = ("empty", "100t", "250t", "550t")


def hunting(run: Run) -> float:
    """Peak to peak of the following error in t = 12–14 s, arc seconds."""
    return float(np.ptp(run["e"][(run.t >= 12) & (run.t <= 14)])) / ARCSEC


def test_the_default_comes_first() -> None:
    assert presets()[0] == DEFAULT == "heavy-table-100t"
    assert Machine.load().name == DEFAULT


def test_loads_differ_in_the_table_alone() -> None:
    tables = {load: {p.path: p.value for p in heavy(load).parameters()} for load in HEAVY}
    inertia = {load: values.pop("table.J") for load, values in tables.items()}
    assert len({tuple(values.items()) for values in tables.values()}) == 1
    added = {load: inertia[load] - inertia["empty"] for load in HEAVY[1:]}
    # a solid steel disc of 12.5 m: J = m D² / 8
    assert added["100t"] == pytest.approx(100e3 * 12.5**2 / 8, rel=3e-3)
    assert added["250t"] == pytest.approx(6.60e6)
    assert added["550t"] == pytest.approx(13.8e6)


def test_the_heavy_table_at_its_pinion() -> None:
    m = heavy("empty")
    i = m.get("gearboxes.ratio")
    assert i**2 * m.get("motors.J") + m.get("pinions.J") == pytest.approx(1072.5)
    assert i**2 * m.get("motors.b") + m.get("pinions.b") == pytest.approx(650)
    play = 2 * m.get("meshes.gap") / m.get("meshes.ratio")
    assert play / ARCSEC == pytest.approx(22.7, abs=0.05)
    assert m.get("motors.omega_max") / i / m.get("meshes.ratio") == pytest.approx(0.0523, abs=1e-4)


@pytest.mark.parametrize(("load", "hertz"), list(zip(HEAVY, (11.6, 9.0, 6.5, 4.9), strict=True)))
def test_locked_rotor_frequency(load: str, hertz: float) -> None:
    """Table on both meshes: sqrt(2 K i_m² / J_m), printed with the machine's design."""
    m = heavy(load)
    stiffness = 2 * m.get("meshes.stiffness") * m.get("meshes.ratio") ** 2
    assert math.sqrt(stiffness / m.get("table.J")) / math.tau == pytest.approx(hertz, abs=0.06)


@pytest.mark.parametrize(
    ("load", "arcsec"), [("empty", 0.0), ("100t", 0.0), ("250t", 35.0), ("550t", 51.7)]
)
def test_hunting_without_tension(load: str, arcsec: float) -> None:
    """Figures of an independent study with smoothed friction; here friction is exact."""
    m = heavy(load)
    m.set("controller.T_ten", 0)
    assert hunting(simulate(m, parse_motion(STUDY))) == pytest.approx(arcsec, abs=0.3)


@pytest.mark.parametrize("load", HEAVY)
def test_tension_stops_the_hunting(load: str) -> None:
    run = simulate(heavy(load), parse_motion(STUDY))
    assert hunting(run) < 0.01
    assert run["T_1"][-1] - run["T_2"][-1] == pytest.approx(60.0, rel=1e-3)


@pytest.mark.parametrize("name", presets())
def test_every_preset_follows_a_motion_that_suits_it(name: str) -> None:
    m = Machine.load(name)
    run = simulate(m)
    assert run.ok, run.message
    assert run.statistics["energy_error"] < 1e-6
    arrived = run["theta_ref"][-1]
    assert abs(run["e"][-1]) < 0.01 * arrived
    for motor in m.core.motors:
        torque = run[f"T_{motor.rpartition('_')[2]}"]
        assert np.abs(torque).max() < m.get(f"{motor}.T_max"), "the default motion saturates"


@pytest.mark.parametrize("name", presets())
def test_the_default_motion_keeps_to_the_speed_limit(name: str) -> None:
    m = Machine.load(name)
    motion = default_motion(m)
    t = np.linspace(0, motion.end, 20001)
    ratio = math.prod(
        m.get(f"{part}.ratio") for part in ("gearbox_1", "mesh_1") if part in m.core.connections
    )
    fastest = float(np.abs(motion.waveform.rate(t)).max())
    assert 0.1 < fastest * ratio / m.get("motor_1.omega_max") < 0.7


def test_play_in_two_places_adds_up_to_the_plain_table() -> None:
    two, plain = Machine.load("heavy-table-dual-servo"), heavy("100t")
    assert two.get("gearboxes.gap") + two.get("meshes.gap") == pytest.approx(
        plain.get("meshes.gap")
    )
    in_series = 1 / (1 / two.get("gearboxes.stiffness") + 1 / two.get("meshes.stiffness"))
    assert in_series == pytest.approx(plain.get("meshes.stiffness"))


def test_the_split_shaft_keeps_4500_newton_metres_on_the_end_gaps() -> None:
    """At rest without friction or control: preload - K_s · 2Δ over 1 + 2 K_s / K_m."""
    m = Machine.load("heavy-table-double-pinion")
    m.set("controller.kind", "none")
    for label in ("coulomb@table", "coulomb@pinions"):
        m.remove(label)
    spring, mesh = m.get("split_shaft.stiffness"), m.get("meshes.stiffness")
    closed = -m.get("split_shaft.preload") - spring * 2 * m.get("meshes.gap")
    left = closed / (1 + 2 * spring / mesh)
    assert left == pytest.approx(4500, rel=0.02)
    run = simulate(m, end=20)
    assert run["mesh_1.torque"][-1] == pytest.approx(left, rel=1e-3)
    assert run["mesh_2.torque"][-1] == pytest.approx(-left, rel=1e-3)
