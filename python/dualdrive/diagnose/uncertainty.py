"""How sure fitted numbers are: intervals, and errors on what a fit did not see."""

from __future__ import annotations

import numpy as np

from dualdrive.diagnose.result import Interval
from dualdrive.diagnose.selection import Fitted
from dualdrive.innovations import GreyBox, flat

_BLOCKS = 8  # of cross-validation
_FAR = 3.0  # standard errors that a number may move where a block is left out
_SURE = 1.96  # standard deviations of a 95 % interval


def cross_validated(grey: GreyBox, f: Fitted) -> float:
    """Error on blocks of time that a fit did not see, over that on those it saw.

    One Gauss-Newton step takes each block out of the fit, and a replay with the numbers found so
    tells the block's error (Ljung, System Identification, 16.4).
    """
    point = f.point
    columns = np.stack(grey.columns(point, range(len(point.theta)), f.gains))
    r = flat(point.residuals)
    weight = np.zeros(len(point.theta))
    weight[: grey.shared] = 1.0 / grey.sigma**2
    s = 1.0 / f.inflation
    H = s * (columns @ columns.T) + np.diag(weight + 1e-12)
    scale = np.sqrt(np.diag(np.linalg.pinv(H, hermitian=True)).clip(0.0) + 1e-300)
    # a linear step says nothing far away, where only one block tells a number
    held = np.diag(1.0 / (_FAR * scale) ** 2)
    blocks = np.concatenate(
        [
            np.repeat(np.minimum(np.arange(len(x)) * _BLOCKS // len(x), _BLOCKS - 1), x.shape[1])
            for x in point.residuals
        ]
    )
    low, high = grey.bounds(f.variant)
    places = []
    for b in range(_BLOCKS):
        J, left = columns[:, blocks == b], r[blocks == b]
        step = np.linalg.solve(H - s * (J @ J.T) + held, s * (J @ left))
        places.append(np.clip(point.theta + np.clip(step, -_FAR * scale, _FAR * scale), low, high))
    total = 0.0
    for b, found in enumerate(grey.points([f.variant] * _BLOCKS, places, f.gains)):
        total += float(np.sum(flat(found.residuals)[blocks == b] ** 2))
    return float(np.sqrt(total / max(float(r @ r), 1e-300)))


def intervals(grey: GreyBox, f: Fitted) -> dict[str, Interval]:
    """Path -> value with its 95 % interval, nominal numbers and the effects' own."""
    point = f.point
    columns = np.stack(grey.columns(point, range(len(point.theta)), f.gains))
    weight = np.zeros(len(point.theta))
    weight[: grey.shared] = 1.0 / grey.sigma**2
    H = columns @ columns.T / f.inflation + np.diag(weight)
    scale = np.sqrt(np.diag(H) + 1e-300)
    covariance = np.linalg.pinv(H / np.outer(scale, scale)) / np.outer(scale, scale)
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    known = [(p, k) for k, p in enumerate(grey.nominal)]
    known += [(p, grey.shared + k) for k, p in enumerate(f.variant.extra)]
    found = {}
    for p, k in known:
        u, d = float(point.theta[k]), _SURE * float(deviation[k])
        ends = sorted((p.value(u - d), p.value(u + d)))
        found[p.path] = Interval(p.value(u), ends[0], ends[1], p.unit)
    for path, value in f.variant.fixed.items():
        unit = f.variant.grown.parameter(f.variant.grown.members(path)[0]).unit
        found[path] = Interval(value, value, value, unit)
    return found
