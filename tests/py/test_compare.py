"""Comparison of a machine with traces: against an independent model, closed forms, a real rig."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from dualdrive import Machine, parse_motion, simulate
from dualdrive.compare import Comparison, compare
from dualdrive.replay import ReplayError
from dualdrive.traces import Trace
from measured import emps
from recorded import clean, demo, emps_rig, long_move, maker, relative, sheet

HEADLINE = {"e", "x_1", "x_2", "I_1", "I_2"}


@pytest.fixture(scope="module")
def agreeing() -> Comparison:
    return compare(sheet(torque=12000.0), clean(), offsets="none")


# --- the figures ----------------------------------------------------------------------------------


def test_the_machine_behind_an_independent_model_agrees_with_it(agreeing: Comparison) -> None:
    assert set(agreeing.names) >= HEADLINE
    for channel in agreeing.channels:
        assert channel.error < 1e-4, channel.name


def test_error_is_rms_residual_over_rms_of_the_mean_free_signal() -> None:
    """A sine of known amplitude on one current is all that is wrong."""
    trace, amplitude = clean(), 0.5
    off = trace["I_1"] + amplitude * np.sin(2 * np.pi * 3.0 * trace.t)
    found = compare(sheet(torque=12000.0), trace.with_channel("I_1", off))
    assert found.error["I_1"] == pytest.approx(amplitude / math.sqrt(2) / np.std(off), rel=1e-3)
    assert found.error["I_2"] < 1e-3
    assert found["I_1"].rms == pytest.approx(amplitude / math.sqrt(2), rel=1e-3)


def test_headline_averages_kinds_and_leaves_absolute_angles_out(agreeing: Comparison) -> None:
    found = compare(sheet(), demo("fit"))
    error = found.error
    kinds = [error["e"], (error["I_1"] + error["I_2"]) / 2, (error["x_1"] + error["x_2"]) / 2]
    assert error["headline"] == pytest.approx(np.mean(kinds))
    assert {c.name for c in found.channels if c.headline} == HEADLINE
    assert error["theta_m"] < 1e-3 < error["headline"], "an absolute angle fits whatever is missing"


def test_deflection_is_motor_over_ratio_minus_table_times_ratio(agreeing: Comparison) -> None:
    trace = clean()
    measured = trace["theta_1"] / 150.0 - 20.0 * trace["theta_m"]
    np.testing.assert_allclose(agreeing["x_1"].measured, measured, atol=1e-15)


def test_several_records_are_pooled() -> None:
    one, two = demo("fit"), demo("held_out")
    both = compare(sheet(), {"a": one, "b": two})
    left = [(both[name, "I_1"].residual, both[name, "I_1"].measured) for name in "ab"]
    pooled = math.sqrt(
        sum(np.sum(r**2) for r, _ in left) / sum(np.var(m) * len(m) for _, m in left)
    )
    assert both.records == ("a", "b")
    assert both.error["I_1"] == pytest.approx(pooled)


# --- what belongs to a record -----------------------------------------------------------------


def test_constants_of_sensors_are_found_and_told() -> None:
    trace = clean()
    trace = trace.with_channel("I_1", trace["I_1"] + 0.7)
    trace = trace.with_channel("theta_2", trace["theta_2"] - 0.03)
    found = compare(sheet(torque=12000.0), trace)
    assert found.error["headline"] < 1e-3
    assert found["I_1"].offset == pytest.approx(0.7, rel=1e-3)
    assert found["x_2"].offset == pytest.approx(-0.03 / 150.0, rel=1e-2)
    assert compare(sheet(torque=12000.0), trace, offsets="encoders").error["I_1"] > 0.05


def test_a_late_recorder_is_no_late_sensor() -> None:
    """The delay sits at the recorded channel, so that the loop does not feel it."""
    trace, late = clean(), 0.02
    shifted = np.interp(trace.t - late, trace.t, trace["theta_1"])
    skewed = trace.with_channel("theta_1", shifted)
    machine = sheet(torque=12000.0)
    assert compare(machine, skewed).error["x_1"] > 0.2
    machine.add("sensor_delay", "theta_1", time=late)
    found = compare(machine, skewed)
    assert found.error["x_1"] < 0.02
    assert found.error["e"] < 1e-4
    machine.add("sensor_offset", "I_2", value=0.4)
    offset = compare(machine, skewed, offsets="encoders")["I_2"]
    assert np.mean(offset.residual) == pytest.approx(0.4, rel=1e-3)


def test_a_record_that_begins_braced_starts_from_a_settled_loop() -> None:
    late = clean().between(1.4, 18.0)
    found = compare(sheet(torque=12000.0), late)
    assert found.starts == {"clean": "settled"}
    assert found.error["headline"] < 0.01
    assert compare(sheet(torque=12000.0), late, start="rest").error["headline"] > 0.05
    assert compare(sheet(torque=12000.0), clean()).starts == {"clean": "rest"}


def begun_at(machine: Machine, begin: float, rms: float, **initial: float) -> Trace:
    """What the machine itself records from `begin` on, before which its command stood still."""
    motion = parse_motion(f"move:0.02,v=0.02,a=0.012,j=0.05,start={begin + 1.5}")
    run = simulate(machine, motion, end=begin + 7.0, initial=initial)
    random = np.random.default_rng(0)
    t = np.arange(begin, begin + 7.0, 5e-3)
    names = ("theta_ref", "theta_m", "theta_1", "theta_2", "I_1", "I_2")
    channels = {name: np.interp(t, run.t, run[name]) for name in names}
    channels["theta_m"] += random.normal(0.0, rms, len(t))
    return Trace(t - begin, channels, name="own")


@pytest.mark.parametrize("K_v", [1.0, 4.8])
def test_a_loop_gets_the_time_that_it_needs_to_settle(K_v: float) -> None:
    """Twenty times the controller's own times are 2 s; position loop and equaliser want ten."""
    machine = sheet()
    machine.set("controller.K_v", K_v)
    machine.core.set_controller("master_slave", equaliser="slave")
    found = compare(machine, begun_at(machine, 40.0, 0.0), start="settled")
    assert found.error["headline"] < 1e-5


