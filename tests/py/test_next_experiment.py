"""The next experiment: within the machine's limits, told in words, and it does part the rivals."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dualdrive import Machine, parse_motion, simulate
from dualdrive._core import Machine as Core
from dualdrive.demo import sheet
from dualdrive.diagnose.experiment import TELLS_APART, Limits, menu, next_experiment
from dualdrive.diagnose.experiment.distance import Noise, expected, misfit
from dualdrive.diagnose.experiment.limits import axis_of
from dualdrive.diagnose.experiment.plan import Plan, Rival
from dualdrive.motion import Motion
from dualdrive.traces import Trace

Array = NDArray[np.float64]

RMS = {"theta_m": 2e-6, "I_1": 0.5, "I_2": 0.5}
NOISE = Noise(RMS, 4e-3)
SECONDS = 4.0
#: s for a search of seconds, so that a busy machine cuts nothing
PLENTY = 1e6


def table_with(*effects: tuple[str, dict[str, float]]) -> Machine:
    machine = sheet()
    for label, numbers in effects:
        machine.add(label, **numbers)
    return machine


@cache
def friction() -> tuple[Machine, Machine]:
    """As much dry friction at the table as at the motors: 2 · 150 · 20 · 0.05 = 300 N·m."""
    return (
        table_with(("coulomb@table", {"torque": 300.0})),
        table_with(("coulomb@motors", {"torque": 0.05})),
    )


def noisy(machine: Machine, motion: Motion, settings: dict[str, float], seed: int) -> Trace:
    core = machine.core.copy()
    for path, value in settings.items():
        core.set(path, value)
    clean = expected(core, motion, list(RMS))
    assert clean is not None
    rng, step = np.random.default_rng(seed), float(clean.t[1] - clean.t[0])
    rough = math.sqrt(NOISE.spacing / step)
    return Trace(
        clean.t, {n: clean[n] + rough * rms * rng.normal(size=len(clean)) for n, rms in RMS.items()}
    )


def test_what_there_was_no_time_for_is_said_and_the_search_ends() -> None:
    told: list[str] = []
    rivals = list(zip(("table", "motors"), friction(), strict=True))
    given = {"noise": RMS, "channels": list(RMS), "simulations": 0.0, "cut": told.append}
    assert next_experiment(rivals, **given) is None  # type: ignore[arg-type]
    assert told
    assert told[0].startswith("next experiment: not tried: ")
    assert "ramps" in told[0]


def test_eleven_tells_two_apart_in_95_per_cent() -> None:
    """Log likelihoods of two rivals a distance d apart differ by N(d, 4d)."""
    right = 0.5 * (1 + math.erf(math.sqrt(TELLS_APART) / 2 / math.sqrt(2)))
    assert right == pytest.approx(0.95, abs=0.002)


@pytest.mark.long
def test_a_suggestion_is_words_settings_and_commands() -> None:
    a, b = friction()
    told: list[str] = []
    best = next_experiment(
        [("coulomb@table", a), ("coulomb@motors", b)],
        noise=RMS, channels=list(RMS), seconds=SECONDS, spacing=NOISE.spacing,
        simulations=PLENTY, files=("m.toml", "old.csv", "new.csv"), progress=told.append,
    )  # fmt: skip
    assert best is not None
    assert best.separates == ("coulomb@table", "coulomb@motors")
    assert best.expected_distance > TELLS_APART
    assert parse_motion(best.motion).text == best.motion
    assert any(best.motion in command for command in best.commands)
    assert best.commands[-1].startswith("dualdrive diagnose m.toml old.csv new.csv")
    for path, value in best.settings.items():
        assert f"--set-for new.csv:{path}={value:g}" in best.commands[-1]
    assert any(best.name in line for line in told)
    # carried out, with noise, the right explanation is met and the other one is not
    motion, settings = parse_motion(best.motion), dict(best.settings)
    for seed in range(2):
        for truth in (a, b):
            record = noisy(truth, motion, settings, seed)
            left = []
            for machine in (a, b):
                core = machine.core.copy()
                for path, value in settings.items():
                    core.set(path, value)
                left.append(misfit(core, record, motion, NOISE)[0])
            wrong, right = (left[1], left[0]) if truth is a else (left[0], left[1])
            assert wrong - right > 2 * math.log(20)


def test_white_noise_leaves_as_many_squares_as_samples() -> None:
    """Sum of n squared standard normals: n ± 3 sqrt(2 n); the few numbers fitted take off few."""
    a, _ = friction()
    motion = parse_motion("cycle:0.01;0,v=0.01,a=0.02,j=0.1,dwell=1,start=1")
    record = noisy(a, motion, {}, seed=5)
    n = len(record) * len(RMS)
    assert misfit(a.core, record, motion, NOISE)[0] == pytest.approx(
        n, abs=20 + 3 * math.sqrt(2 * n)
    )


def test_a_sensors_constant_is_no_distance() -> None:
    a, _ = friction()
    motion = parse_motion("cycle:0.01;0,v=0.01,a=0.02,j=0.1,dwell=1,start=1")
    record = expected(a.core, motion, list(RMS))
    assert record is not None
    shifted = Trace(record.t, {**record.channels, "I_1": record["I_1"] + 3.0})
    assert misfit(a.core, shifted, motion, NOISE)[0] < 1e-3


@pytest.mark.long
@pytest.mark.parametrize(
    ("preset", "share"), [("heavy-table-550t", 0.22), ("bench", 0.5), ("linear-axis", 0.15)]
)
def test_every_motion_of_the_menu_keeps_the_limits(preset: str, share: float) -> None:
    machine = Machine.load(preset)
    linear = machine.axis == "linear"
    speed, travel = 0.03, 0.05
    limits = Limits(torque=share, speed=speed, travel=travel)
    axis = axis_of(machine.core, limits, linear=linear)
    plan = Plan(Noise({"theta_m": 1e-6}), limits, linear, 60.0, lambda _: None)
    pair = [Rival("a", machine.core), Rival("b", machine.core)]
    seconds = 8.0
    items = menu(axis, seconds)
    trials = [trial for item in items if (trial := plan.sized(pair, item)) is not None]
    assert len(trials) >= 0.6 * len(items)
    for trial in trials:
        wave = trial.motion.waveform
        t = np.linspace(0, trial.motion.end, 20001)
        assert np.abs(wave.value(t)).max() <= travel * 1.001
        assert np.abs(wave.rate(t)).max() <= speed * 1.001
        assert trial.motion.end < 1.5 * seconds
        own = machine.copy()
        for path, value in trial.item.settings.items():
            own.set(path, value)
        run = simulate(own, trial.motion, output_step=0.01)
        for motor in own.core.motors:
            n = motor.rpartition("_")[2]
            assert np.abs(run[f"T_{n}"]).max() <= 1.04 * share * own.get(f"{motor}.T_max")


@pytest.mark.long
def test_a_law_that_holds_the_other_is_told_by_what_only_it_can_do() -> None:
    """Stribeck friction with a ratio of one is Coulomb's: only that way round counts."""
    richer = table_with(
        ("stribeck@table", {"torque": 1500.0, "static_ratio": 1.5, "speed": 3e-3}),
    )
    plain = table_with(("coulomb@table", {"torque": 1600.0}))
    best = next_experiment(
        [("coulomb@table", plain), ("stribeck@table", richer)],
        noise=RMS, channels=list(RMS), seconds=3.0, spacing=NOISE.spacing, simulations=PLENTY,
    )  # fmt: skip
    assert best is not None
    assert best.expected_distance > TELLS_APART


