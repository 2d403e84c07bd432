"""Recordings of real machines through their mappings (examples/*.map.toml, maps/*.toml).

Row numbers and counts below were taken from the files with an editor and awk; physical bounds come
from the descriptions that lie beside the data.
"""

from __future__ import annotations

import math
import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dualdrive.traces import Trace, TraceError, TraceMap, guess_mapping, read, read_mapping
from dualdrive.traces.mapping_file import mapping_from
from dualdrive.traces.rates import rate_ratio

MAPS = Path(__file__).parent / "maps"
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
BESIDE = Path(__file__).resolve().parents[3] / "shared" / "data"


def measured_file(name: str) -> Path:
    """A file below the folder of measured data; the test skips where it is absent."""
    path = Path(os.environ.get("DUALDRIVE_DATA", BESIDE)) / name
    if not path.exists():
        pytest.skip(f"measured data is not here: {path} (DUALDRIVE_DATA names its folder)")
    return path


def mapping_of(machine: str) -> Path:
    """The mapping that is shipped as an example, or the tests' own."""
    shipped = EXAMPLES / f"{machine}.map.toml"
    return shipped if shipped.exists() else MAPS / f"{machine}.toml"


def recording(data: str, machine: str) -> Trace:
    return read(measured_file(data), mapping_of(machine))


def ratio(trace: Trace, theta: str, omega: str) -> float | None:
    return rate_ratio(trace.t, trace[theta], trace[omega], np.array(trace.breaks, dtype=np.int64))


# --- two motors on one ring ----------------------------------------------------------------------


def test_rig_parts_are_the_tests_with_tension_off_and_on() -> None:
    trace = recording("dual_motor_rig/log10.csv", "dual_motor_rig")
    parts = trace.split()
    settings = [(part.labels["TestIndex"], part.labels["AntiBacklashEnabled"]) for part in parts]
    assert settings == [(test, tension) for test in (1, 2, 3, 4) for tension in (0, 1)]
    # the mode of the fourth test is that of the third: it is changed only after the test has ended
    assert [part.labels["AntiBacklashMode"] for part in parts] == [4, 4, 4, 4, 5, 5, 5, 5]
    for part in parts:
        assert 46 < part.duration < 47
        assert part.breaks == ()
        assert set(part["Running"]) == {1.0}


def test_rig_setting_changed_in_the_middle_of_a_test() -> None:
    parts = recording("dual_motor_rig/log12.csv", "dual_motor_rig").split()
    assert [part.labels["BaseTorque"] for part in parts] == [3.8, 3.8, 3.0]
    assert [part.labels["AntiBacklashEnabled"] for part in parts] == [0, 1, 1]
    assert all(before.rows[-1] < after.rows[0] for before, after in pairwise(parts))


def test_rig_counters_are_set_back_between_tests() -> None:
    path = measured_file("dual_motor_rig/log10.csv")
    mapping = read_mapping(mapping_of("dual_motor_rig"))
    everything = TraceMap(time=mapping.time, columns=mapping.columns)
    trace = read(path, everything)
    assert trace.log["reset"][0].rows[-3:] == (7657, 14901, 22560)  # where TestIndex changes
    denormal = {row for issue in trace.log["denormal"] for row in issue.rows}
    assert {4, 5, 6, 7} <= denormal  # FC3Position before the first test
    assert max(denormal) == 33492
    # of the start-up rows, four stand alone between pauses of up to 31.6 s; without them the time
    # from row 5 (14:15:27.757) to row 8 (14:16:02.922) is one pause
    assert trace.log["lone_row"][0].rows == (6, 7, 10, 11)
    assert trace.log["gap"][0].rows == (8, 12)
    assert "35.16 s" in trace.log["gap"][0].message


@pytest.mark.parametrize("log", ["log10", "log12"])
def test_rig_units_and_signs_agree(log: str) -> None:
    trace = recording(f"dual_motor_rig/{log}.csv", "dual_motor_rig")
    assert "rates" not in trace.log
    ring = ratio(trace, "theta_m", "omega_m")
    assert ring is not None
    assert ring == pytest.approx(1.0, abs=0.03)
    for drive in "12":
        own = ratio(trace, f"theta_c{drive}", f"omega_c{drive}")
        assert own is not None
        assert own == pytest.approx(1.07, abs=0.02)  # the drives' speed readings are low
    # without tension the brake has to be overcome by both motors: each gives power to the ring
    free = next(part for part in trace.split() if part.labels["AntiBacklashEnabled"] == 0)
    for motor in ("T_1", "T_2"):
        assert np.mean(free[motor] * free["omega_m"]) > 1.0


def test_rig_play_is_tens_of_degrees() -> None:
    free, tense = recording("dual_motor_rig/log10.csv", "dual_motor_rig").split()[:2]
    play = [np.ptp(np.degrees(p.difference("theta_c1", "theta_m"))) for p in (free, tense)]
    assert 20 < play[0] < 180
    assert np.isfinite(play[1])


