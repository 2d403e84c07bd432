"""How well a refit foretells what it was not fitted to, and how well its numbers are known.

Every block of time is foretold by the refit of all the others: one step of the linearised problem,
which is what a refit would do. What belongs to a record (zeros of its encoders, constant torques)
is no part of the machine and keeps its value from the whole record.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.algebra import scales, solved
from dualdrive.diagnose.evidence import Evidence, alike, shared_curvature
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.result import Interval

Array = NDArray[np.float64]

_Z = 1.959964  # of a 95 % interval
_RIDGE = 1e-10
_OPEN, _OPEN_LOG = 1e3, 50.0  # usual sizes, e-fold: wider, a number is not determined at all


def held_out(seen: Evidence, refit: Refit) -> list[Array]:
    """What every series leaves where each block is foretold by the others, (n,) each."""
    m, numbers = len(refit.u), len(seen.confrontation.nominal)
    machine = np.r_[0:numbers, m : m + len(refit.v)]
    gram, pull = _normal(seen, refit)
    whole, right = gram.sum(0) + np.diag(_belief(seen, refit)), pull.sum(0) + _pull(seen, refit)
    gram, pull = gram[:, machine][:, :, machine], pull[:, machine]
    whole, right = whole[np.ix_(machine, machine)], right[machine]
    raw = [np.concatenate([s, c], axis=1) for s, c in zip(refit.slopes, refit.columns, strict=True)]
    blocks = np.split(seen.block, np.cumsum([len(x) for x in refit.left])[:-1])
    found = [np.array(x, dtype=np.float64) for x in refit.left]
    for b in range(len(gram)):
        step = -solved(whole - gram[b], right - pull[b])
        for series, slopes, own in zip(found, raw, blocks, strict=True):
            inside = own == b
            series[inside] += slopes[inside][:, machine] @ step
    return found


def intervals(seen: Evidence, refit: Refit, inflation: float) -> dict[str, Interval]:
    """95 % intervals of the effects' numbers and of the nominal ones, path -> interval.

    From the curvature, with the noise that series share counted once, as far as the noise is what
    it is taken for; or from how differently the blocks of time pull at each number (H. White,
    Econometrica 48, 1980), whichever is wider.
    """
    gram, pull = _normal(seen, refit)
    whole = gram.sum(0) + np.diag(_belief(seen, refit))
    scale = 1.0 / np.sqrt(np.maximum(np.diag(whole), 1e-300))
    even = whole * np.outer(scale, scale) + _RIDGE * np.eye(len(whole))
    inverse = np.linalg.inv(even)
    apart = (pull - pull.mean(0)) * scales(whole)
    blocks = len(pull)
    scatter = inverse @ (apart.T @ apart) @ inverse * blocks / max(blocks - 1, 1)
    more = shared_curvature(seen, alike(seen, refit.left), _jacobian(seen, refit)) - gram.sum(0)
    shared = inverse + inverse @ (more * np.outer(scale, scale)) @ inverse
    own = np.maximum(np.diag(inverse), np.diag(shared)) * inflation
    variance = np.maximum(own, np.diag(scatter))
    sigma = np.sqrt(np.maximum(variance, 0.0)) * scale
    m = len(refit.u)
    found = {}
    nominal = seen.confrontation.nominal
    named = [*zip(nominal, refit.u, sigma[: len(nominal)], strict=False)]
    named += [*zip(refit.free, refit.v, sigma[m:], strict=True)]
    for p, x, s in named:
        s = min(float(s), _OPEN_LOG if p.logarithmic else _OPEN)
        low, high = sorted((p.value(float(x - _Z * s)), p.value(float(x + _Z * s))))
        value = p.value(float(x))
        if p.unit == "rad" and p.path.endswith("phase"):
            turns = 2 * np.pi * np.round(value / (2 * np.pi))
            value, low, high = value - turns, low - turns, high - turns
        found[p.path] = Interval(value, low, high, p.unit)
    return found


def _jacobian(seen: Evidence, refit: Refit) -> Array:
    """White rows of all derivatives, nuisances first, (n, m + k)."""
    return np.concatenate([seen.white(refit.slopes), seen.white(refit.columns)], axis=1)


def _normal(seen: Evidence, refit: Refit) -> tuple[Array, Array]:
    """Normal matrices and right sides per block."""
    jacobian, left = _jacobian(seen, refit), seen.white(refit.left)
    gram, pull = [], []
    for b in range(int(seen.block.max()) + 1):
        own = seen.block == b
        gram.append(jacobian[own].T @ jacobian[own])
        pull.append(jacobian[own].T @ left[own])
    return np.stack(gram), np.stack(pull)


def _belief(seen: Evidence, refit: Refit) -> Array:
    sigma = seen.confrontation.sigma
    own = np.where(np.isfinite(sigma), 1.0 / sigma**2, 0.0)
    return np.concatenate([own, np.zeros(len(refit.v))])


def _pull(seen: Evidence, refit: Refit) -> Array:
    c = seen.confrontation
    known = np.isfinite(c.sigma)
    own = np.where(known, (refit.u - c.centre) / np.where(known, c.sigma, 1.0) ** 2, 0.0)
    return np.concatenate([own, np.zeros(len(refit.v))])