@pytest.mark.long
def test_twins_are_never_separated_and_the_next_pair_is_tried() -> None:
    """Rigidly joined, 1 N·m at the motor is 150 N·m at its pinion, whatever the motion."""
    motors = table_with(("coulomb@motors", {"torque": 1.0}))
    pinions = table_with(("coulomb@pinions", {"torque": 150.0}))
    ring = table_with(("coulomb@table", {"torque": 6000.0}))
    asked: dict[str, Any] = {
        "noise": RMS, "channels": list(RMS), "seconds": 2.0, "spacing": NOISE.spacing,
    }  # fmt: skip
    twins = [("coulomb@motors", motors), ("coulomb@pinions", pinions)]
    assert next_experiment(twins, simulations=PLENTY, **asked) is None
    best = next_experiment([*twins, ("coulomb@table", ring)], simulations=PLENTY, **asked)
    assert best is not None
    assert best.separates == ("coulomb@motors", "coulomb@table")


def axis_with(effect: str, numbers: dict[str, float]) -> Core:
    """A linear axis whose controller nobody knows."""
    core = Core()
    core.add_body("table")
    core.add_motor("motor_1", "table", "direct")
    core.add_effect(effect, "table")
    values = {"table.J": 95.0, "table.b": 200.0, "motor_1.T_max": 350.0, "motor_1.omega_max": 0.5}
    for path, value in {**values, **{f"{effect}@table.{k}": v for k, v in numbers.items()}}.items():
        core.set(path, value)
    return core


