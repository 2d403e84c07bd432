"""Motions: what the words mean, and that they say the same thing again."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dualdrive import Motion, parse_motion
from dualdrive.motion import MotionError, cycle, move, multisine, sampled, shuttle, sine

ARCSEC = math.pi / 648000


def at(motion: Motion, *times: float) -> list[float]:
    return [float(motion.waveform.value(t)) for t in times]


def test_a_move_keeps_its_limits_and_arrives() -> None:
    m = move(0.02, v=0.03, a=0.01, j=0.05, start=2)
    t = np.linspace(0, m.end, 200001)
    assert at(m, 0.0, 2.0, m.end) == pytest.approx([0, 0, 0.02], abs=1e-15)
    assert np.abs(m.waveform.rate(t)).max() <= 0.03
    assert np.abs(m.waveform.acceleration(t)).max() == pytest.approx(0.01, rel=1e-6)
    # acceleration reaches its limit, speed does not: T = a/j + sqrt((a/j)² + 4 d/a)
    travel = 0.2 + math.sqrt(0.2**2 + 4 * 0.02 / 0.01)
    assert m.waveform.end() == pytest.approx(2 + travel, rel=1e-12)
    assert m.end == pytest.approx(m.waveform.end() + 5)


def test_words_with_units() -> None:
    m = parse_motion("move:-1deg,v=2deg/s,a=1deg/s^2,start=100ms,settle=2")
    assert at(m, 60.0) == pytest.approx([-math.radians(1)], rel=1e-14)
    # a trapezoid that never reaches 2°/s: two halves of sqrt(d/a)
    assert m.waveform.end() == pytest.approx(0.1 + 2 * math.sqrt(1.0), rel=1e-12)


def test_a_step_a_sine_a_cycle_a_multisine() -> None:
    assert at(parse_motion("step:20arcsec,at=3"), 2.99, 3.0) == pytest.approx([0, 20 * ARCSEC])
    assert at(sine(1e-3, f=2), 0.125) == pytest.approx([1e-3])
    there = cycle([0.1, -0.1], v=0.5, a=1.0, dwell=2.0)
    first = 2 * math.sqrt(0.1)
    assert at(there, first + 1.0, there.end) == pytest.approx([0.1, -0.1])
    m = multisine(1e-3, f=0.5, lines=8, seed=3)
    t = np.arange(0, 2.0, 1e-3)
    spectrum = np.abs(np.fft.rfft(m.waveform.value(t)))[1:20]
    assert np.flatnonzero(spectrum > 0.1).tolist() == [2 * k for k in range(8)]  # 1, 3, … 15
    assert at(m, 0.0) == pytest.approx([0], abs=1e-15)


def test_a_shuttle_goes_there_and_back_at_each_speed() -> None:
    m = shuttle(0.5, [0.1, 0.2], a=1.0, dwell=2.0, start=1.0)
    slow, fast = 0.5 / 0.1 + 0.1, 0.5 / 0.2 + 0.2  # d/v + v/a
    turns = [1 + slow + 1.0, 3 + 2 * slow + 1.0, 5 + 2 * slow + fast + 1.0, m.end]
    assert at(m, *turns) == pytest.approx([0.5, 0.0, 0.5, 0.0], abs=1e-12)
    assert m.end == pytest.approx(1 + 2 * slow + 2 * fast + 4 * 2.0)
    rate = np.abs(m.waveform.rate(np.linspace(0, m.end, 100001)))
    assert rate[: int(1e5 * (3 + 2 * slow) / m.end)].max() == pytest.approx(0.1)
    assert rate.max() == pytest.approx(0.2)


def test_a_multisine_grows_from_level_to_level_where_it_is_zero() -> None:
    one, two = multisine(1e-3, 0.5, lines=5), multisine(1e-3, 0.5, lines=5, levels=[1.0, 3.0])
    t = np.linspace(0, 6.0, 1001, endpoint=False)
    assert two.end == pytest.approx(2 * one.end) == 12.0
    assert two.waveform.value(t) == pytest.approx(one.waveform.value(t), abs=1e-15)
    assert two.waveform.value(t + 6.0) == pytest.approx(3 * one.waveform.value(t), abs=1e-12)


def test_a_linear_axis_moves_in_metres() -> None:
    m = parse_motion("move:20mm,v=0.5m/s,a=1m/s^2,j=30m/s^3", axis="linear")
    assert at(m, m.end) == pytest.approx([0.02])
    with pytest.raises(MotionError, match="deg does not measure m"):
        parse_motion("move:2deg,v=0.5,a=1", axis="linear")


MOTIONS = [
    "move:0.02,v=0.03,a=0.01,j=0.05,start=2.0",
    "move:0.02,v=0.03,a=0.01",
    "cycle:0.1;0.2;0.0,v=0.5,a=1.0,j=20.0,dwell=0.3,repeats=4",
    "step:0.001,at=3.0,end=20.0",
    "sine:0.001,f=2.0,phase=0.5,periods=3.0",
    "multisine:0.001,f=0.5,lines=20,seed=7",
    "multisine:0.001,f=0.5,lines=20,periods=2.0,levels=1.0;3.0",
    "shuttle:-0.3,speeds=0.01;0.05,a=0.1,j=1.0,dwell=0.5,start=1.0",
]


@pytest.mark.parametrize("text", MOTIONS)
def test_the_words_are_their_own_canonical_form(text: str) -> None:
    m = parse_motion(text)
    assert m.text == text
    assert parse_motion(m.text) == m


@settings(max_examples=50, deadline=None)
@given(
    distance=st.floats(-10, 10).filter(lambda d: abs(d) > 1e-6),
    limits=st.tuples(*[st.floats(1e-6, 1e3)] * 3),
    start=st.floats(0, 1e3),
)
def test_any_move_comes_back_from_its_words_to_the_same_bits(
    distance: float, limits: tuple[float, float, float], start: float
) -> None:
    v, a, j = limits
    m = move(distance, v, a, j, start)
    for again in (parse_motion(m.text), pickle.loads(pickle.dumps(m))):
        assert again == m
        assert again.end == m.end
        assert np.array_equal(again.waveform.knots(), m.waveform.knots())


def test_a_recorded_motion_travels_with_its_points() -> None:
    t = np.array([0.0, 0.1, 0.3, 0.6])
    m = sampled(t, np.sin(t), "linear")
    again = pickle.loads(pickle.dumps(m))
    assert at(again, 0.2) == pytest.approx([(math.sin(0.1) + math.sin(0.3)) / 2])
    assert m.end == 0.6
    assert m.text == "sampled: 4 points from 0 s to 0.6 s"
    assert m == again
    assert m != sampled(t, np.cos(t), "linear")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("fly:0.02", "'fly' is unknown; choose one of move, cycle, shuttle, step"),
        ("sampled:1", "'sampled' is unknown"),
        ("move:0.02", "v, a missing; a move needs them"),
        ("move:0.02,v=0.03", "a missing; a move needs it"),
        ("move:0.02,v=0.03,a=-1", "move: a = -1 must be a positive number"),
        ("move:0.02,v=-0.03,a=1", "move: v = -0.03 must be a positive number"),
        ("cycle:1;2,v=1,a=1,j=-1", "cycle: j = -1 must be positive"),
        ("move:0.02,v=0.03kg,a=1", "v = '0.03kg'"),
        ("move:0.02,v=0.03,a=1,v=2", "v is given twice"),
        ("move:0.02,0.03,a=1", "'0.03': write name=value after the first"),
        ("move:0.02,v=0.03,a=1,jerk=3", "'jerk' is unknown; a move takes distance, v, a, j, start"),
        ("move:0.02,v=nan,a=1", "v = 'nan'"),
        ("sine:1,f=0", "sine: f = 0 must be a positive number"),
        ("cycle:,v=1,a=1", "targets"),
        ("multisine:1e-3,f=1,lines=2.5", "lines = 2.5: must be a whole number"),
        ("multisine:1e-3,f=1,periods=2.5,levels=1;2", "several levels need whole periods"),
        ("shuttle:1,speeds=1;0,a=1", "shuttle: speeds = 0 must be a positive number"),
        ("shuttle:1,speeds=,a=1", "speeds"),
        ("step:1,end=0", "end = 0.0: must be a time after 0"),
        ("step:1,at=-20", "end = -10.0: must be a time after 0"),
    ],
)
def test_words_that_make_no_motion(text: str, told: str) -> None:
    with pytest.raises(MotionError) as refused:
        parse_motion(text)
    assert str(refused.value).startswith(f"motion {text!r}: ")
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)
