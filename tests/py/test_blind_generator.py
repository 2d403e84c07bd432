"""The blind suite's generator against closed forms, against itself, and against the product."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dualdrive import Machine, simulate
from dualdrive.motion import parse_motion

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.generator import distance, engine, machines, motion, noise, records, told

MOVE = (0.02, 0.03, 0.03, 0.06)


def heavy(**more: float) -> dict[str, float]:
    """The middle of the heavy family, with friction, on one move that starts at 1 s."""
    own = machines.engine_numbers(
        {**machines.usual("heavy"), "dry_table": 2000.0, "dry_pinions": 300.0}
    )
    return {**own, "end": 4.0, **more}


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


@pytest.mark.parametrize("sampled", [False, True])
def test_nominal_machine_agrees_with_the_product(tmp_path: Path, sampled: bool) -> None:
    numbers = {**machines.usual("heavy"), "dry_table": 2000.0, "dry_pinions": 300.0}
    if sampled:
        numbers |= {"controller.position_sample": 2e-3, "controller.speed_sample": 1e-3}
    (tmp_path / "machine.toml").write_text(machines.text(numbers, "table"))
    run = simulate(
        Machine.load(str(tmp_path / "machine.toml")),
        parse_motion("move:0.02,v=0.03,a=0.03,j=0.06,start=1,end=4"),
        end=4.0,
        output_step=2e-3,
    )
    jerks, _ = motion.course([MOVE], [1.0, 1.0])
    made = engine.run({**machines.engine_numbers(numbers), "end": 4.0, "step": 1e-5}, jerks)
    for channel in ("theta_m", "theta_1", "I_1", "I_2"):
        apart = np.std(np.asarray(run[channel]) - made[channel])
        assert apart < 1e-5 * np.std(made[channel]), channel
    error = made["theta_ref"] - made["theta_m"]
    assert np.std(np.asarray(run["theta_m"]) - made["theta_m"]) < 1e-4 * np.std(error)


def test_noise_has_the_spectrum_it_claims() -> None:
    rng = np.random.default_rng(3)
    sensor = noise.Sensor(rms=2.0, coloured=0.7, correlation=8e-3, step=0.5)
    n, dt = 4096, 2e-3
    power = np.mean(
        [
            np.abs(np.fft.rfft(sensor.read(np.zeros(n), dt, rng), norm="ortho")) ** 2
            for _ in range(60)
        ],
        axis=0,
    )
    low, high = slice(1, 60), slice(-300, -1)
    claimed = sensor.spectrum(n, dt)
    assert power[low].mean() == pytest.approx(claimed[low].mean(), rel=0.06)
    assert power[high].mean() == pytest.approx(claimed[high].mean(), rel=0.06)


def test_distance_of_a_refitted_number_is_small_and_of_an_effect_is_not() -> None:
    """A table 5 % heavier is a nominal number; friction that is not in the sheet is none."""
    rng = np.random.default_rng(5)
    sheet = machines.draw("medium", rng)
    plans = records.plans("medium", sheet, rng)
    bench = distance.Bench(sheet, plans, records.recorder("medium", 0.8, rng)).tense()
    nominals = distance.Nominals(bench)
    heavier = bench.record(factors={"table.J": 1.05})
    raw = heavier - nominals.at_truth
    assert float(raw @ raw) > 1000
    assert nominals.distance(heavier) < 10
    from tests.blind.generator import cases, effects  # enters all effects

    assert cases.GROUPS
    rubbing = effects.draw("coulomb", records.setting(sheet, plans), 1, 0.3)
    assert nominals.distance(bench.record((rubbing,))) > 1000


def told_bench() -> tuple[told.Equations, records.Plan]:
    rng = np.random.default_rng(6)
    sheet = {**machines.draw("medium", rng), "dry_table": 200.0, "dry_pinions": 10.0}
    plans = records.plans("medium", sheet, rng)
    bench = distance.Bench(sheet, plans, records.recorder("medium", 0.8, rng)).tense()
    return told.Equations(bench.machine, bench.plans, bench.recorder), bench.plans[0]


def test_equations_of_motion_close_on_the_engine_s_own_record() -> None:
    bench, _ = told_bench()
    left = bench.record()
    assert float(np.mean(left**2)) < 0.1, "in units of the sensors' noise"


def test_noise_of_the_equations_is_what_the_sensors_leave_in_them() -> None:
    """The linear model of the noise against sensors that are read, the flanks closed."""
    bench, plan = told_bench()
    made = plan.truth(bench.machine, step=distance.COARSE)
    rng = np.random.default_rng(7)
    quiet = bench._left(made, plan.sample)
    closed = quiet[0] != 0.0
    powers = []
    for _ in range(12):
        noisy = {
            name: values
            + replace(bench.recorder.sensors[name], step=1e-30).read(0 * values, plan.sample, rng)
            for name, values in made.items()
            if name in bench.recorder.sensors
        }
        change = np.where(closed, bench._left(noisy, plan.sample) - quiet, 0.0)
        powers.append(np.mean(bench._whitened(plan, change) ** 2))
    # a part of the record is masked, and with it that share of the noise
    assert np.mean(powers) == pytest.approx(closed.mean(), rel=0.25)


def test_friction_that_may_lean_leaves_less_of_an_effect() -> None:
    bench, _ = told_bench()
    loop = distance.Bench(bench.machine, bench.plans, bench.recorder)
    from tests.blind.generator import cases, effects  # enters all effects

    assert cases.GROUPS
    setting = records.setting(bench.machine, tuple(bench.plans))
    warm = next(
        one
        for one in (effects.draw("thermal_drift", setting, k, 0.05) for k in range(20))
        if one.place == "motor_1"
    )
    known, free = (
        kind(loop).project(loop.record((warm,)) - loop.record())[0]
        for kind in (distance.Nominals, told.Leaning)
    )
    assert float(free @ free) < 0.5 * float(known @ known)
