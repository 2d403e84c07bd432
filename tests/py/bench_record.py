"""A grey box of the bench on a noisy record of a bench that the test knows."""

from __future__ import annotations

from typing import Any

import numpy as np

from dualdrive import Machine
from dualdrive.diagnose.closed_loop import nominal_unknowns
from dualdrive.innovations import GreyBox, predictable
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace
from test_innovations import CHANNELS, REVERSALS, STEP, coloured, run


def grey_box(machine: Machine, true: Any, samples: int, seed: int) -> GreyBox:
    """The machine's, where the true one has been recorded at its reversals."""
    seen = run(true, {"theta_ref": REVERSALS}, samples)
    seen += coloured(np.random.default_rng(seed), samples)
    t = STEP * np.arange(samples, dtype=np.float64)
    columns = dict(zip(CHANNELS, seen.T, strict=True))
    trace = Trace(t, {"theta_ref": REVERSALS.value(t), **columns}, name="record")
    core = core_of(machine)
    played = predictable(core, records(machine, {"record": trace}, start="rest"))
    return GreyBox(core, played, nominal_unknowns(core, None))
