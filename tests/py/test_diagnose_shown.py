"""What a diagnosis must show; the figures of every claim: ``python -m tests.blind.shown CLAIM``.

What is drawn is checked here; SHOWN=1 diagnoses it, a few minutes of a core of its own.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from dualdrive import parse_motion
from dualdrive.motion import Motion

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from tests.blind.generator.effects import UnfitError
from tests.blind.shown import apart, distance, ordered, preloaded, verdicts
from tests.blind.shown.ordered import Order

import diagnosis

ALL = "SHOWN" in os.environ
long = pytest.mark.skipif(not ALL, reason="needs minutes and a core of its own: SHOWN=1")
BUDGET = 60.0  # s for each machine, several times what it needs
SHORT = BUDGET if ALL else 5.0  # s, where the answer must hold whatever was cut
SEEDS = (0, 1)


def ids(orders: list[Order]) -> list[str]:
    return [order.name for order in orders]


# made only where they run: to draw one takes a second
DRIFTS = verdicts.drifts(SEEDS) if ALL else []
LOADS = verdicts.loads(SEEDS) if ALL else []


@long
@pytest.mark.parametrize("order", DRIFTS, ids=ids(DRIFTS))
def test_a_drifted_inertia_alone_is_called_parameters(order: Order) -> None:
    found = order.diagnosed(BUDGET, experiment=False)
    assert found.verdict == "parameters", verdicts.row(order, found)
    real = order.real["table.J"]
    told = found.moved["table.J"]
    assert told.low - 0.02 * real <= real <= told.high + 0.02 * real, (told, real)


@long
@pytest.mark.parametrize("order", LOADS, ids=ids(LOADS))
def test_a_load_that_sets_in_is_not_called_friction(order: Order) -> None:
    found = order.diagnosed(SHORT, experiment=False)
    assert verdicts.is_no_friction(found), verdicts.row(order, found)
    assert found.verdict not in ("adequate", "parameters"), verdicts.row(order, found)


def test_what_is_drifted_and_what_is_loaded_shows() -> None:
    """By the generator's own count of noise: else any verdict would be luck."""
    drifted = ordered.drifted("bench", 0, 1.25)
    bench = distance.Bench(drifted.real, drifted.plans, drifted.recorder)
    assert bench.apart(drifted.sheet) > 1e4
    loaded = ordered.loaded("bench", 0, 0.3)
    bench = distance.Bench(loaded.real, loaded.plans[:1], loaded.recorder)
    nominals = distance.Nominals(bench)
    assert nominals.distance(bench.record(loaded.hidden[loaded.plans[0].name])) > 1e4


@pytest.mark.parametrize("family", ordered.FAMILIES)
def test_the_benchmark_of_time_takes_ten_seconds_at_one_kilohertz(family: str) -> None:
    wanted = diagnosis.order(family, 1, "coulomb")
    [(_, trace)] = wanted.traces().items()
    assert len(trace) == 10001
    assert np.median(np.diff(trace.t)) == pytest.approx(1e-3, abs=2e-6)
    assert trace.t[-1] == pytest.approx(10.0, abs=1e-3)
    assert wanted.hidden["ten"][0].parameters["torque"] > 0


# --- what can't be told apart, and the experiment that does -------------------------------------


@pytest.mark.parametrize(
    "words",
    [
        "cycle:0.5;0,v=2,a=9,j=150,dwell=0.5,start=0.2",
        "shuttle:0.4,speeds=1;0.2,a=5,j=60,dwell=0.3,start=0.1",
        "multisine:0.01,f=0.25,lines=8,start=0.25,periods=1,levels=0.3;1",
    ],
)
def test_the_generator_follows_a_planned_motion(words: str) -> None:
    """Pieces of constant jerk, integrated by hand, meet it; speed except at kinks."""
    motion = parse_motion(words)
    angle, speed = followed(motion)
    t = np.arange(len(angle)) * apart._KNOT
    assert np.abs(angle - motion.waveform.value(t)).max() < 1e-7
    assert np.median(np.abs(speed - motion.waveform.rate(t))) < 1e-6 * np.abs(speed).max()


def followed(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    pieces = apart.jerks_of(motion)
    u = apart._KNOT
    angle, speed, rate = [0.0], [0.0], 0.0
    for _, jerk in pieces:
        angle.append(angle[-1] + u * (speed[-1] + u * (rate / 2 + u * jerk / 6)))
        speed.append(speed[-1] + u * (rate + u * jerk / 2))
        rate += u * jerk
    return np.array(angle), np.array(speed)


@pytest.mark.long
def test_a_record_that_allows_two_names_is_as_it_says() -> None:
    case = preloaded.alike("medium", "coulomb@table", "coulomb@motors", 0)
    assert case.seen > preloaded.SEEN
    assert case.apart <= 1.5 * preloaded.APART
    order = case.order
    [plan] = order.plans
    [hidden] = order.hidden[plan.name]
    bench = preloaded.Stored(order.real, order.plans, order.recorder)
    nominals = distance.Nominals(bench)
    assert nominals.distance(bench.record((hidden,))) > 0.5 * case.seen
    made = plan.truth(order.real, (hidden,))
    flanks = [set(made[name]) for name in ("flank_1", "flank_2")]
    assert sorted(map(sorted, flanks)) == [[-1.0], [1.0]], "a flank is left"


@long
def test_what_can_not_be_told_apart_is_called_ambiguous_and_then_parted() -> None:
    rows = []
    for k, wanted in enumerate(preloaded.every(0)):
        try:
            case = preloaded.alike(*wanted)
        except UnfitError:
            continue
        rows.append(apart.parted(case, BUDGET, seed=k))
    page = "\n".join([*map(str, rows), *apart.summary(rows)])
    told = [one for one in rows if one.ambiguous]
    assert len(told) >= 0.8 * len(rows), page
    parted = [one.suggested > apart.DECIDED for one in told]
    assert np.mean(parted) >= 0.8, page
    assert np.mean(parted) > np.mean([one.chance > apart.DECIDED for one in told]), page
