"""How well a state is known at a record's first sample, by likelihood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dualdrive import Machine
from dualdrive.diagnose.closed_loop import nominal_unknowns
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.innovations import GreyBox, Variant, predictable
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace
from test_innovations import CHANNELS, REVERSALS, STEP, bench, coloured, run

SAMPLES, MOVING = 3000, 700


def fitted(first: int) -> tuple[GreyBox, Fitted]:
    """The bench on its record from a sample on, which is taken for one that begins at rest."""
    t = STEP * np.arange(SAMPLES, dtype=np.float64)
    seen = run(bench(), {"theta_ref": REVERSALS}, SAMPLES)
    seen += coloured(np.random.default_rng(7), SAMPLES)
    columns = dict(zip(CHANNELS, seen[first:].T, strict=True))
    command = np.asarray(REVERSALS.value(t))[first:]
    trace = Trace(t[: SAMPLES - first], {"theta_ref": command, **columns})
    machine = Machine.load("bench")
    core = core_of(machine)
    played = predictable(core, records(machine, {"record": trace}, start="rest"))
    grey = GreyBox(core, played, nominal_unknowns(core, None))
    estimator, nothing = Estimator(core, grey), Variant(core)
    near = estimator.from_far(grey, nothing, grey.start(nothing))
    assert near is not None
    found = estimator.likeliest(grey, nothing, near.point.theta, near.noise)
    assert found is not None
    return grey, found


def loss(grey: GreyBox, f: Fitted, initial: float) -> float:
    """Rise of -2 log L where a first state is known so well, all else as it is."""
    [there] = grey.likelihoods(f.variant, [(f.point.theta, replace(f.noise, initial=initial))])
    assert there is not None
    return there[0].minus_two_log - f.point.minus_two_log


def test_of_a_machine_that_was_at_rest_it_is_known_beyond_doubt() -> None:
    grey, f = fitted(0)
    assert f.noise.initial < 1e-2
    assert loss(grey, f, 10.0) > 10.0


def test_of_one_that_moved_already_it_is_not() -> None:
    grey, f = fitted(MOVING)
    assert f.noise.initial > 10.0
    assert loss(grey, f, 1e-2) > 1e4
