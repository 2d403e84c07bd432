"""How likely residuals are if one direction of them carries a random torque besides the noise.

With noise of covariance κ Σ and a torque of variance σ² along the columns of D, the residual e of a
sample has covariance κ Σ + σ² D Dᵀ. A wider guess explains more and is less likely in all that it
does not see, so hypotheses with one and with two free torques compare on even terms. κ ≥ 1 says
that the noise, or the model besides, is worse than estimated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.compare.excuses import Point, alike, left, noise_alone, refitted, strain
from dualdrive.identify.coloured import correlation_time

Array = NDArray[np.float64]

_SCALES = np.linspace(0.0, 16.0, 9)  # log κ
_SIZES = np.linspace(-8.0, 20.0, 15)  # log of σ² over the variance that noise leaves along D
_FINE = 0.2  # width of the last grid
_LARGEST = 700.0  # log of a size: no equation shows such a torque at all
_ROUNDS, _STEPS = 2, 2
_FEWEST = 20  # blocks


#: directions in which a torque is free, per record (n, m, d), d 1 or 2
Free = Callable[[Point], Sequence[Array]]


def likelihood(starts: Sequence[Point], free: Free) -> list[Array]:
    """Log likelihood of each counted sample, per record (n,), under the likeliest torque.

    Args:
        starts: where refits begin; the one that leads to the likeliest end counts.
        free: directions of the torque.

    """
    found = [_from(start, free) for start in starts]
    return max(found, key=lambda log: float(sum(s.sum() for s in log)))


def _from(point: Point, free: Free) -> list[Array]:
    """Refit numbers, constants and zeros with the torque wholly free, then with one of its size."""
    same, m = alike(point), len(point.equations)

    def open_to(kappa: float, size: float) -> Callable[[Point], list[Array]]:
        return lambda p: [
            _weight(w, d, kappa, size) / same for w, d in zip(noise_alone(p), free(p), strict=True)
        ]

    found: list[Array] = []
    weigh = open_to(1.0, np.inf)
    for _ in range(_ROUNDS):
        point = refitted(point, weigh, _STEPS)
        noise = noise_alone(point)
        rest = left(point, weigh(point))
        seen = [
            _seen(e, w[r.keep], d[r.keep])
            for e, w, d, r in zip(rest, noise, free(point), point.rows, strict=True)
        ]
        typical = float(np.median(np.concatenate([s[2].ravel() for s in seen])))
        kappa, size = _likeliest(seen, 1.0 / max(typical, 1e-300), m)
        found = [
            _log(s, kappa, size, m) + 0.5 * np.linalg.slogdet(w[r.keep])[1]
            for s, w, r in zip(seen, noise, point.rows, strict=True)
        ]
        weigh = open_to(kappa, size)
        # what is believed of the excuses counts as the samples do, of which `same` are one witness
        cost = 0.5 * same * sum(strain(point, weigh(point))) / sum(len(s) for s in found)
        found = [s - cost for s in found]
    return found


def without(weight: Array, free: Array) -> Array:
    """Weights, (n, m, m), under which the free directions do not count."""
    return _weight(weight, free, 1.0, np.inf)


def blocks(series: Sequence[Array], point: Point) -> Array:
    """Sums over blocks several correlation times of the residual long, shape (blocks,)."""
    samples = sum(len(s) for s in series)
    longest = 1.0
    for row in point.rows:
        for e in row.residual[:, row.keep] if row.keep.any() else ():
            longest = max(longest, 1.0 + correlation_time(e - e.mean()))
    size = max(1, min(round(3.0 * longest), samples // _FEWEST))
    return np.concatenate([np.add.reduceat(s, np.arange(0, len(s), size)) for s in series])


def _seen(e: Array, weight: Array, free: Array) -> tuple[Array, Array, Array]:
    """Per sample: e'Σ⁻¹e, and along the principal directions of D'Σ⁻¹D its part of e, its size."""
    whole = np.einsum("an,nab,bn->n", e, weight, e)
    along = weight @ free
    size, turn = np.linalg.eigh(np.swapaxes(free, 1, 2) @ along)
    part = np.einsum("ndk,nd->nk", turn, np.einsum("nad,an->nd", along, e))
    return whole, part, np.maximum(size, 0.0)


def _log(seen: tuple[Array, Array, Array], kappa: float, size: float, m: int) -> Array:
    whole, part, along = seen
    gain = size / (kappa + size * along)
    square = whole / kappa - np.sum(gain * part**2, axis=1) / kappa
    result: Array = -0.5 * (
        square + m * np.log(kappa) + np.sum(np.log1p(size * along / kappa), axis=1)
    )
    return result


def _likeliest(
    seen: Sequence[tuple[Array, Array, Array]], unit: float, m: int
) -> tuple[float, float]:
    """κ and σ² of the largest likelihood, by a grid that is made finer about its best point."""
    together = (
        np.concatenate([s[0] for s in seen]),
        np.concatenate([s[1] for s in seen]),
        np.concatenate([s[2] for s in seen]),
    )
    kappas: NDArray[np.floating] = _SCALES
    sizes: NDArray[np.floating] = np.log(unit) + _SIZES
    at = (0.0, float(np.log(unit)))
    while True:
        grid = [(k, s) for k in kappas.tolist() for s in sizes.tolist()]
        with np.errstate(over="ignore", invalid="ignore"):  # far off the grid's best point
            values = [float(_log(together, np.exp(k), np.exp(s), m).sum()) for k, s in grid]
        at = grid[int(np.argmax(np.nan_to_num(values, nan=-np.inf)))]
        width = float(kappas[1] - kappas[0])
        if width < _FINE:
            return float(np.exp(at[0])), float(np.exp(min(at[1], _LARGEST)))
        step = float(sizes[1] - sizes[0]) / 2
        kappas = np.maximum(at[0] + width / 2 * np.arange(-2, 3), 0.0)
        sizes = at[1] + step * np.arange(-2, 3)
        if kappas[0] == kappas[1]:
            kappas = width / 2 * np.arange(3.0)


def _weight(weight: Array, free: Array, kappa: float, size: float) -> Array:
    """Inverse of κ Σ + σ² D Dᵀ, (n, m, m)."""
    along = weight @ free
    inner = np.swapaxes(free, 1, 2) @ along
    trace = np.trace(inner, axis1=1, axis2=2)[:, None, None]
    inner = inner + (kappa / size + 1e-12 * trace + 1e-300) * np.eye(inner.shape[1])
    result: Array = (weight - along @ np.linalg.solve(inner, np.swapaxes(along, 1, 2))) / kappa
    return result
