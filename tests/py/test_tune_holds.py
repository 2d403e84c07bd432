"""`tune` ends on a machine that stands still, or says what forbids it; filters, K_s, exports."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualdrive.linear import (
    FrequencyResponse,
    differ,
    frequency_response,
    read_response,
)
from dualdrive.linear.contacts import closed
from dualdrive.machine import Machine
from dualdrive.motion import parse_motion
from dualdrive.optimise import Design, LeastTension
from dualdrive.run import Run
from dualdrive.simulation import simulate
from dualdrive.tune import drive_parameters, set_drive_parameters, standstill, tune
from dualdrive.tune.assess import usual_motion
from dualdrive.tune.coupling import _tension
from dualdrive.tune.filters import Filter, asked_for, from_response, peak_of
from dualdrive.tune.hold import hold
from dualdrive.tune.job import Job
from dualdrive.tune.standstill import restless, trials
from heavy_table import STUDY, heavy, tuned

# --- standing still -------------------------------------------------------------------------------


def test_a_machine_that_a_gentle_move_leaves_at_rest_hunts_after_a_step() -> None:
    """A tenth above the least tension of the move: 43.6 arcsec for ever after 0.1 mrad.

    The empty table's gentle move asks for a fourth of the tension that a step asks for.
    """
    done = tuned("empty")
    hunts = done.machine.copy()
    hunts.set("controller.T_ten", 1.1 * done.steps[6].details["least_tension"])
    found = restless(hunts, trials(hunts, done.motion))
    assert found is not None
    assert found.trial.text == "a step of 0.1 mrad"
    assert np.degrees(found.size) * 3600 == pytest.approx(43.6, abs=1.0)
    preset = heavy("empty")
    assert restless(preset, trials(preset, usual_motion(preset))) is None


def test_tuned_tables_stand_still_where_they_were_not_looked_at() -> None:
    """Other steps, other speeds, other loads, by the other engine."""
    done = tuned("empty")
    assert done.status == "tuned"
    assert done.machine.get("controller.T_ten") > 3 * done.steps[6].details["least_tension"]
    other = trials(done.machine, done.motion, loads=(0.9, 1.1), steps=(5e-4,), speeds=(0.5,))
    assert restless(done.machine, other, engine="cvode") is None
    assert any("tension raised to" in line for line in done.steps[6].done)


def test_what_forbids_a_tension_is_said_and_can_be_repeated() -> None:
    """Motors too weak to hold the flanks closed: step 7 ends it, and the trial it names hunts."""
    weak = heavy("550t", controller__K_v=9.0, controller__T_ten=1.0, motors__T_rated=1.5)
    weak.set("controller.K_i", 10.0)  # with an integral, less gain is no way out
    found = hold(weak, parse_motion(STUDY))
    assert found.failure is not None
    assert "at every tension up to the rated torque, 1.5 N·m" in found.reason
    still = restless(found.machine, [found.failure.trial], engine="cvode")
    assert still is not None
    assert still.size == pytest.approx(found.failure.size, rel=0.2)


def test_a_table_that_hunts_at_every_tension_gets_the_rated_torque_and_then_less_gain() -> None:
    """No refusal before the position gain was lowered: that is what `hold` goes on to do."""
    machine, motion = heavy("empty"), parse_motion(STUDY)
    hunting = [
        Design({"controller.T_ten": tension}, True, "nominal", -1.0, margin=0.0, hunting=2e-4)
        for tension in (0.0, 50.0, 100.0)
    ]
    found = LeastTension(None, "flanks open", tuple(hunting), (), motion)
    job = Job(machine, machine, motion, None, 1.0, 5.0)
    tension, why = _tension(machine, job, found)
    assert tension == machine.get("motor_1.T_rated")
    assert "hunts at every one" in why


def test_a_run_that_its_engine_can_t_finish_is_no_unstable_loop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Friction that one engine can't settle is left to another; what none can is said as it is."""
    preset = heavy("empty")
    (trial,) = trials(preset, usual_motion(preset), loads=(1.0,), steps=(1e-4,), speeds=())
    asked = []

    def stopping(machine: Machine, motion: Any, *, engine: str, energy: bool) -> Run:
        asked.append(engine)
        run = simulate(machine, motion, engine=engine, energy=energy)
        if engine not in broken:
            return run
        said = "friction of c2 switches without end"
        return replace(run, status="chattering", message=said)

    broken = {"cvode"}
    monkeypatch.setattr(standstill, "simulate", stopping)
    assert restless(preset, [trial], engine="cvode") is None
    assert asked == ["cvode", "explicit"]
    broken = {"cvode", "explicit"}
    found = restless(preset, [trial], engine="cvode")
    assert found is not None
    assert found.text == (
        "after a step of 0.1 mrad the simulation ends early: friction of c2 switches without end"
    )


