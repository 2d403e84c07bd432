"""Records in order raise no warning; each way to spoil one raises its own."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from dualdrive import Machine, parse_motion, simulate
from dualdrive.compare import RecordWarning, check_records
from dualdrive.replay import core_of, ratio_to_table
from dualdrive.traces import Trace, read
from measured import EXAMPLES, emps, measured_file, rig
from recorded import Array, demo, sheet
from simulated import nominal, record, with_changed


@functools.cache
def sound() -> Trace:
    return record(nominal())


def codes(trace: Trace, mode: str = "closed_loop") -> dict[str, RecordWarning]:
    return {w.code: w for w in check_records(nominal(), trace, mode)}


def spoilt(**channels: Array) -> dict[str, RecordWarning]:
    return codes(with_changed(sound(), **channels))


# --- records in order -----------------------------------------------------------------------------


def test_sound_records_raise_nothing() -> None:
    assert codes(sound()) == {}
    assert check_records(sheet(), [demo("fit"), demo("held_out")], "closed_loop") == []


def test_a_pause_is_no_motion() -> None:
    """Across it an angle jumps: taken for a speed, that left no other motion worth the name."""
    whole = sound()
    cut = len(whole) // 4
    kept = np.r_[0:cut, 2 * cut : len(whole)]
    columns = {c: whole[c][kept] for c in whole}
    t = whole.t[kept]
    t[cut:] -= t[cut] - t[cut - 1] - 2e-3  # a short pause, a long way
    assert codes(Trace(t, columns, breaks=(cut,))).keys() <= {"jitter"}


def test_the_linear_axis_raises_nothing() -> None:
    assert check_records(Machine.load(EXAMPLES / "emps.toml"), emps(), "closed_loop") == []


def test_of_a_real_robot_only_the_late_encoder_is_told() -> None:
    """2.8 ms on three axes alike (docs/howto/real-data.md): no spring does that."""
    path = measured_file("kuka_kr300/derived_rec_A.csv")
    trace = read(path, EXAMPLES / "kuka_axis1.map.toml")
    (told,) = check_records(Machine.load(EXAMPLES / "kuka.toml"), trace)
    assert (told.code, told.fatal) == ("skew", False)
    assert "theta_m lags theta_1 by 2.8" in told.message


@pytest.mark.parametrize("log", ["log10", "log12"])
def test_of_a_real_rig_only_the_late_drives_are_told(log: str) -> None:
    """The play of its meshes, estimated apart, finds 29 and 33 ms as well."""
    told = check_records(Machine.load(EXAMPLES / "dual_motor_rig.toml"), rig(log))
    assert {w.code for w in told} <= {"skew", "one_way"}
    assert not any(w.fatal for w in told)
    assert all("theta_c" in w.message for w in told if w.code == "skew")


# --- what is spoilt -------------------------------------------------------------------------------


def test_exchanged_channels() -> None:
    trace = sound()
    told = spoilt(I_1=trace["I_2"], I_2=trace["I_1"])["swapped"]
    assert told.fatal
    assert "torques (or currents) of motors 1 and 2" in told.message
    told = spoilt(theta_1=trace["theta_2"], theta_2=trace["theta_1"])["swapped"]
    assert "theta_1 and theta_2 look exchanged" in told.message
    told = spoilt(theta_1=trace["theta_m"], theta_m=trace["theta_1"])["swapped"]
    assert "theta_1 and theta_m look exchanged" in told.message


@pytest.mark.parametrize("channel", ["I_1", "I_2", "theta_1", "theta_2", "theta_m"])
def test_a_flipped_sign(channel: str) -> None:
    told = spoilt(**{channel: -sound()[channel]})["sign"]
    assert told.fatal
    assert told.message.startswith("record: ")
    assert "sign = -1" in told.message


def test_both_currents_flipped() -> None:
    assert "both their signs" in spoilt(I_1=-sound()["I_1"], I_2=-sound()["I_2"])["swapped"].message


def test_wrong_units_and_frames() -> None:
    told = spoilt(theta_1=np.degrees(sound()["theta_1"]))["ratio"]
    assert "degrees" in told.message
    told = spoilt(theta_2=sound()["theta_2"] / 3000.0)["ratio"]
    assert "referred to the table already" in told.message
    told = spoilt(I_1=sound()["I_1"] / 100.0, I_2=sound()["I_2"] / 100.0)["scale"]
    assert "0.01 times" in told.message
    assert "command" in spoilt(theta_ref=np.degrees(sound()["theta_ref"]))


def test_friction_that_a_machine_lacks_is_no_wrong_unit() -> None:
    """Slow turning takes little but friction: five times what the data sheet needs, and sound."""
    machine = Machine.load("bench")
    machine.add("coulomb", "table", torque=0.7)
    run = simulate(machine, parse_motion("cycle:0;6;0,v=1,a=0.2,j=2,dwell=0.2"), end=25.0)
    t = np.arange(0.0, 25.0, 1e-3)
    names = ("theta_ref", "theta_m", "theta_1", "theta_2", "I_1", "I_2")
    seen = {name: np.interp(t, run.t, run[name]) for name in names}
    sheet = Machine.load("bench")
    told = {w.code: w for w in check_records(sheet, Trace(t, seen, name="record"))}
    assert "scale" not in told
    assert not told["friction"].fatal
    for name in ("I_1", "I_2"):
        seen[name] = 1e3 * seen[name]
    assert {w.code: w for w in check_records(sheet, Trace(t, seen, name="record"))}["scale"].fatal


def test_another_machine() -> None:
    told = {w.code: w for w in check_records(Machine.load("bench"), sound())}["ratio"]
    assert told.fatal
    assert "not 40 times" in told.message


def test_a_drive_that_rings_on_its_teeth_belongs_to_its_table() -> None:
    """From stretch to stretch it goes ways of its own; where it is says that it belongs there."""
    trace, core = sound(), core_of(nominal())
    play = core.get("mesh_1.gap") / core.get("mesh_1.ratio")
    swings = ratio_to_table(core, "motor_1") * 10.0 * play * np.sin(2.0 * np.pi * 17.0 * trace.t)
    assert "ratio" not in spoilt(theta_1=trace["theta_1"] + swings)
    far = 100.0 * swings
    assert "do not move together" in spoilt(theta_1=trace["theta_1"] + far)["ratio"].message


def test_clipped_channels() -> None:
    current, angle = sound()["I_1"], sound()["theta_m"]
    told = spoilt(I_1=np.minimum(current, np.quantile(current, 0.97)))["clipped"]
    assert "I_1 stands at" in told.message
    told = spoilt(theta_m=np.minimum(angle, 0.015))["clipped"]
    assert told.fatal
    assert "theta_m" in told.message


def test_dead_channels_and_records() -> None:
    trace = sound()
    told = spoilt(I_2=np.full(len(trace), 3.0))["constant"]
    assert "I_2 reads 3 throughout" in told.message
    random = np.random.default_rng(3)
    rest = {c: random.normal(0.0, 1e-6, len(trace)) for c in ("theta_m", "theta_1", "theta_2")}
    assert spoilt(**rest)["still"].fatal
    assert codes(trace.between(0.0, 0.9))["short"].fatal
    for few in (2, 3, 17):
        told = codes(trace.take(slice(few)))["short"]
        assert told.fatal
        assert f"{few} samples are too few" in told.message
        assert "record longer, at least 200" in told.message
    one_way = codes(trace.between(0.0, 4.0))["one_way"]
    assert not one_way.fatal
    assert "record a way back" in one_way.message


def test_a_late_channel() -> None:
    trace = sound()
    late = np.interp(trace.t - 0.006, trace.t, trace["theta_m"])
    told = spoilt(theta_m=late)["skew"]
    assert "theta_m lags" in told.message
    assert "compliance" in told.message


def test_a_jittering_clock() -> None:
    trace, random = sound(), np.random.default_rng(5)
    t = np.sort(trace.t + random.normal(0.0, 8e-4, len(trace)))
    told = codes(Trace(t, {c: trace[c] for c in trace}, name="record"))["jitter"]
    assert "sample_time" in told.message
