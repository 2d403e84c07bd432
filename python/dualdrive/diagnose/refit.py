"""A hypothesis fitted: its effects' numbers and every nuisance together.

A fit begins where the change of the machine was seen to lower chi^2 most (`Trial`), since the
linear score foretells little once flanks change. The slopes of the effects are secants, so that
every law can be fitted, delays among them. See `descent.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.descent import Point, bounded_step, descend
from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.hypotheses import Hypothesis, is_strength
from dualdrive.diagnose.secants import secants, with_values
from dualdrive.estimation.unknowns import Unknown

Array = NDArray[np.float64]

_STEPS = 60  # that a descent tries


@dataclass(frozen=True, eq=False)
class Start:
    """Where a fit may begin: nuisances, shape (m,), and path -> SI value of the effects' numbers.

    Numbers that are not given begin at their usual size.

    further: the same way as the start before, and only worth its time if that was the best so far
    """

    u: Array
    values: Mapping[str, float]
    further: bool = False


@dataclass(frozen=True, eq=False)
class Trial:
    """The best of several starts of a hypothesis: what it leaves there, and its chi^2."""

    hypothesis: Hypothesis
    grown: Any
    free: Sequence[Unknown]
    u: Array
    v: Array
    left: Sequence[Array]
    chi: float


@dataclass(frozen=True, eq=False)
class Refit:
    """A hypothesis at its best.

    grown: the core's machine with the effects, their numbers at zero; free: what is fitted of them
    u, v:  nuisances, shape (m,), and effects' numbers in their own scale, shape (k,)
    left:  per series, what is left (n,); slopes, columns: its derivatives (n, m), (n, k)
    chi:   chi^2, priors included
    """

    hypothesis: Hypothesis
    grown: Any
    free: Sequence[Unknown]
    u: Array
    v: Array
    left: Sequence[Array]
    slopes: Sequence[Array]
    columns: Sequence[Array]
    chi: float
    resolved: bool = True
    note: str = ""

    def values(self) -> dict[str, float]:
        """Path -> SI value of the effects' numbers."""
        return {p.path: p.value(float(x)) for p, x in zip(self.free, self.v, strict=True)}

    @property
    def machine(self) -> Any:
        """The core's machine with the effects at their values; its nominal numbers untouched."""
        return with_values(self.grown, self.free, self.v)

    def beyond(self) -> bool:
        """Whether an effect would have to be larger than it can be: a strength on its bound."""
        return any(
            is_strength(self.grown, p.path) and math.isfinite(p.high) and x > p.bounds[1] - 1e-6
            for p, x in zip(self.free, self.v, strict=True)
        )

    def at_bound(self) -> list[str]:
        """Effects' numbers that stand on a bound."""
        return [
            p.path
            for p, x in zip(self.free, self.v, strict=True)
            if abs(x - p.bounds[0]) < 1e-6 or abs(x - p.bounds[1]) < 1e-6
        ]


