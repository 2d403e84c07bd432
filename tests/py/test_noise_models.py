"""The noise of a grey box as a vector of logarithms: what a search of it keeps and recovers."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.innovations import Noise, Variant, first_noise, maximum_likelihood
from dualdrive.innovations.noise import Logarithms
from test_innovations import STEP, bench, coloured

Array = NDArray[np.float64]

NOISE = Noise(
    drive={"table angle": 1e-6, "drive angle": 2e-6},
    memory={"table angle": 0.5, "drive angle": 0.0},
    torque={"table": 0.1, "motor_1": 0.01, "motor_2": 0.02},
    course=0.99,
    drift={"table angle": 1e-8, "drive angle": 3e-8},
    wander={"table angle": 0.995, "drive angle": 0.9},
)


def drifts_by(noise: Noise) -> dict[str, float]:
    """Kind -> standard deviation of its zero in the long run."""
    return {
        kind: float(s / np.sqrt(1.0 - noise.wander[kind] ** 2)) for kind, s in noise.drift.items()
    }


@pytest.mark.parametrize("factor", [1.0, 100.0, 1e4])
def test_zeros_that_drift_more_slowly_drift_as_far(factor: float) -> None:
    slow = NOISE.slower(factor)
    assert slow.seeks
    assert drifts_by(slow) == pytest.approx(drifts_by(NOISE))
    for kind, pole in NOISE.wander.items():
        assert np.log(slow.wander[kind]) == pytest.approx(np.log(pole) / factor)


@pytest.mark.parametrize("seeks", [False, True])
def test_a_vector_of_noughts_is_the_noise_it_was_begun_with(seeks: bool) -> None:
    noise = replace(NOISE, seeks=seeks)
    own = Logarithms(noise)
    found = own.at(np.zeros(len(own)))
    for name in ("drive", "memory", "torque", "drift", "wander"):
        assert getattr(found, name) == pytest.approx(getattr(noise, name)), name
    low, high = own.bounds()
    assert low.shape == high.shape == (len(own),)
    assert np.all(low <= 0.0)
    assert np.all(high >= 0.0)


def test_a_logarithm_of_a_drifts_time_keeps_how_far_it_goes() -> None:
    own = Logarithms(replace(NOISE, seeks=True))
    kinds = 2
    for k in range(3 * kinds, 4 * kinds):  # after drives, memories and drifts
        x = np.zeros(len(own))
        x[k] = np.log(30.0)
        found = own.at(x)
        assert found.wander != NOISE.wander
        assert drifts_by(found) == pytest.approx(drifts_by(NOISE))


def test_a_drift_over_seconds_is_recovered() -> None:
    """Encoders of the motors whose zeros drift by 1e-4 rad over 2 s, others not at all."""
    pole, far = float(np.exp(-STEP / 2.0)), 1e-4

    def drifting(random: np.random.Generator, samples: int) -> Array:
        noise = coloured(random, samples)
        for column in (1, 2):
            w = random.normal(size=samples) * far * np.sqrt(1.0 - pole**2)
            w[0] = far * random.normal()
            noise[:, column] += lfilter([1.0], [1.0, -pole], w)
        return noise

    own = grey_box(Machine.load("bench"), bench({}), 6000, seed=4, noise=drifting)
    nothing = Variant(own.core)
    first = first_noise(own.core, own.records, 1e-3)
    found = maximum_likelihood(own, nothing, own.start(nothing), first)
    assert found is not None
    slow = maximum_likelihood(own, nothing, found[0].theta, found[1].slower(1.0))
    assert slow is not None
    point, noise, _ = slow
    assert point.minus_two_log < found[0].minus_two_log - 10.0
    seconds = -STEP / np.log(noise.wander["drive angle"])
    # two sensors, three times over which they drift in the record: how long is hardly told, and
    # the truth may not be likelier than what was found
    assert 0.2 < seconds < 20.0
    true = replace(
        noise,
        wander={**noise.wander, "drive angle": pole},
        drift={**noise.drift, "drive angle": far * float(np.sqrt(1.0 - pole**2))},
    )
    [there] = own.likelihoods(nothing, [(point.theta, true)])
    assert there is not None
    assert point.minus_two_log < there[0].minus_two_log + 2.0
    assert drifts_by(noise)["drive angle"] == pytest.approx(far, rel=0.7)


def test_a_simulation_has_sensors_as_noisy_as_the_filter_and_rounding_once() -> None:
    record: Any = SimpleNamespace(
        channels=("theta_m", "theta_1"), kinds=("table angle", "drive angle"), steps=(1e-7, 1e-6)
    )
    found = NOISE.of_a_simulation([record])
    assert found.variance(record) == pytest.approx(NOISE.variance(record), rel=1e-9, abs=0.0)


def test_no_drive_goes_below_the_floor() -> None:
    floor = replace(
        NOISE,
        drive={kind: 0.1 * s for kind, s in NOISE.drive.items()},
        drift={kind: 0.2 * s for kind, s in NOISE.drift.items()},
    )
    own = Logarithms(NOISE, floor)
    least = own.at(own.bounds()[0])
    assert least.drive == pytest.approx(floor.drive)
    assert least.drift == pytest.approx(floor.drift)
