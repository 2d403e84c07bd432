"""Sensors' noise behind a filter, which a torque of unknown course may be taken for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.innovations import Variant
from test_innovations import SENSORS, bench

SAMPLES = 4000
CUTOFF = 0.09  # of half the sampling rate
#: currents that tell little of a torque, beside encoders that tell more
LARGER = np.array([5.0, 5.0, 5.0, 300.0, 300.0])
RMS = LARGER * [drive for drive, *_ in SENSORS]

Array = NDArray[np.float64]


def filtered(random: np.random.Generator, samples: int) -> Array:
    """Of order two, as a converter's low-pass leaves it."""
    white = random.normal(size=(samples + 500, len(SENSORS)))
    smooth = np.asarray(lfilter(*butter(2, CUTOFF), white, axis=0))[500:]
    return np.asarray(RMS * smooth / smooth.std(axis=0))


def test_what_a_filter_leaves_of_noise_is_no_torque() -> None:
    """From where a torque stands for it already, no noise of order two was found beside that."""
    own = grey_box(Machine.load("bench"), bench({}), SAMPLES, 5, noise=filtered, rounding=0.9 * RMS)
    estimator, nothing = Estimator(own.core, own), Variant(own.core)
    wide = estimator.wide.torque["motor_1"]
    one = estimator.from_far(own, nothing, own.start(nothing))
    assert one is not None
    assert one.noise.torque["motor_1"] > 3e-3 * wide
    two = estimator.of_order_two(own, one)
    assert two.noise.torque["motor_1"] < 3e-4 * wide
    assert two.point.minus_two_log < one.point.minus_two_log - 3000.0


def test_where_no_torque_is_asked_for_none_stands_for_noise() -> None:
    own = grey_box(Machine.load("bench"), bench({}), SAMPLES, 5)
    estimator, nothing = Estimator(own.core, own), Variant(own.core)
    one = estimator.from_far(own, nothing, own.start(nothing))
    assert one is not None
    before = own.counter.replays
    assert estimator.of_order_two(own, one) is one
    assert own.counter.replays - before < 20, "a score and a look at the torque, no search"
