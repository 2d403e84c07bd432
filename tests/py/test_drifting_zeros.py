"""Zeros that drift over many seconds: estimated before laws are sought, as part of the noise."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.selection.base import refitted_base
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.residual_analysis import white
from test_innovations import STEP, bench, coloured

_WANDER = 5.0  # s, over which a zero forgets where it was


def drifting(random: np.random.Generator, samples: int) -> NDArray[np.float64]:
    """Noise of the sensors, and zeros that drift by three times as much."""
    noise = coloured(random, samples)
    memory = np.exp(-STEP / _WANDER)
    steps = np.sqrt(1.0 - memory**2) * random.normal(size=noise.shape)
    steps[0] = random.normal(size=noise.shape[1])
    zeros = lfilter([1.0], [1.0, -memory], steps, axis=0)
    drifted: NDArray[np.float64] = noise + 3.0 * noise.std(axis=0) * zeros
    return drifted


@pytest.mark.parametrize("friction", [0.0, 0.01])
def test_beside_zeros_that_drift_numbers_alone_leave_noise(friction: float) -> None:
    """Laws are sought on all samples then: what is faint is not hidden by the drift's colour.

    Zeros that drift are not held back by a friction of 0.2 % of the drives' torque.
    """
    true = bench({"coulomb@table": {"torque": friction}} if friction else {})
    grey = grey_box(Machine.load("bench"), true, 8000, seed=4, noise=drifting)
    base = refitted_base(Estimator(grey.core, grey), grey)
    assert white(base.there)
    assert base.there.noise.seeks
    assert base.everywhere is not None