def test_rig_in_rpm_is_found_out() -> None:
    mapping = read_mapping(mapping_of("dual_motor_rig")).as_dict()
    mapping["columns"]["ENC1Speed"]["unit"] = "rpm"
    trace = read(measured_file("dual_motor_rig/log10.csv"), mapping_from(mapping))
    assert "theta_m" in trace.log["rates"][0].message
    with pytest.raises(TraceError):
        read(measured_file("dual_motor_rig/log10.csv"), mapping_from(mapping), strict=True)


def test_rig_guess_finds_units_and_directions() -> None:
    mapping = guess_mapping(measured_file("dual_motor_rig/log10.csv"))
    rule = mapping.columns["ENC1Position"]
    assert (rule.channel, rule.unit, rule.sign) == ("theta_m", "deg", -1)
    assert mapping.columns["ENC1Speed"].unit == "rad/s"
    assert mapping.columns["FC2Torque"].channel == "T_2"


# --- linear axis ---------------------------------------------------------------------------------


def smoothed(values: NDArray[np.float64], width: int = 21) -> NDArray[np.float64]:
    """Weighted mean over 21 ms, without delay."""
    window = np.hanning(width)
    return np.convolve(values, window / window.sum(), mode="same")


def test_emps() -> None:
    trace = recording("emps/DATA_EMPS.mat", "emps")
    assert len(trace) == 24841
    assert trace.step == pytest.approx(1e-3, rel=1e-4)
    assert not trace.log.issues
    assert trace.constants["gtau"] == pytest.approx(35.15065)
    # published: mass 95.109 kg, viscous 203.50 N s/m, Coulomb 20.39 N, offset -3.165 N, and a
    # residual of 4.08 % of the force; here without any fit, so that scale and signs must be right
    speed = np.gradient(smoothed(trace["theta_m"]), trace.t)
    friction = smoothed(np.sign(speed))
    force = 95.109 * np.gradient(speed, trace.t) + 203.50 * speed + 20.39 * friction - 3.165
    measured = smoothed(trace["T_1"])
    inner = slice(100, -100)
    left = np.sqrt(np.mean((measured - force)[inner] ** 2) / np.mean(measured[inner] ** 2))
    assert left == pytest.approx(0.0408, abs=0.004)


# --- robot axes ----------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", [1, 2, 3])
def test_kuka(axis: int) -> None:
    # the shipped mapping of axis 1 calls the motor by its name; these refer it to the joint
    trace = read(measured_file("kuka_kr300/derived_rec_A.csv"), MAPS / f"kuka_axis{axis}.toml")
    assert len(trace) == 2501
    assert trace.duration == pytest.approx(10.0)
    assert trace.canonical == ("theta_ref", "theta_c1", "omega_c1", "T_1", "theta_m", "omega_m")
    assert not trace.log.issues
    for theta, omega in (("theta_c1", "omega_c1"), ("theta_m", "omega_m")):
        assert ratio(trace, theta, omega) == pytest.approx(1.0, abs=0.02)
    apart = np.degrees(trace.difference("theta_c1", "theta_m"))
    assert 0.02 < np.ptp(apart) < 1.0  # gears twist by hundredths of a degree, not by degrees


# --- small servos --------------------------------------------------------------------------------


def test_servos_coupled() -> None:
    trace = recording("dual_sts3215_backlash/motor_telemetry_nocomp2.csv", "sts3215_coupled")
    assert trace.log["missing"][0].rows == (2,)  # all but the targets are empty there
    assert trace.rows[0] == 3
    assert trace.source.start == "2025-11-12T09:53:06.117000Z"
    assert trace.step == pytest.approx(0.101)
    counts = trace["theta_c1"] * 4096 / (2 * math.pi) + 2048
    np.testing.assert_allclose(counts[:2], [2045, 2014])
    speed = trace["omega_c2"] * 4096 / (2 * math.pi)
    np.testing.assert_allclose(speed[:2], [0, -400])  # raw 400 of a mirrored servo
    np.testing.assert_allclose(trace["omega_c1"][1] * 4096 / (2 * math.pi), -350)  # raw 33118
    # both servos hold one lever: with the second one's sign they move together
    assert np.corrcoef(trace["theta_c1"], trace["theta_c2"])[0, 1] > 0.99
    apart = trace.difference("theta_c1", "theta_c2")
    assert np.degrees(np.ptp(apart)) < 5


def test_servo_single() -> None:
    trace = recording("dual_sts3215_backlash/motor_telemetry_single.csv", "sts3215_single")
    assert len(trace) == 273
    assert "missing" not in trace.log
    assert np.degrees(np.abs(trace["theta_ref"]).max()) == pytest.approx(101 / 4096 * 360)
    assert np.abs(trace["duty_1"]).max() <= 1
    assert np.corrcoef(trace["omega_c1"], np.gradient(trace["theta_c1"], trace.t))[0, 1] > 0.85
