"""Other valleys for the nominal numbers: record by record, and about what one record alone tells.

A record without tension hunts or sticks, and chi^2 over its numbers has many narrow valleys. The
numbers that a steadier record tells alone, and a cloud about them as wide as that record leaves
them open, are tried as starts of the refit to all records together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.refit import Fitter, Refit

Array = NDArray[np.float64]

_DRAWS = 12  # of each record's cloud
_RENEWED = 2  # slopes of a record's own numbers: they are a start, no more
_WIDER = 2.0  # than the record's own standard errors: its noise counts what the model lacks


def better_valley(seen: Evidence, base: Refit, stop: Callable[[], bool]) -> Refit:
    """The lowest refit to all records from these starts; `base` where none is lower."""
    c, fitter = seen.confrontation, Fitter(seen, stop)
    names = list(dict.fromkeys(s.record for s in c.series))
    if len(names) < 2:
        return base
    rng = np.random.default_rng(len(base.u))
    best = base
    for name in names:
        alone = Fitter(_only(seen, name), stop).nominal(base.u, renewals=_RENEWED)
        if alone is None or stop():
            continue
        tried = []
        for u in _cloud(_only(seen, name), alone, rng):
            left = c.left(c.core, u)
            if left is not None:
                tried.append((seen.chi(u, left), u))
        if tried:
            start = min(tried, key=lambda one: one[0])[1]
            found = fitter.nominal(start)
            best = found if found is not None and found.chi < best.chi else best
    return best


def _only(seen: Evidence, name: str) -> Evidence:
    """The same evidence, all other records left out."""
    return replace(
        seen,
        whiteners=[
            w if s.record == name else replace(w, keep=np.zeros_like(w.keep))
            for s, w in zip(seen.confrontation.series, seen.whiteners, strict=True)
        ],
    )


def _cloud(seen: Evidence, alone: Refit, rng: np.random.Generator) -> Iterator[Array]:
    """The numbers one record tells, and draws about them; all else as it stands."""
    c, count = seen.confrontation, len(seen.confrontation.nominal)
    yield alone.u
    rows = seen.white(alone.slopes)
    belief = np.where(np.isfinite(c.sigma), 1.0 / c.sigma**2, 0.0)
    gram = rows.T @ rows + np.diag(belief)
    covariance = np.linalg.pinv(gram, rcond=1e-12, hermitian=True)[:count, :count]
    values, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(values, 0.0))
    for _ in range(_DRAWS):
        u = alone.u.copy()
        u[:count] += _WIDER * (root @ rng.standard_normal(count))
        yield np.clip(u, c.low, c.high)
