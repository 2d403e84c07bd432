"""Poles of a machine whose loops are closed, cut or late, and the frequencies worth a look."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dualdrive.linear.closing import Closed
from dualdrive.linear.realise import realise

__all__ = ["in_order", "is_stable", "moving", "poles_of", "usual_frequencies"]

Array = NDArray[np.float64]

_POINTS = 400
_NEAR = 1e-7  # of the fastest pole: as good as zero


def in_order(A: Array) -> NDArray[np.complex128]:
    """Eigenvalues of a state matrix, 1/s, the slowest first."""
    found = np.linalg.eigvals(A).astype(np.complex128)
    return found[np.lexsort((found.imag, np.abs(found)))]


def poles_of(closed: Closed) -> NDArray[np.complex128]:
    """Of the whole system, 1/s, the slowest first; delays as Padé approximants of order 6."""
    return in_order(realise(closed).A)


def moving(poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Those that are not at zero, where an angle is that nothing holds."""
    sizes = np.abs(poles)
    return np.asarray(poles[sizes > _NEAR * sizes.max(initial=0.0)], np.complex128)


def is_stable(closed: Closed) -> bool:
    """Whether nothing grows. Poles at zero, an angle that nothing holds, count as stable."""
    found = poles_of(closed)
    return bool((found.real <= _NEAR * np.abs(found).max(initial=0.0)).all())


def usual_frequencies(A: Array) -> Array:
    """From a tenth of the slowest pole to ten times the fastest, denser near light damping; Hz."""
    rates = in_order(A)
    sizes = np.abs(rates)
    own = np.abs(moving(rates)) / (2 * np.pi)
    if not own.size:
        return np.geomspace(0.01, 100.0, _POINTS)
    found = [np.geomspace(own.min() / 10, own.max() * 10, _POINTS)]
    for pole in rates[(rates.imag > 0) & (np.abs(rates.real) < 0.3 * sizes)]:
        width = max(abs(pole.real) / abs(pole), 1e-4)
        found.append(abs(pole) / (2 * np.pi) * (1 + width * np.linspace(-4, 4, 33)))
    f = np.unique(np.concatenate(found))
    return np.asarray(f[f > 0])
