"""Jitter of time stamps and skew of channels, against jitter and delays that were put in."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from dualdrive import Machine
from dualdrive.compare import Skew, clock_of, evened, skews
from dualdrive.traces import Trace
from simulated import nominal, record, with_changed


@functools.cache
def sound() -> Trace:
    return record(nominal())


def between(found: list[Skew], *names: str) -> Skew:
    (one,) = [s for s in found if {s.early, s.late} == set(names)]
    return one


# --- jitter ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [2e-4, 1e-3])
def test_jitter_of_stamps_is_told_from_uneven_samples(size: float) -> None:
    trace, random = sound(), np.random.default_rng(2)
    t = np.sort(trace.t + random.normal(0.0, size, len(trace)))
    stamps = clock_of(Trace(t, {c: trace[c] for c in trace}))
    assert stamps.kind == "stamps"
    assert stamps.jitter == pytest.approx(size, rel=0.1)
    assert stamps.step == pytest.approx(5e-3, rel=1e-3)
    moved = Trace(t, {c: np.interp(t, trace.t, trace[c]) for c in trace})
    uneven = clock_of(moved)
    assert uneven.kind in ("samples", "unclear")
    if size > 5e-4:
        assert uneven.kind == "samples"
        assert uneven.wrong == 0.0


def test_an_even_clock_makes_no_noise() -> None:
    clock = clock_of(sound())
    assert (clock.kind, clock.jitter) == ("even", 0.0)
    assert clock.noise(sound().t, sound()["theta_m"]) == 0.0


@pytest.mark.parametrize("samples_are_even", [True, False])
def test_what_evens_a_clock_is_what_names_it(samples_are_even: bool) -> None:
    """A command at constant speed has no roughness at all on the clock that made it."""
    t, random = 1e-2 * np.arange(2000.0), np.random.default_rng(5)
    stamps = t + random.normal(0.0, 5e-4, len(t))
    taken = np.asarray(t if samples_are_even else stamps)
    noisy = random.normal(0.0, 1e-3, len(t))  # an encoder that can't tell
    trace = Trace(stamps, {"theta_ref": 0.2 * taken, "theta_m": 0.2 * taken + noisy})
    kind, (read, jitter) = clock_of(trace).kind, evened(trace)
    if samples_are_even:
        assert kind == "stamps"
        assert jitter == pytest.approx(5e-4, rel=0.1)
        np.testing.assert_allclose(read.t, t, atol=5e-5)
    else:
        assert (kind, jitter, read) == ("samples", 0.0, trace)


def test_noise_of_jitter_is_speed_times_jitter() -> None:
    """A sine of amplitude a at f has an RMS speed of 2 pi f a / sqrt 2."""
    random, n = np.random.default_rng(4), 4000
    even = 1e-2 * np.arange(n)
    sine = 0.3 * np.sin(2 * np.pi * 0.7 * even)
    t = even + random.normal(0.0, 1e-3, n)
    clock = clock_of(Trace(t, {"theta_m": sine}))
    expected = 1e-3 * 2 * np.pi * 0.7 * 0.3 / np.sqrt(2.0)
    assert clock.noise(t, sine) == pytest.approx(expected, rel=0.15)


# --- skew -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("late", [0.5e-3, 2e-3, 12e-3])
def test_a_late_table_encoder_is_found_by_both_drives(late: float) -> None:
    trace = sound()
    shifted = np.interp(trace.t - late, trace.t, trace["theta_m"])
    found = skews(nominal(), with_changed(trace, theta_m=shifted))
    for drive in ("theta_1", "theta_2"):
        skew = between(found, "theta_m", drive)
        assert skew.significant or late < 1e-3
        assert skew.late == "theta_m"
        assert skew.seconds == pytest.approx(late, abs=5e-5)


def test_it_is_told_what_two_encoders_part_by_with_a_delay_and_without() -> None:
    """12 ms of a moving table are more than all its shafts and meshes twist."""
    trace, late = sound(), 12e-3
    shifted = np.interp(trace.t - late, trace.t, trace["theta_m"])
    before = between(skews(nominal(), trace), "theta_m", "theta_1")
    after = between(skews(nominal(), with_changed(trace, theta_m=shifted)), "theta_m", "theta_1")
    speed = np.gradient(trace["theta_m"], trace.t)
    assert after.apart == pytest.approx(late * float(np.std(speed)), rel=0.05)
    assert after.left == pytest.approx(before.apart, rel=0.3)
    share = f"{1.0 - after.left / after.apart:.0%}"
    assert f"it makes {share} of what they part by" in after.message


def test_a_delay_that_the_machine_knows_is_told_no_more() -> None:
    trace, machine = sound(), nominal()
    machine.add("sensor_delay", "theta_m", time=6e-3)
    late = np.interp(trace.t - 6e-3, trace.t, trace["theta_m"])
    found = skews(machine, with_changed(trace, theta_m=late))
    assert between(found, "theta_1", "theta_m").seconds < 1e-4
    assert not any(s.significant for s in found)


def test_a_late_motor_encoder_is_found_alone() -> None:
    trace = sound()
    late = np.interp(trace.t - 4e-3, trace.t, trace["theta_2"])
    found = skews(nominal(), with_changed(trace, theta_2=late))
    assert between(found, "theta_2", "theta_m").late == "theta_2"
    assert between(found, "theta_2", "theta_m").significant
    assert not between(found, "theta_1", "theta_m").significant


def test_a_late_torque_is_found() -> None:
    """On one body the torque follows the motion at once; it is read 12 ms late."""
    machine = Machine.load("linear-axis")
    machine.core.set_controller("none")
    t = np.asarray(2e-3 * np.arange(10000), dtype=np.float64)
    random = np.random.default_rng(6)
    speed = sum(
        a * np.sin(2 * np.pi * f * t + f) for a, f in ((0.1, 0.7), (0.06, 1.3), (0.04, 2.9))
    )
    angle = np.cumsum(speed) * 2e-3
    rate = np.gradient(speed, t)
    force = 95.0 * rate + 200.0 * speed + 20.0 * np.sign(speed) + random.normal(0.0, 1.0, len(t))
    for late in (0.0, 0.012):
        read = np.asarray(np.interp(t - late, t, force), dtype=np.float64)
        skew = between(skews(machine, Trace(t, {"theta_m": angle, "T_1": read})), "T_1", "theta_m")
        if late:
            assert skew.significant
            assert skew.late == "T_1"
            assert skew.seconds == pytest.approx(late, rel=0.1)
        else:
            assert not skew.significant


@pytest.mark.parametrize(
    "change",
    [
        {"meshes.stiffness": 4e6},
        {"table.b": 2e6},
        {"meshes.gap": 2e-3},
    ],
    ids=lambda c: next(iter(c)),
)
def test_compliance_friction_and_play_are_no_skew(change: dict[str, float]) -> None:
    machine = nominal()
    for path, value in change.items():
        machine.set(path, value)
    assert not any(s.significant for s in skews(nominal(), record(machine)))