@pytest.mark.parametrize("tension", [0.0, 28.0])
def test_the_angle_at_the_first_sample_is_an_unknown_with_its_noise(tension: float) -> None:
    """A mean of five noisy samples taken for it stayed wrong to the end, where friction holds."""
    machine, rms = sheet(torque=6000.0), 1.5e-7
    machine.set("controller.T_ten", tension)
    found = compare(machine, begun_at(machine, 0.0, rms, theta_m=2e-5), start="rest")
    assert found.initial["own", "theta_m"] == pytest.approx(2e-5, abs=0.2 * rms)
    left = found["e"].residual / rms
    for part in np.array_split(left, 8):
        assert np.sqrt(np.mean(part**2)) == pytest.approx(1.0, abs=0.15)
    assert found.error["I_1"] < 1e-3


def test_a_pause_makes_two_records() -> None:
    trace = demo("fit")
    cut = trace.take((trace.t < 8.0) | (trace.t > 8.4))
    assert compare(sheet(), cut).records == ("fit (1)", "fit (2)")


# --- where ----------------------------------------------------------------------------------------


def test_where_names_the_stretch_and_the_direction_that_are_wrong() -> None:
    trace = clean()
    forward = np.gradient(trace["theta_ref"], trace.t) > 1e-3
    wrong = trace.with_channel("I_1", trace["I_1"] + 2.0 * forward * np.sin(40.0 * trace.t))
    found = compare(sheet(torque=12000.0), wrong, offsets="none")
    excess = {c.condition: c.excess for c in found.where}
    assert excess["forward"] > 1.3 > 0.2 > excess["backward"]
    share = {c.condition: c.square for c in found.where}
    assert share["forward"] > 0.95


# --- a real rig -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rig() -> Trace:
    return emps()


def test_published_values_meet_the_linear_axis(rig: Trace) -> None:
    """M 95.109, Fv 203.50, Fc 20.39, offset -3.165 N (Janot et al. 2019): some 5 % of the force."""
    found = compare(emps_rig(20.39), rig)
    force = found["T_1"]
    assert found.mode == "closed_loop"
    assert force.unit == "N"
    assert np.sqrt(np.mean(force.residual**2) / np.mean(force.measured**2)) < 0.055
    assert force.offset == pytest.approx(-3.165, abs=0.1)


