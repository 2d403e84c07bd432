"""Score tests: by how much chi-squared would fall if a law were let in, all shared numbers free.

Each law is put in at its usual size; the change of the innovations, less what shared unknowns could
do as well, is its regressor. Engle, Handbook of Econometrics II (1984), ch. 13: the Lagrange
multiplier test, with a finite probe in place of the derivative so that limits and play count, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.hypotheses import probes
from dualdrive.innovations import GreyBox, Point, Variant, flat

Array = NDArray[np.float64]

_WITHIN = 0.3  # of a sample
_BATCH = 16  # probes whose innovations are kept at a time


@dataclass(frozen=True, eq=False)
class Scored:
    """A law and what it would gain.

    gain: fall of chi-squared, over the inflation of what the base leaves; NaN: its probe broke down
    """

    variant: Variant
    gain: float


def scores(
    grey: GreyBox,
    base: Point,
    columns: Sequence[Array],
    variants: Sequence[Variant],
    gains: Sequence[Any],
    inflation: float,
    tell: Callable[[int, int], None] = lambda done, of: None,
) -> list[Scored]:
    """Score of every variant beside a base point, in the order given.

    Args:
        grey: records and shared unknowns.
        base: the point they are tried beside.
        columns: derivatives of the base's innovations by all its unknowns.
        variants: to be tried; their first numbers are the base's.
        gains: Kalman gains, the base's.
        inflation: of what the base leaves.
        tell: told how many of how many are done.

    """
    r = flat(base.residuals)
    known = len(base.theta)
    J = np.stack(columns)
    prior = np.zeros(known)
    prior[: grey.shared] = 1.0 / grey.sigma**2
    H = J @ J.T + np.diag(prior + 1e-12 * np.max(np.abs(np.diag(J @ J.T))))
    factor = np.linalg.inv(H)
    rest = r - J.T @ (factor @ (J @ r))

    within = _WITHIN * min(x.sampled.step for x in grey.records)
    jobs: list[tuple[int, Variant, Array]] = []
    for k, v in enumerate(variants):
        if _core.effect_type(v.effects[-1][0]).structural:
            continue  # has other states
        own = v.extra[len(base.variant.extra) :]
        for setting in probes(v.grown, own, ()):
            # a reading that moves by whole samples moves its noise, too: a probe stays within one
            held = {p: min(x, within) if p.endswith(".time") else x for p, x in setting.items()}
            at = [p.coordinate(held[p.path]) if p.path in held else p.start for p in own]
            jobs.append((k, v, np.r_[base.theta, at]))
    found: dict[int, list[Array]] = {}
    for first in range(0, len(jobs), _BATCH):
        if grey.counter.stop():
            break
        batch = jobs[first : first + _BATCH]
        points = grey.points([v for _, v, _ in batch], [x for _, _, x in batch], gains)
        for (k, _, _), p in zip(batch, points, strict=True):
            change = flat(p.residuals) - r
            if not p.lost:
                found.setdefault(k, []).append(change - J.T @ (factor @ (J @ change)))
        tell(min(first + _BATCH, len(jobs)), len(jobs))
    return [Scored(v, _gain(found.get(k, []), rest) / inflation) for k, v in enumerate(variants)]


def _gain(regressors: Sequence[Array], rest: Array) -> float:
    if not regressors:
        return float("nan")
    C = np.stack(regressors)
    M = C @ C.T
    M += 1e-9 * np.diag(np.diag(M)) + 1e-300 * np.eye(len(M))
    b = C @ rest
    return float(b @ np.linalg.solve(M, b))
