"""What was found about one machine and its records: every hypothesis tried, scored or refitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.floors import ratios
from dualdrive.diagnose.refit import Refit, Trial
from dualdrive.diagnose.stage import Score

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Survey:
    """What was found about one machine.

    nominal:  the machine as it came, only what belongs to the records fitted
    base:     its nominal numbers refitted, under the final noise
    refitted: the same under the noise that it leaves itself: what a user would call the refit
    refits:   hypotheses refitted under the final noise, least criterion first
    criterion: `key_of` -> chi^2 plus k log n, over `inflation`: differences are twice log evidence
    scores:   of every hypothesis at the refitted machine, best first
    twins:    label -> labels with the very same signature on these records
    """

    evidence: Evidence
    nominal: Refit
    base: Refit
    refits: Sequence[Refit]
    criterion: Mapping[str, float]
    inflation: float
    scores: Sequence[Score]
    twins: Mapping[str, Sequence[str]] = field(default_factory=dict)
    refitted: Refit | None = None

    @property
    def plain(self) -> Refit:
        """The refitted machine as it is reported."""
        return self.refitted or self.base

    @property
    def best(self) -> Refit:
        """The hypothesis with the least criterion, nothing missing among them."""
        every = [self.base, *self.refits]
        return min(every, key=lambda r: self.criterion[key_of(r)])


def key_of(refit: Refit | Trial) -> str:
    """Label with its counted numbers."""
    fixed = ", ".join(f"{p.rpartition('.')[2]} {x:g}" for p, x in refit.hypothesis.fixed.items())
    return f"{refit.hypothesis.label} ({fixed})" if fixed else refit.hypothesis.label


def excess(found: Survey, left: Sequence[Array]) -> Array:
    """Residual over noise floor of every series, RMS, shape (series,)."""
    return ratios(found.evidence.confrontation.series, left)


def explained_share(before: Array, after: Array) -> float:
    """Share of the mean squares above the floor that went, each series counting alike, 0 .. 1.

    before, after: residual over floor, of `excess`, shape (series,)
    """
    could = np.maximum(1.0 - 1.0 / before**2, 0.0)
    went = 1.0 - after**2 / before**2
    whole = float(could.sum())
    return float(min(max(went.sum() / whole, 0.0), 1.0)) if whole > 1e-3 else 1.0


def explained_by(found: Survey, r: Refit) -> float:
    """Share of what could be explained that a refit explains, 0 .. 1.

    The equations share their numbers: weighed by its own noise a machine that lacks something may
    close the drives' at the cost of the table's. So it is held against the one weighed like the
    refit, too, and the larger share counts.
    """
    after = excess(found, r.left)
    without = (found.plain, found.base)
    return max(explained_share(excess(found, own.left), after) for own in without)
