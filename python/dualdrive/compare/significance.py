"""Is an error larger under a condition than chance makes it? Permuted blocks, worst of all.

Residuals resemble their neighbours, so single samples are no independent witnesses. The squared
residuals are cut into blocks several correlation times long; were the error alike under all
conditions, blocks could be exchanged. The spread of each condition's mean over such exchanges sizes
its excess, and the largest of all those sizes in each exchange is what an excess must beat: the
chance of naming any condition wrongly holds for all of them together (P. Westfall, S. Young,
"Resampling-Based Multiple Testing", Wiley 1993; blocks after H. Künsch, Annals of Statistics 17,
1989).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.coloured import correlation_time

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Key = tuple[str, str]

EXCHANGES = 999
_FEWEST, _MOST = 12, 160  # blocks
_SPAN = 8.0  # correlation times in a block


def adjusted(squares: Sequence[Array], inside: Mapping[Key, Sequence[Flags]]) -> dict[Key, float]:
    """Probability of each condition's excess, the whole family of conditions accounted for.

    Args:
        squares: of each record, shape (n,).
        inside: condition -> flags per record, shape (n,).

    Returns:
        p per condition; NaN for all where the records hold fewer than 12 independent blocks.

    """
    if not inside:
        return {}
    size = _block(squares, inside)
    s = _blocks(squares, size)
    if len(s) < _FEWEST:
        return dict.fromkeys(inside, float("nan"))
    s = s - np.mean(s)
    random = np.random.default_rng(1)
    orders = np.array([random.permutation(len(s)) for _ in range(EXCHANGES)])
    slots = np.arange(len(s))
    sizes, tops = [], np.full(EXCHANGES, -np.inf)
    for flags in inside.values():
        pairs = _blocks([f.astype(np.float64) for f in flags], size) @ s.T
        exchanged = pairs[slots, orders].sum(axis=1)
        spread = float(np.std(exchanged))
        scale = 1.0 / spread if spread > 0.0 else 0.0
        sizes.append(float(np.trace(pairs)) * scale)
        tops = np.maximum(tops, (exchanged - np.mean(exchanged)) * scale)
    found = [(1 + int(np.sum(tops >= own))) / (1 + EXCHANGES) for own in sizes]
    return dict(zip(inside, found, strict=True))


def _block(squares: Sequence[Array], inside: Mapping[Key, Sequence[Flags]]) -> int:
    """Samples in a block: several correlation times of what the conditions do not explain."""
    count = sum(len(s) for s in squares)
    longest = 0.0
    for k, s in enumerate(squares):
        columns = [np.ones(len(s)), *(flags[k].astype(np.float64) for flags in inside.values())]
        basis = np.stack(columns, axis=1)
        normal, right = basis.T @ basis, basis.T @ s
        left = s - basis @ np.linalg.lstsq(normal, right, rcond=1e-9)[0]
        longest = max(longest, 1.0 + correlation_time(left))
    return max(1, round(_SPAN * longest), -(-count // _MOST))


def _blocks(series: Sequence[Array], size: int) -> Array:
    """Whole blocks of all records, shape (blocks, size)."""
    whole = [s[: len(s) // size * size].reshape(-1, size) for s in series]
    return np.concatenate(whole)