# --- filters --------------------------------------------------------------------------------------


def resonant() -> Machine:
    """Light pinions behind soft shafts with little damping, in a drive that is sampled late."""
    machine = Machine.load("heavy-table-dual-servo")
    for path, value in {
        "mesh_damping@gearboxes.coefficient": 500.0, "mesh_damping@meshes.coefficient": 3e3,
        "controller.speed_sample": 1e-3, "controller.speed_latency": 1e-3, "pinions.J": 150.0,
    }.items():  # fmt: skip
        machine.set(path, value)
    return machine


@pytest.mark.long
def test_a_notch_is_proposed_where_a_resonance_stops_the_gain() -> None:
    done = tune(resonant(), until=2)
    (said,) = [line for line in done.steps[1].done if line.startswith("set-point filter")]
    assert "119 Hz stops the gain" in said
    assert "notch 119 Hz" in said
    assert done.machine.get("motor_1.filter_pole") == done.machine.get("motor_2.filter_pole") > 100
    rigid = tune(heavy("empty"), until=2)
    (plain,) = [line for line in rigid.steps[1].done if line.startswith("set-point filter")]
    assert plain.startswith("set-point filter: none")


@pytest.mark.long
def test_drive_parameters_carry_the_filter_there_and_back() -> None:
    machine = tune(resonant(), until=2).machine
    table = drive_parameters(machine)
    assert (table["p1656"], table["p1657"]) == (1.0, 2.0)
    again = set_drive_parameters(Machine.load("heavy-table-dual-servo"), table).machine
    for name in ("filter_pole", "filter_pole_damping", "filter_zero", "filter_zero_damping"):
        assert again.get(f"motors.{name}") == pytest.approx(machine.get(f"motors.{name}"))
    off = set_drive_parameters(again, drive_parameters(heavy("empty"))).machine
    assert off.get("motors.filter_pole") == 0.0


def test_filters_of_both_drives_are_made_alike_in_step_1() -> None:
    machine = heavy("empty", motor_1__filter_pole=90.0)
    done = tune(machine, until=1)
    assert done.machine.get("motor_2.filter_pole") == 90.0
    assert any("set-point filters must be alike" in line for line in done.steps[0].done)


def peaking(apart: float = 40.0) -> FrequencyResponse:
    """A closed speed loop of 20 Hz, 1.5 ms late, with a resonance, from a loop made by hand.

    apart: Hz from the load's own frequency, where motor and load turn apart, to the resonance.
    """
    f = np.geomspace(1.0, 500.0, 400)
    s = 2j * np.pi * f
    low, high = (2 * np.pi * hertz for hertz in (140.0 - apart, 140.0))
    shape = ((s / low) ** 2 + 0.06 * s / low + 1) / ((s / high) ** 2 + 0.06 * s / high + 1)
    loop = 2 * np.pi * 20.0 / s * np.exp(-1.5e-3 * s) * shape
    return FrequencyResponse(f, loop / (1 + loop), "set-point", "speed")


def test_a_measured_peak_is_found_and_a_notch_takes_it_away() -> None:
    peak = peak_of(peaking())
    assert peak is not None
    found = from_response(peaking())
    assert found is not None
    _, notch, left = found
    assert notch.zero == notch.pole == peak.frequency_hz
    assert left is None or left.db < peak.db - 3.0
    assert from_response(peaking(0.0)) is None
    both = differ(peaking(), peaking())
    done = tune(heavy("empty"), until=2, measured=both)
    assert any("the measured response of drive" in line for line in done.steps[1].done)
    assert done.machine.get("motors.filter_zero") == pytest.approx(peak.frequency_hz)


