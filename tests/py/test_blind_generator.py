"""The blind suite's generator against closed forms, against itself, and against the product."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind import check
from tests.blind.generator import (
    cases,
    effects,
    engine,
    evidence,
    machines,
    motions,
    parts,
    records,
    sensors,
)
from tests.blind.generator.motions import Limits
from tests.blind.generator.records import Plan
from tests.blind.generator.sensors import Sensor
from tests.blind.shown import families, motion

MOVE = (0.02, 0.03, 0.03, 0.06)


def heavy(**more: float) -> dict[str, float]:
    """The heavy table in the engine's words, on one move that starts at 1 s."""
    usual = {**families.usual("heavy"), "dry_table": 2000.0, "dry_pinions": 300.0}
    return {**machines.engine_numbers({**usual, "drives": 2.0}), "end": 4.0, **more}


def test_free_bounce_in_a_gap_has_its_closed_period() -> None:
    """Physics, oracle 1: one drive and the table, no friction: 2 pi / w + 4 gap / v_0."""
    free = {"i": 150.0, "i_m": 20.0, "J_d": 0.045, "J_c": 60.0, "J_m": 3.0e6, "open": 1.0}
    free |= {"K_t_1": 2e7, "gap": 1.1e-3, "start_speed_1": 0.01}
    made = engine.run({**free, "end": 4.0, "step": 1e-5, "output_step": 1e-3})
    # both drift on together; the twist crosses mid-gap upwards once per period
    twist = made["x_1"]
    up = np.flatnonzero((twist[:-1] < 0) & (twist[1:] >= 0))
    times = made["t"][up] - twist[up] * 1e-3 / (twist[up + 1] - twist[up])
    assert np.diff(times) == pytest.approx(0.483036843, abs=2e-7)


def test_closed_loop_converges_with_the_step() -> None:
    jerks, _ = motion.course([MOVE], [1.0, 1.0])
    runs = [engine.run(heavy(step=step), jerks) for step in (4e-5, 2e-5, 1e-5)]
    for channel, size in (("theta_m", 1e-9), ("theta_1", 2e-6), ("I_1", 2e-3)):
        apart = [np.abs(run[channel] - runs[-1][channel]).max() for run in runs[:2]]
        assert apart[1] < size, channel  # far below any sensor's noise
        assert apart[1] < 2 * apart[0], channel


def short(kind: str, numbers: dict[str, float], sample: float = 1e-3) -> Plan:
    """A record of three seconds."""
    rng = np.random.default_rng(4)
    limits = records.limits(numbers)
    made = motions.draw(kind, 3.0, sample, limits, rng)
    return Plan(kind, made, sample, 0.4, numbers.get("controller.T_ten", 0.0))


def drawn(drives: int, clocked: bool) -> dict[str, float]:
    """The first machine with so many drives, tension on, and its loops sampled or not."""
    for seed in range(2000):
        numbers = machines.draw(np.random.default_rng([3, seed]))
        tense = drives == 1 or numbers.get("controller.T_ten", 0.0) > 0
        calm = 2 < numbers["controller.K_v"] < 20
        ticks = ("controller.speed_sample" in numbers) == clocked
        if numbers["drives"] == drives and tense and calm and ticks:
            return numbers
    raise AssertionError("no such machine")


@pytest.mark.parametrize(
    ("drives", "clocked"),
    [(1, False), (2, False), (4, False), (1, True), (2, True), (4, True)],
)
def test_a_drawn_machine_agrees_with_the_product(drives: int, clocked: bool) -> None:
    """Without any effect, in units of its own sensors' noise."""
    numbers = drawn(drives, clocked)
    plan = short("moves", numbers)
    truth = plan.truth(numbers)
    recorder = sensors.draw(numbers, plan.sample, np.random.default_rng(1))
    apart = check.distances(truth, check.simulated(numbers, plan, (), truth), recorder)
    assert max(apart.values()) < 0.1, apart


def test_machines_spread_over_three_decades() -> None:
    made = [machines.draw(np.random.default_rng([8, k])) for k in range(400)]
    inertia = [
        m["table.J"] / (m["drives"] * m["meshes.ratio"] ** 2 * machines.drive_inertia(m))
        for m in made
    ]
    stiffness = [m["meshes.stiffness"] / machines.drive_inertia(m) for m in made]
    for ratios in (inertia, stiffness):
        assert max(ratios) / min(ratios) > 900
    assert {m["drives"] for m in made} == {1.0, 2.0, 3.0, 4.0}
    assert 0.3 < np.mean(["controller.speed_sample" in m for m in made]) < 0.6


