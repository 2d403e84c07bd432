"""How effects' numbers move what is left: by secants, so that every law can be fitted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.estimation.unknowns import Unknown

Array = NDArray[np.float64]

_STEP, _LEAST = 0.02, 0.1  # of a number, and of its usual size
_INSTANT = 2e-3  # s: at most, where a load sets in or ends


def with_values(grown: Any, free: Sequence[Unknown], v: Array) -> Any:
    """A copy of the core's machine with the effects' numbers at v, (k,)."""
    core = grown.copy()
    for p, x in zip(free, v, strict=True):
        core.set(p.path, p.value(float(x)))
    return core


def secants(
    c: TorqueBalance,
    grown: Any,
    free: Sequence[Unknown],
    u: Array,
    v: Array,
    left: Sequence[Array],
) -> list[Array] | None:
    """Change of every series per effects' number, (n, k) each; None where no balance shows one.

    left: what is left at u and v, per series (n,)
    """
    found = []
    for j, p in enumerate(free):
        step = _STEP * max(abs(float(v[j])), _LEAST * max(1.0, abs(p.start)))
        if p.unit == "s":
            step = min(step, _INSTANT / p.slope(float(v[j])))
        if v[j] + step > p.bounds[1]:
            step = -step
        moved = v.copy()
        moved[j] += step
        there = c.left(with_values(grown, free, moved), u)
        if there is None:
            return None
        found.append([(b - a) / step for a, b in zip(left, there, strict=True)])
    if not found:
        return [np.zeros((len(part), 0)) for part in left]
    return [np.stack(parts, axis=1) for parts in zip(*found, strict=True)]
