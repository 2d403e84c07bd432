"""Where a fit through the closed loop begins: numbers that predict the record a sample ahead.

A simulated error is hardly lower half-way to the true machine than far from it, wherever a small
error grows or is kept: a descent that begins at a data sheet which lacks something ends where it
happens to (`benchmarks/landscape.py`). Predictions a sample ahead, under torques of unknown course,
have wide valleys; what they find is where the simulation begins (initial estimates for
output-error models: Ljung, System Identification, 2nd ed., section 10.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.estimation.thresholds import threshold
from dualdrive.estimation.unknowns import Unknown
from dualdrive.innovations import (
    GreyBox,
    Variant,
    first_noise,
    followed,
    least_noise,
    levels,
    predictable,
    some,
)
from dualdrive.replay import Record

Array = NDArray[np.float64]


def initial_estimates(
    core: Any, played: Sequence[Record], parameters: Sequence[Unknown]
) -> list[Array]:
    """Numbers under less and less torque of unknown course, shape (parameters,) each.

    Empty where no filter follows the records.

    Args:
        core: the machine.
        played: the records; of long ones stretches are looked at.
        parameters: what is fitted.

    """
    nothing = Variant(core)
    try:
        records = predictable(core, played)
        whole = GreyBox(core, records, parameters)
        wide = first_noise(core, records, threshold("wide torque"))
        floor = least_noise(core, records, threshold("least torque"))
        theta = whole.start(nothing)
        gains = whole.gains(nothing, theta, wide)
    except ValueError:
        return []
    [point] = whole.points([nothing], [theta], gains)
    grey = some(whole, point, gains, int(threshold("stretches")))
    found = followed(grey, nothing, theta, levels(wide, floor))
    return [place.theta[: len(parameters)] for place, _ in found]
