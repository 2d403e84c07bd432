"""Coordinates in which numbers of laws are fitted: waves by their cosine and sine.

A law of amplitude a and phase φ is a wave a cos φ · cos(n θ) - a sin φ · sin(n θ), linear in
x = a cos φ and y = a sin φ. In these a fit passes through a = 0, where a phase has no gradient and
would wander (Quinn, Hannan, The Estimation and Tracking of Frequency, ch. 1). All other numbers
stand as `Unknown` has them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.estimation.unknowns import Unknown

Array = NDArray[np.float64]


def waves(unknowns: Sequence[Unknown]) -> list[tuple[int, int]]:
    """(strength, phase) of every wave, by their places; x and y stand there."""
    strengths = {_label(p): k for k, p in enumerate(unknowns) if p.strength and p.low == 0.0}
    return [
        (strengths[_label(p)], k)
        for k, p in enumerate(unknowns)
        if p.path.endswith(".phase") and _label(p) in strengths
    ]


def values(unknowns: Sequence[Unknown], u: Array) -> dict[str, float]:
    """Path -> SI value, phases within half a turn of zero.

    u: coordinates, shape (unknowns,)
    """
    found = {p.path: p.value(float(x)) for p, x in zip(unknowns, u, strict=True)}
    for k, turn in waves(unknowns):
        strength, phase = unknowns[k], unknowns[turn]
        found[strength.path] = strength.value(math.hypot(u[k], u[turn]))
        found[phase.path] = math.atan2(u[turn], u[k])
    return found


def coordinates(unknowns: Sequence[Unknown], known: Mapping[str, float]) -> Array:
    """Where these values stand, shape (unknowns,); numbers that are not known, where they begin.

    known: path -> SI value
    """
    plain = {p.path: known.get(p.path, p.value(p.start)) for p in unknowns}
    u = np.array([p.coordinate(plain[p.path]) for p in unknowns])
    for k, turn in waves(unknowns):
        size, phase = u[k], plain[unknowns[turn].path]
        u[k], u[turn] = size * math.cos(phase), size * math.sin(phase)
    return u


def bounds(unknowns: Sequence[Unknown]) -> list[tuple[float, float]]:
    """Lowest and highest coordinate of each."""
    found = [p.bounds for p in unknowns]
    for k, turn in waves(unknowns):
        high = found[k][1]
        found[k] = found[turn] = (-high, high)
    return found


def deviations(unknowns: Sequence[Unknown], u: Array, covariance: Array) -> Array:
    """Standard deviations, of waves those of strength and phase, shape (unknowns,).

    Of strengths and all others in their coordinates, of phases in rad.

    Args:
        unknowns: what is fitted.
        u: coordinates, shape (unknowns,).
        covariance: of the coordinates, shape (unknowns, unknowns).

    """
    found = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    for k, turn in waves(unknowns):
        size = math.hypot(u[k], u[turn])
        if size == 0.0:
            continue
        along = np.array([u[k], u[turn]]) / size
        across = np.array([-along[1], along[0]]) / size
        own = covariance[np.ix_([k, turn], [k, turn])]
        found[k] = math.sqrt(max(float(along @ own @ along), 0.0))
        found[turn] = math.sqrt(max(float(across @ own @ across), 0.0))
    return found


def _label(p: Unknown) -> str:
    return p.path.rpartition(".")[0]
