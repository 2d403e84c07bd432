"""How well a state is known at a record's first sample, by likelihood."""

from __future__ import annotations

from dataclasses import replace

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.innovations import GreyBox, Variant
from test_innovations import bench

SAMPLES, MOVING = 3000, 700


def fitted(first: int, initial: float) -> tuple[GreyBox, Fitted]:
    """The bench on its record from a sample on, which is taken for one that begins at rest.

    initial: where the search of a first state's deviation begins
    """
    grey = grey_box(Machine.load("bench"), bench(), SAMPLES, seed=7, first=first)
    estimator, nothing = Estimator(grey.core, grey), Variant(grey.core)
    near = estimator.from_far(grey, nothing, grey.start(nothing))
    assert near is not None
    noise = replace(near.noise, initial=initial)
    found = estimator.likeliest(grey, nothing, near.point.theta, noise)
    assert found is not None
    return grey, found


def loss(grey: GreyBox, f: Fitted, initial: float) -> float:
    """Rise of -2 log L where a first state is known so well, all else as it is."""
    [there] = grey.likelihoods(f.variant, [(f.point.theta, replace(f.noise, initial=initial))])
    assert there is not None
    return there[0].minus_two_log - f.point.minus_two_log


def test_of_a_machine_that_was_at_rest_it_is_known_beyond_doubt() -> None:
    grey, f = fitted(0, 1.0)
    assert loss(grey, f, 10.0) - loss(grey, f, 1e-3) > 10.0


def test_of_one_that_moved_already_it_is_not() -> None:
    grey, f = fitted(MOVING, 0.1)
    assert f.noise.initial > 1.0
    assert loss(grey, f, 1e-2) > 1e4