@pytest.mark.parametrize("kind", motions.KINDS)
def test_a_motion_begins_at_rest_and_keeps_its_limits(kind: str) -> None:
    limits = Limits(speed=0.5, acceleration=2.0, answer=8.0, natural=150.0)
    for seed in range(5):
        made = motions.draw(kind, 8.0, 1e-3, limits, np.random.default_rng(seed))
        angle, speed, following, leaving = made.pieces.T
        assert angle[0] == 0
        np.testing.assert_allclose(angle[1:], following[:-1], rtol=0, atol=1e-12)
        assert len(angle) * made.length == pytest.approx(made.end)
        assert np.ptp(angle) > 0
        if kind not in ("ramps", "steps"):
            np.testing.assert_allclose(speed[1:], leaving[:-1], rtol=0, atol=1e-12)
            assert np.abs(np.diff(speed)).max() / made.length < 1.3 * limits.acceleration
        if kind != "steps":
            assert np.abs(speed).max() < 1.05 * limits.speed


@pytest.mark.parametrize("colour", sensors.COLOURS)
@pytest.mark.parametrize("drift", [0.0, 1.5])
def test_noise_is_white_behind_its_own_filter(colour: str, drift: float) -> None:
    """Of variance one, neighbours unrelated: the covariance is what was said."""
    number = {"autoregressive": 0.95, "filtered": 0.2}.get(colour, 0.0)
    sensor = Sensor(rms=2.0, colour=colour, number=number, step=0.5, drift=drift)
    n, dt = 60_000, 1e-3
    read = sensor.read(np.zeros(n), dt, np.random.default_rng(3))
    left = sensor.whiten(read, dt)[2000:]
    assert np.mean(left**2) == pytest.approx(1.0, abs=0.03)
    for lag in (1, 2, 10):
        assert abs(np.mean(left[lag:] * left[:-lag])) < 0.03


def test_a_number_is_refitted_and_an_effect_is_not() -> None:
    """A table 3 % heavier is a nominal number; friction that is not in the sheet is none."""
    numbers = drawn(2, clocked=False)
    plan = short("moves", numbers)
    recorder = sensors.draw(numbers, plan.sample, np.random.default_rng(5))
    bench = evidence.Bench(
        numbers, [plan], recorder, ("theta_m", "theta_1", "theta_2", "I_1", "I_2")
    )
    nominals = evidence.Nominals(bench)
    heavier = bench.record(factors={"table.J": 1.03})
    raw = nominals.bench.whitened(heavier, nominals.base)
    assert nominals.best_ratio(heavier) < 2 + 1e-3 * float(raw @ raw)
    setting = records.setting(numbers, (plan,), nominals.base)
    rubbing = effects.draw("stribeck", setting, 1, 0.3)
    assert nominals.best_ratio(bench.record((rubbing,))) > 100


def test_a_case_is_the_same_bits_whatever_was_made_before_it() -> None:
    develop = parts.part("develop")
    number = next(k for k in range(40) if develop.wanted(k).group == "empty")
    first = develop.build(number)
    other = parts.part("calibrate")
    assert other.wanted(number).group == "empty"
    assert other.build(number).machine != first.machine
    again = develop.build(number)
    assert again.machine == first.machine
    assert again.truth == first.truth
    for name, columns in first.recorded.items():
        for channel, values in columns.items():
            assert np.array_equal(values, again.recorded[name][channel])


def test_parts_are_disjoint_and_a_sealed_one_is_large_enough() -> None:
    """93 % told from 90: 300 nameable single effects and 200 empty machines."""
    sealed = parts.part("sealed", 7)
    firsts = [parts.part(name).first for name in parts.FIRST] + [sealed.first]
    assert np.diff(firsts).min() >= parts.MOST
    wanted = [sealed.wanted(k) for k in range(820)]
    assert sum(w.group == "single" for w in wanted) >= 300
    assert sum(w.group in ("empty", "drifted") for w in wanted) >= 200
    assert 0.06 < np.mean([not w.known for w in wanted]) < 0.1
    hidden = [w.names[0] for w in wanted if w.group == "single" and w.known]
    counts = [hidden.count(name) for name in effects.EFFECTS]
    assert max(counts) - min(counts) <= 1
    with pytest.raises(ValueError, match="sealed takes a seed"):
        parts.part("sealed")
    with pytest.raises(ValueError, match="others none"):
        parts.part("develop", 3)


def test_a_case_of_an_unknown_loop_hands_out_no_command() -> None:
    develop = parts.part("develop")
    number = next(
        k for k in range(200) if not develop.wanted(k).known and develop.wanted(k).group == "empty"
    )
    case = develop.build(number)
    for columns in case.recorded.values():
        assert not any(name in columns for name in ("theta_ref", "omega_ref"))
    assert case.truth["loop"] == "unknown"


def test_effects_of_a_single_drive_need_no_partner() -> None:
    numbers = drawn(1, clocked=False)
    plan = short("moves", numbers)
    setting = records.setting(numbers, (plan,), [plan.truth(numbers, coarse=True)])
    with pytest.raises(effects.UnfitError):
        effects.draw("tension_mismatch", setting, 1)
    places = {effects.draw("cogging", setting, seed).place for seed in range(10)}
    assert places == {"motors"}
    assert replace(setting, machine={**numbers, "drives": 4.0}).drives == 4
    assert cases.GROUPS