class Fitter:
    """Fits hypotheses to one evidence; `stop` ends a fit between two steps."""

    def __init__(self, evidence: Evidence, stop: Callable[[], bool] = lambda: False) -> None:
        self.evidence, self.stop = evidence, stop
        self.sizes = evidence.confrontation.sizes()

    def nominal(self, u: Array) -> Refit | None:
        """No effect at all: the nuisances at their best, from a start; None where it has none."""
        core, c = self.evidence.confrontation.core, self.evidence.confrontation
        left, slopes = c.left(core, u), c.slopes(core, u)
        if left is None or slopes is None:
            return None
        chi = self.evidence.chi(u, left)
        return self._fitted(Trial(Hypothesis(), core, [], u, np.zeros(0), left, chi), slopes)

    def tried(
        self,
        hypothesis: Hypothesis,
        starts: Iterable[Start],
        enough: float = -math.inf,
        slopes: Sequence[Array] = (),
    ) -> Trial | None:
        """The best of the starts; None where no balance shows it, or the time is up.

        enough: chi^2 below which no further start is tried
        slopes: of the nuisances, which then follow each start as far as these foretell

        Raises:
            ValueError: effects that can't sit there together.

        """
        c = self.evidence.confrontation
        grown, paths = hypothesis.put_in(c.core, self.sizes)
        free = hypothesis.unknowns(grown, paths, self.sizes)
        best: Trial | None = None
        improved = True
        for start in starts:
            if self.stop() or (best is not None and best.chi < enough):
                break
            if start.further and not improved:
                continue
            before = best
            u = np.clip(start.u, c.low, c.high)
            v = np.array([_coordinate(p, start.values.get(p.path)) for p in free])
            for _ in range(2 if slopes else 1):
                left = c.left(with_values(grown, free, v), u)
                if left is None:
                    break
                chi = self.evidence.chi(u, left)
                if best is None or chi < best.chi:
                    best = Trial(hypothesis, grown, free, u, v, left, chi)
                if slopes:
                    u = self._followed(u, left, slopes)
            improved = best is not before
        return best

    def _followed(self, u: Array, left: Sequence[Array], slopes: Sequence[Array]) -> Array:
        """The nuisances at their best beside what is left, as far as slopes foretell it."""
        c, rows = self.evidence.confrontation, self.evidence.rows(u, left, slopes)
        gram = rows.slopes.T @ rows.slopes + np.diag(rows.precision)
        pull = np.where(rows.precision > 0, rows.pull / rows.sigma, 0.0)
        gradient = rows.slopes.T @ rows.left - pull
        return u + bounded_step(gram, gradient, 0.0, c.low - u, c.high - u)

    def __call__(self, trial: Trial, slopes: Sequence[Array]) -> Refit:
        """A trial followed down.

        slopes: of the nuisances, near by, where it has none of its own
        """
        c = self.evidence.confrontation
        own = c.slopes(with_values(trial.grown, trial.free, trial.v), trial.u)
        return self._fitted(trial, own or slopes)

    def again(self, known: Refit, *, u: Array | None = None, fresh: bool = False) -> Refit:
        """A refit continued from where it stands, under this evidence.

        u: other nuisances to begin from: a wrong machine may have dragged them away
        fresh: whether slopes of its own are worth their time here
        """
        c = self.evidence.confrontation
        where, left = (known.u, known.left) if u is None else (u, c.left(known.machine, u))
        if left is None:
            return known
        slopes, columns = known.slopes, known.columns
        if fresh and not self.stop():
            slopes = c.slopes(known.machine, where) or known.slopes
            columns = secants(c, known.grown, known.free, where, known.v, left) or columns
        chi = self.evidence.chi(where, left)
        trial = Trial(known.hypothesis, known.grown, known.free, where, known.v, left, chi)
        return self._fitted(trial, slopes, columns)

    def _fitted(
        self, trial: Trial, slopes: Sequence[Array], columns: Sequence[Array] | None = None
    ) -> Refit:
        t = trial
        if columns is None:
            columns = secants(self.evidence.confrontation, t.grown, t.free, t.u, t.v, t.left)
        raw = (t.hypothesis, t.grown, t.free)
        if columns is None:
            note = "its slopes are not known"
            nothing = [np.zeros((len(x), len(t.v))) for x in t.left]
            return Refit(*raw, t.u, t.v, t.left, slopes, nothing, t.chi, False, note)
        m = len(t.u)
        jacobian = [np.concatenate(both, axis=1) for both in zip(slopes, columns, strict=True)]
        begin = Point(np.concatenate([t.u, t.v]), t.left, jacobian, t.chi)
        end, whole = descend(_OneHypothesis(self, t), begin, _STEPS, self.stop)
        return Refit(
            *raw,
            end.x[:m],
            end.x[m:],
            end.left,
            [j[:, :m] for j in end.jacobian],
            [j[:, m:] for j in end.jacobian],
            end.chi,
            whole,
            "" if whole else "cut by the time limit",
        )


class _OneHypothesis:
    """A hypothesis as a descent sees it (`descent.Problem`)."""

    def __init__(self, fitter: Fitter, trial: Trial) -> None:
        self.evidence, self._fitter, self._trial = fitter.evidence, fitter, trial
        c = self.evidence.confrontation
        self.low = np.concatenate([c.low, [p.bounds[0] for p in trial.free]])
        self.high = np.concatenate([c.high, [p.bounds[1] for p in trial.free]])
        self._known: Array | None = None  # where slopes were computed last

    def left(self, x: Array) -> list[Array] | None:
        return self.evidence.confrontation.left(self._machine(x), x[: self._count])

    def renewed(self, point: Point) -> list[Array] | None:
        same = self._known is not None and np.array_equal(point.x, self._known)
        if same or self._fitter.stop():
            return None
        self._known = point.x
        u, v = point.x[: self._count], point.x[self._count :]
        c = self.evidence.confrontation
        slopes = c.slopes(self._machine(point.x), u)
        columns = secants(c, self._trial.grown, self._trial.free, u, v, point.left)
        if columns is None:
            return None
        old = [j[:, : self._count] for j in point.jacobian]
        return [np.concatenate(b, axis=1) for b in zip(slopes or old, columns, strict=True)]

    @property
    def _count(self) -> int:
        return len(self._trial.u)

    def _machine(self, x: Array) -> Any:
        return with_values(self._trial.grown, self._trial.free, x[self._count :])


def _coordinate(p: Unknown, value: float | None) -> float:
    """A start in the unknown's own scale, inside its bounds."""
    if value is None:
        return p.start
    low, high = p.bounds
    return float(min(max(p.coordinate(value), low), high))
