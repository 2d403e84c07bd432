"""What coloured residuals do to a least-squares fit: correlation times, long-run covariances.

Two estimates of the covariance of a sum of scores ``J' w r``, both over a Bartlett window:

- from the scores themselves, which allows noise that differs from place to place (W. Newey,
  K. West, Econometrica 55, 1987), but reads low where the record is short;
- from the autocorrelation of the residuals, which takes them for stationary.

A fit takes the larger variance of the two for each parameter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def autocorrelation(signal: Array) -> Array:
    """Autocorrelation at lags 0 .. n-1 of a signal about zero, biased, shape (n,)."""
    covariance = autocovariance(signal)
    return covariance / covariance[0] if covariance[0] > 0 else np.zeros(len(signal))


def autocovariance(signal: Array) -> Array:
    """Mean product of a signal with itself, lags 0 .. n-1 later (over n, by FFT), shape (n,)."""
    n = len(signal)
    length = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(signal, length)) ** 2
    found: Array = np.fft.irfft(power, length)[:n] / n
    return found


def correlation_time(signal: Array) -> float:
    """Sum of the autocorrelations at lags 1, 2, ..., in samples, at least 0.

    Sums pairs of neighbouring lags until a pair is no longer positive (C. Geyer, Statistical
    Science 7, 1992), which neither a slow drift nor the noise of far lags upsets.
    """
    if len(signal) < 4:
        return 0.0
    rho = autocorrelation(signal)
    pairs = rho[: len(rho) // 2 * 2].reshape(-1, 2).sum(axis=1)
    end = int(np.argmax(pairs <= 0)) if np.any(pairs <= 0) else len(pairs)
    return max(0.0, float(pairs[:end].sum()) - 1.0)


def scatter_of_scores(weighted: Array, left: Array) -> Array:
    """Covariance of the summed scores, (k, k), from their own products at every lag.

    Args:
        weighted: Jacobian times weight, shape (equations, n, k).
        left: residuals, shape (equations, n), 0 where a sample does not count.

    """
    score = np.einsum("eni,en->ni", weighted, left)
    spread: Array = score.T @ score
    for lag, taper in _bartlett(max(_window(r) for r in left)):
        cross = score[lag:].T @ score[:-lag]
        spread += taper * (cross + cross.T)
    return spread


def scatter_if_stationary(weighted: Array, left: Array) -> Array:
    """The same for residuals whose autocovariance is one and the same everywhere."""
    spread = np.zeros((weighted.shape[2],) * 2)
    for slope, residual in zip(weighted, left, strict=True):
        covariance = autocovariance(residual)
        spread += covariance[0] * slope.T @ slope
        for lag, taper in _bartlett(_window(residual)):
            cross = slope[lag:].T @ slope[:-lag]
            spread += covariance[lag] * taper * (cross + cross.T)
    return spread


def _window(signal: Array) -> int:
    """Bartlett window: several correlation times, and no less than the n^(1/3) of theory."""
    n = len(signal)
    return int(min(n // 4, max(n ** (1 / 3), 6 * correlation_time(signal))))


def _bartlett(window: int) -> list[tuple[int, float]]:
    return [(lag, 1 - lag / (window + 1)) for lag in range(1, window + 1)]