def test_an_axis_without_controller_is_judged_by_its_torque_balance() -> None:
    best = next_experiment(
        [
            ("coulomb@table", axis_with("coulomb", {"torque": 20.0})),
            ("viscous@table", axis_with("viscous", {"coefficient": 80.0})),
        ],
        noise={"T_1": 2.0}, channels=["total"], seconds=SECONDS,
    )  # fmt: skip
    assert best is not None
    assert not best.settings
    assert best.expected_distance > TELLS_APART
    assert [command.split()[1] for command in best.commands] == ["diagnose"]


def test_dry_friction_one_way_at_one_speed_is_a_constant() -> None:
    """By hand: the samples that move have one torque difference, which the constant takes up."""
    from dualdrive.diagnose.experiment import laws

    a, b = axis_with("coulomb", {"torque": 20.0}), axis_with("coulomb", {"torque": 25.0})
    one_way = parse_motion("move:2,v=0.2,a=100,settle=0.1")
    both = parse_motion("cycle:1;0,v=0.2,a=100,dwell=0.1")
    law = laws.asked(a, one_way)
    noise = Noise({"T_1": 2.0})
    assert law is not None
    assert laws.apart(b, law, one_way, noise) < 1e-6
    # there and back it is 5 N·m either way: one sigma of dry friction, a fifth of 25 N·m, or a
    # quarter of one of viscous friction, half of 200 · 0.2 N·m; shared, 1/d = 1 + 4²
    law = laws.asked(a, both)
    assert law is not None
    assert laws.apart(b, law, both, noise) == pytest.approx(1 / 17, rel=1e-3)


def test_a_torque_sensors_constant_is_no_distance_and_a_wave_is() -> None:
    """A hundred samples' worth of a wave of amplitude 4 N·m over 2 N·m noise: 100 · 4²/2 / 2²."""
    from dualdrive.diagnose.experiment import laws

    core = axis_with("viscous", {"coefficient": 50.0})
    motion = parse_motion("cycle:1;0,v=0.2,a=1,dwell=1")
    law = laws.asked(core, motion)
    assert law is not None
    torque, counted = law
    noise = Noise({"T_1": 2.0}, spacing=motion.end * counted.mean() / 100)
    assert laws.apart(core, (torque + 7.0, counted), motion, noise) < 1e-9
    wave = 4.0 * np.sin(np.linspace(0.0, 300.0, len(torque)))
    found = laws.apart(core, (torque + wave, counted), motion, noise)
    assert found == pytest.approx(200.0, rel=0.03)


def test_noise_without_a_known_channel_is_refused() -> None:
    a, b = friction()
    with pytest.raises(ValueError, match="noise: nothing above 0 for theta_m"):
        next_experiment([("a", a), ("b", b)], noise={"theta_m": 0.0}, channels=["theta_m"])
    assert next_experiment([("a", a)], noise=RMS, channels=list(RMS)) is None
