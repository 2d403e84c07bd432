"""A grey box of the bench on a noisy record of a bench that the test knows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import Machine
from dualdrive.diagnose.closed_loop import nominal_unknowns
from dualdrive.innovations import GreyBox, predictable
from dualdrive.replay import core_of, records
from dualdrive.traces import Trace
from test_innovations import CHANNELS, REVERSALS, STEP, coloured, run

Array = NDArray[np.float64]


def grey_box(
    machine: Machine,
    true: Any,
    samples: int,
    seed: int,
    noise: Callable[[np.random.Generator, int], Array] = coloured,
    late: Mapping[str, float] | None = None,
    motion: Any = REVERSALS,
    rounding: Array | None = None,
    first: int = 0,
) -> GreyBox:
    """The machine's, where the true one has been recorded on a motion.

    noise: of the sensors, (random, samples) -> shape (samples, channels)
    late:  channel -> how late its sensor is, s
    rounding: the smallest step of every channel, shape (channels,)
    first: sample with which the record begins, as if the machine had been at rest there
    """
    clean = run(true, {"theta_ref": motion}, samples)
    seen = clean + noise(np.random.default_rng(seed), samples)
    for channel, time in (late or {}).items():
        k = CHANNELS.index(channel)
        rate = np.gradient(clean[:, k], STEP)
        seen[:, k] += time * (0.5 * time * np.gradient(rate, STEP) - rate)
    if rounding is not None:
        seen = rounding * np.round(seen / rounding)
    t = STEP * np.arange(samples, dtype=np.float64)
    columns = {"theta_ref": motion.value(t), **dict(zip(CHANNELS, seen.T, strict=True))}
    trace = Trace(t[: samples - first], {c: y[first:] for c, y in columns.items()}, name="record")
    core = core_of(machine)
    played = predictable(core, records(machine, {"record": trace}, start="rest"))
    return GreyBox(core, played, nominal_unknowns(core, None))