def test_the_response_with_a_filter_is_that_of_the_simulated_machine() -> None:
    """What a measured response would become, against the core with the filter in it."""
    machine = heavy("550t")
    f = np.geomspace(1.0, 100.0, 60)
    cut = ["position", "equaliser", "speed_2"]

    def speed(one: Machine) -> FrequencyResponse:
        return frequency_response(one, "Omega_1*", "omega_c1", f, modes=closed(one), cut=cut)

    notch = Filter(30.0, 0.5, 30.0, 0.1)
    machine.set("controller.T_N", 0.0)
    filtered = machine.copy()
    notch.on(filtered)
    np.testing.assert_allclose(
        asked_for(speed(machine), notch).response, speed(filtered).response, rtol=1e-6
    )


# --- K_s, DSC, SOFT -------------------------------------------------------------------------------


def test_the_servo_gain_is_formed_and_held_against_the_paper_s() -> None:
    done = tuned("empty")
    (said,) = [line for line in done.steps[4].done if line.startswith("K_s = ")]
    product = done.steps[4].details["servo_gain"]
    assert product["K_s"] == pytest.approx(done.machine.get("controller.K_v"), rel=1e-3)
    assert product["K_1"] * product["K_3"] == pytest.approx(1.0)
    assert "the paper sets 10" in said
    words = " ".join(done.steps[5].done)
    assert "DSC, dynamic stiffness control (MD32640)" in words
    assert "SOFT" in words


@pytest.mark.long
def test_dsc_is_told_by_what_it_would_change() -> None:
    slow = heavy("550t", controller__position_sample=8e-3, controller__speed_sample=125e-6)
    (said,) = [x for x in tune(slow, until=6).steps[5].done if x.startswith("DSC")]
    assert "with the position loop every 8 ms" in said


# --- exports of controls --------------------------------------------------------------------------

ROWS = [(1.0, -0.73, -7.4), (10.0, -0.9, -20.0), (100.0, 3.1, -90.0), (999.0, -34.7, 121.2)]


def test_a_control_s_export_with_its_settings_below_the_table(tmp_path: Path) -> None:
    """The layout of a motion controller's Bode tool: tabs, then what it was measured with."""
    rows = ["\t".join(map(str, row)) for row in ROWS]
    below = ["", "TIMESTAMP: 09/25/03 19:04:15", "SAMPLE RATE: 2000", "Filter[0].Coeff[0] 100.0"]
    lines = ["Freq (Hz)\tAmp0 (dB)\tPhase0 (deg)", *rows, *below]
    path = tmp_path / "bode.txt"
    path.write_text("\n".join(lines))
    found = read_response(path)
    assert found.frequency_hz.tolist() == [row[0] for row in ROWS]
    np.testing.assert_allclose(found.magnitude_db, [row[1] for row in ROWS])
    assert "3 lines below the table left out" in found.note


def test_an_analyser_s_export_with_its_setup_above_and_parts_beside(tmp_path: Path) -> None:
    """The layout of a network analyser: set-up, then both parts beside dB and degrees."""
    rows = []
    for f, db, deg in ROWS:
        z = 10 ** (db / 20) * np.exp(1j * math.radians(deg))
        rows.append(f"{f},{z.real},{z.imag},{db},{z.real},{z.imag},{deg}")
    head = ["---Measurement Setup---", "Device Type: X", "Start Frequency (Hz): 1", "---",
            "Frequency (Hz),TR1: Gain (Real),TR1: Gain (Imag),TR1: Gain (dB),TR2: Gain (Real),"
            "TR2: Gain (Imag),TR2: Gain (Degree)"]  # fmt: skip
    path = tmp_path / "export.csv"
    path.write_text("\n".join([*head, *rows]))
    found = read_response(path)
    np.testing.assert_allclose(found.magnitude_db, [row[1] for row in ROWS])
    assert found.phase_deg[:3].tolist() == pytest.approx([row[2] for row in ROWS[:3]])
    assert found.phase_deg[3] == pytest.approx(ROWS[3][2] - 360.0)  # unwrapped
