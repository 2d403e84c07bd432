"""Normal equations of many unknowns of many sizes, some of which no row sees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_RIDGE = 1e-10  # of every curvature: what no row sees stays put
_UNSEEN = 1e-30  # of the largest curvature: less is rounding


def scales(matrix: Array) -> Array:
    """What makes every curvature of a normal matrix (n, n) one; zero where there is none, (n,)."""
    own = np.diag(matrix)
    seen = own > _UNSEEN * max(float(own.max(initial=0.0)), 0.0)
    return np.where(seen, 1.0 / np.sqrt(np.where(seen, own, 1.0)), 0.0)


def solved(matrix: Array, right: Array) -> Array:
    """The solution of normal equations (n, n), (n,), columns scaled alike.

    Directions that no row sees stay put.
    """
    scale = scales(matrix)
    even = matrix * np.outer(scale, scale)
    even[np.diag_indices_from(even)] += np.where(scale > 0.0, _RIDGE * len(even), 1.0)
    result: Array = scale * np.linalg.solve(even, scale * right)
    return result