def test_without_its_controller_the_same_rig_closes_the_torque_balance(rig: Trace) -> None:
    """4.08 % of RMS force in the publication."""
    found = compare(emps_rig(20.39), rig.without("theta_ref"))
    assert found.mode == "balance"
    assert found.error["headline"] == pytest.approx(0.0408, abs=0.003)
    without = compare(emps_rig(None), rig.without("theta_ref"))
    assert without.error["headline"] > 0.3


# --- noise floor ----------------------------------------------------------------------------------


def test_noise_floor_of_the_demo_is_near_the_noise_that_was_put_in() -> None:
    noise = maker.truth()["noise"]
    found = compare(sheet(), demo("fit"))
    assert found["I_1"].noise.rms == pytest.approx(noise["I_1"]["rms"], rel=0.25)
    assert found["e"].noise.rms == pytest.approx(noise["theta_m"]["rms"] * maker.ARCSEC, rel=0.25)
    floor = relative(found["I_1"].noise.rms, found["I_1"].measured)
    assert next(c for c in found.channels if c.name == "I_1").noise_floor == pytest.approx(floor)


# --- faces and refusals ---------------------------------------------------------------------------


def test_table_json_html_and_csv_say_the_same(agreeing: Comparison) -> None:
    found = compare(sheet(), demo("fit"))
    figures = json.loads(found.to_json())
    assert figures["error"]["headline"] == pytest.approx(found.error["headline"])
    assert f"{found.error['headline']:.2%}" in found.table()
    assert f"{found.error['headline']:.2%}" in found._repr_html_()
    head, first, *rest = found.to_csv().splitlines()
    assert head.startswith("record,t [s],e measured [rad],e simulated [rad]")
    assert len(rest) == len(demo("fit")) - 1
    assert float(first.split(",")[2]) == pytest.approx(found["e"].measured[0], rel=1e-9)


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        ({}, {"mode": "open_loop"}, "closed_loop"),
        ({}, {"start": "cold"}, "settled"),
        ({}, {"interpolation": "quintic"}, "cubic"),
        ({}, {"offsets": "some"}, "encoders"),
        ({"without": "theta_ref"}, {"mode": "closed_loop"}, "record theta_ref"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(
    change: dict[str, str], options: dict[str, str], words: str
) -> None:
    trace = clean()
    if change:
        trace = trace.without(change["without"])
    with pytest.raises(ValueError, match=words) as refusal:
        compare(sheet(), trace, **options)  # type: ignore[arg-type]
    assert "\n" not in str(refusal.value)


def test_a_trace_with_nothing_to_compare_is_refused() -> None:
    trace = clean()
    only = trace.without(*[name for name in trace if name != "theta_ref"])
    with pytest.raises(ReplayError, match="theta_ref"):
        compare(sheet(), only, mode="closed_loop")


def test_without_a_controller_the_loop_cannot_be_closed() -> None:
    machine = Machine.load("linear-axis")
    machine.core.set_controller("none")
    with pytest.raises(ReplayError, match="torque balance"):
        compare(machine, clean(), mode="closed_loop")


def test_a_record_that_begins_at_constant_speed_follows_the_line_before_it() -> None:
    trace = long_move().between(4.3, 8.0)
    assert np.ptp(np.diff(trace["theta_ref"])[:50]) < 1e-9, "not at constant speed"
    found = compare(sheet(torque=12000.0), trace)
    assert found.starts == {"clean": "settled"}
    assert found.error["headline"] < 0.03
    assert any("begins in motion" in note for note in found.notes)
    assert compare(sheet(torque=12000.0), trace, start="rest").error["headline"] > 0.3


def test_stretches_too_short_to_play_are_told() -> None:
    trace = demo("fit")
    found = compare(sheet(), trace.take((trace.t < 9.0) | ((trace.t > 9.5) & (trace.t < 9.55))))
    assert found.records == ("fit",)
    assert "fit: 4 samples in stretches too short to play left out" in found.notes
