"""Where a machine fails: sizes by hand-made errors, chance by coloured noise that means nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from dualdrive import Machine
from dualdrive.compare import compare, noise_floor, where_it_fails
from dualdrive.compare.orders import Order, Turning, examined, lines, ripples, significant
from dualdrive.compare.repeats import period_of, spread_of_periods
from dualdrive.compare.where import Condition, Situation
from dualdrive.traces import read
from measured import EXAMPLES, measured_file, rig
from recorded import Array, clean, sheet

T: Array = np.arange(6000, dtype=np.float64) * np.float64(1e-2)
SPEED: Array = np.sin(2 * np.pi * T / 8.0) * (1.0 + 0.5 * np.sin(2 * np.pi * T / 37.0))


def coloured(random: np.random.Generator, time: float) -> Array:
    """First-order noise of unit variance and correlation time `time`, s."""
    pole = np.exp(-1e-2 / time)
    white = random.normal(0.0, np.sqrt(1.0 - pole**2), len(T))
    found: Array = lfilter([1.0], [1.0, -pole], white)
    return found


def situation(residual: Array) -> Situation:
    load = np.abs(np.cos(2 * np.pi * T / 8.0))
    flank = np.sign(np.sin(2 * np.pi * T / 5.0))
    return Situation("r", T, residual**2, SPEED, {"mesh_1": flank, "mesh_2": -flank}, load)


def told(found: list[Condition]) -> set[str]:
    return {c.condition for c in found if c.significant}


# --- conditions -----------------------------------------------------------------------------------


def test_noise_names_no_condition() -> None:
    """At a level of 1 % for all conditions together, 60 records of noise name three at most."""
    random = np.random.default_rng(1)
    wrong = sum(
        bool(told(where_it_fails([situation(coloured(random, time))])))
        for time in (0.02, 0.1, 0.4)
        for _ in range(20)
    )
    assert wrong <= 3


@pytest.mark.parametrize(
    ("kind", "condition"),
    [
        ("direction", "backward"),
        ("speed", "fast, forward"),
        ("torque", "heavy load"),
        ("flanks", "mesh_1 on its back flank"),
        ("time", "20 .. 25 s"),
        ("motion", "reversal"),
    ],
)
def test_the_condition_that_is_worse_is_named(kind: str, condition: str) -> None:
    """The residual is three times as large under it."""
    residual = coloured(np.random.default_rng(2), 0.05)
    speed, load = np.abs(SPEED), np.abs(np.cos(2 * np.pi * T / 8.0))
    moving = speed > 0.02 * speed.max()
    changes = T[1:][np.diff(np.sign(SPEED)) != 0]
    where = {
        "backward": SPEED < 0,
        "fast, forward": (SPEED > 0) & (speed > np.quantile(speed[moving], 2 / 3)),
        "heavy load": load > np.quantile(load, 2 / 3),
        "mesh_1 on its back flank": np.sin(2 * np.pi * T / 5.0) < 0,
        "20 .. 25 s": (T >= 20.0) & (T < 25.0),
        "reversal": np.min(np.abs(T[:, None] - changes), axis=1) < 0.25,
    }[condition]
    found = where_it_fails([situation(np.where(where, 3.0, 1.0) * residual)])
    (named,) = [c for c in found if (c.kind, c.condition) == (kind, condition)]
    assert named.significant
    assert named.excess > 1.3


def test_too_short_a_record_says_nothing_of_chance() -> None:
    residual = coloured(np.random.default_rng(3), 20.0)
    found = where_it_fails([situation(residual)])
    assert found
    assert not told(found)


def test_a_comparison_tells_the_direction_that_is_wrong() -> None:
    trace = clean()
    forward = np.gradient(trace["theta_ref"], trace.t) > 1e-3
    wrong = trace.with_channel("I_1", trace["I_1"] + 2.0 * forward * np.sin(40.0 * trace.t))
    found = compare(sheet(torque=12000.0), wrong, offsets="none")
    assert "forward" in told(list(found.where))
    assert "backward" not in told(list(found.where))
    assert found.figures()["where"][0].keys() >= {"excess", "p", "significant"}


# --- orders ---------------------------------------------------------------------------------------

TURN: Array = np.cumsum(SPEED) * 1e-2 * 2 * np.pi * 4.0


def spectrum_of(residual: Array) -> list[Order]:
    angles = [Turning("motor 1", 10.0, 10.0 * TURN), Turning("table", 1.0, TURN)]
    counts = np.ones(len(T), dtype=bool)
    found = lines("r", "T_1", "N*m", residual, counts, angles)
    return significant(found, examined(angles, counts), geared=True)


def test_noise_and_friction_have_no_order() -> None:
    random = np.random.default_rng(4)
    wrong = 0
    for time in (0.01, 0.1, 0.5):
        for _ in range(20):
            wrong += bool(spectrum_of(coloured(random, time) + np.sign(SPEED)))
    assert wrong <= 1


@pytest.mark.parametrize(("angle", "order"), [("motor 1", 6), ("table", 17)])
def test_an_order_is_found_with_its_amplitude(angle: str, order: int) -> None:
    turned = TURN * (10.0 if angle == "motor 1" else 1.0)
    ripple = 0.4 * np.sin(order * turned + 0.3)
    noise = coloured(np.random.default_rng(5), 0.1)
    first = spectrum_of(ripple + noise + np.sign(SPEED))[0]
    assert (first.angle, round(first.order)) == (angle, order)
    assert first.label == f"order {order} of {angle}"
    assert abs(first.order - order) <= first.resolution
    assert first.amplitude == pytest.approx(0.4, rel=0.25)


def test_a_line_known_under_two_angles_is_told_once() -> None:
    """Ten times the table's order 17 is the motor's 1.7, and order 3 of the motor its 30."""
    noise = coloured(np.random.default_rng(6), 0.1)
    found = spectrum_of(0.5 * np.sin(3 * 10.0 * TURN) + noise)
    assert (
        len([o for o in found if 2.5 < o.order * (10 if o.angle != "table" else 1) / 10 < 3.5]) == 1
    )
    assert found[0].label == "order 3 of motor 1"
    assert found[0].also == ("order 30 of table",)


def one_line(angle: str, order: float, *, record: str = "r", ratio: float = 1.0) -> Order:
    return Order(record, "total", angle, order, 0.06, 0.5, "N*m", 6.0, 0.02, 1e-9, ratio)


def test_orders_of_pinions_that_turn_alike_are_one() -> None:
    (found,) = significant(
        [one_line("pinion 1", 58.46), one_line("pinion 2", 58.56)], 100, geared=False
    )
    assert found.spoken == "58.5 per turn (all ratios are 1: its source can't be told)"
    assert found.label == "order 58.5 of pinion 1 or pinion 2"


def test_angles_that_turn_alike_are_named_where_others_do_not() -> None:
    seen = [
        one_line("motor 1", 6.0, ratio=10.0),
        one_line("motor 2", 6.05, ratio=10.0),
        one_line("table", 60.2),
    ]
    (found,) = significant(seen, 100, geared=True)
    assert found.spoken == (
        "6 per turn (motor 1, motor 2 turn alike: its source can't be told) or order 60.2 of table"
    )


def test_what_several_records_show_is_told_once() -> None:
    """Each keeps its own line for programs."""
    kept = [
        one_line("pinion 1", 58.46),
        one_line("pinion 2", 58.56, record="s"),
        one_line("pinion 2", 29.0),
    ]
    sentences = [r.sentence for r in ripples([replace(o, geared=False) for o in kept])]
    assert sentences == [
        "total: ripple, 58.5 per turn (all ratios are 1: its source can't be told): amplitude "
        "0.5 N*m, 2% of the residual's square in 2 records",
        "total: ripple, 29 per turn of pinion 2: amplitude 0.5 N*m, 2% of the residual's square",
    ]


def test_the_rig_has_one_ripple_per_turn_of_no_known_part() -> None:
    """All its ratios are 1; two tests show two lines, over one pinion or both (log8)."""
    parts = {k: t for k, t in rig("log8").items() if k.endswith(("part 0", "part 3"))}
    found = compare(Machine.load(EXAMPLES / "dual_motor_rig.toml"), parts)
    sentences = [sentence for sentence in found.remarks() if "ripple" in sentence]
    assert [sentence.partition(": amplitude")[0] for sentence in sentences] == [
        f"total: ripple, {order} per turn (all ratios are 1: its source can't be told)"
        for order in ("29.3", "58.5")
    ]


def test_a_real_robot_has_order_8_of_its_motor() -> None:
    """Seen by hand in the raw torque, 8.00 per motor turn (docs/howto/real-data.md)."""
    path = measured_file("kuka_kr300/derived_rec_A.csv")
    trace = read(path, EXAMPLES / "kuka_axis1.map.toml")
    found = compare(Machine.load(EXAMPLES / "kuka.toml"), trace)
    (first, *_) = found.orders
    assert first.label == "order 8 of motor 1"
    assert first.order == pytest.approx(8.0, abs=0.02)
    assert "ripple, 8 per turn of motor 1" in found.table()
    assert any(c.kind == "order" and c.significant for c in found.where)


# --- noise from repeats ---------------------------------------------------------------------------


def repeated(count: int) -> tuple[Array, Array]:
    period = np.sin(2 * np.pi * np.arange(400) / 400.0) ** 3
    reference = np.concatenate([np.zeros(57), np.tile(period, count), np.zeros(123)])
    return 1e-2 * np.arange(len(reference), dtype=np.float64), np.asarray(reference, np.float64)


@pytest.mark.parametrize("count", [2, 3, 7])
def test_repeats_of_a_command_are_found(count: int) -> None:
    t, reference = repeated(count)
    period = period_of(t, reference)
    assert period is not None
    assert period.length == 400
    assert period.count == (count if count == 2 else count - 1)
    assert period.seconds == pytest.approx(4.0)


def test_turns_repeat_too_but_ramps_and_single_moves_do_not() -> None:
    t, reference = repeated(4)
    turning = reference + np.cumsum(np.where(reference == 0.0, 0.0, 1e-3))
    assert period_of(t, reference + 0.5 * (np.arange(len(t)) >= len(t))) is not None
    assert period_of(t, turning) is not None
    assert period_of(t, 0.1 * t) is None
    single = np.clip(t - 5.0, 0.0, 3.0)
    assert period_of(t, single) is None
    assert period_of(t, np.cumsum(np.random.default_rng(1).normal(size=len(t)))) is None


def test_noise_is_what_does_not_repeat() -> None:
    """Coloured noise that no spectrum shows, under a signal that repeats and is not the command."""
    t, reference = repeated(8)
    period = period_of(t, reference)
    assert period is not None
    random = np.random.default_rng(7)
    pole = np.exp(-1e-2 / 0.3)
    noise = lfilter([1.0], [1.0, -pole], random.normal(0.0, np.sqrt(1 - pole**2), len(t)))
    values = 40.0 * np.gradient(reference) / 1e-2 + 0.2 * noise
    assert spread_of_periods(values, period) == pytest.approx(0.2, rel=0.12)
    found = noise_floor(t, values, period=period)
    assert found.rms == pytest.approx(0.2, rel=0.12)
    assert found.how == "7 periods of 4 s"
    assert noise_floor(t, values).rms < 0.1
    assert noise_floor(t, values, period=period, jitter=0.7).how.startswith("jitter")
