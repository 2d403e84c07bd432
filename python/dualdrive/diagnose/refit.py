"""A hypothesis fitted: its effects' numbers and every nuisance together.

A fit begins where the change of the machine was seen to lower chi^2 most (`Trial`), since the
linear score foretells little once flanks change. The nuisances' slopes are the engine's own where
that is cheap, else those of the machine without the effect; those of the effects are secants, so
that every law can be fitted, limits and delays among them. See `descent.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.descent import Point, bounded_step, descend
from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.hypotheses import Hypothesis, is_strength
from dualdrive.diagnose.secants import secants, with_values
from dualdrive.estimation.unknowns import Unknown

Array = NDArray[np.float64]

_SIMULATED, _IN_A_BALANCE = 16, 60  # steps tried: a balance costs next to nothing


@dataclass(frozen=True, eq=False)
class Start:
    """Where a fit may begin: nuisances, shape (m,), and path -> SI value of the effects' numbers.

    Numbers that are not given begin at their usual size.

    further: the same way as the start before, and only worth its time if that was the best so far:
        a machine that sticks or hunts is slow to simulate
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
    """Fits hypotheses to one evidence; `stop` ends a fit between two simulations."""

    def __init__(self, evidence: Evidence, stop: Callable[[], bool] = lambda: False) -> None:
        self.evidence, self.stop = evidence, stop
        self.sizes = evidence.confrontation.sizes()

    def nominal(self, *starts: Array, renewals: int = 4) -> Refit | None:
        """No effect at all: the nuisances at their best, from each of several starts."""
        core, c = self.evidence.confrontation.core, self.evidence.confrontation
        found = []
        for u in starts:
            left, slopes = c.left(core, u), c.slopes(core, u)
            if left is not None and slopes is not None:
                trial = Trial(
                    Hypothesis(), core, [], u, np.zeros(0), left, self.evidence.chi(u, left)
                )
                found.append(self._fitted(trial, slopes, renewals=renewals))
        return min(found, key=lambda r: r.chi, default=None)

    def tried(
        self,
        hypothesis: Hypothesis,
        starts: Iterable[Start],
        enough: float = -math.inf,
        slopes: Sequence[Array] = (),
    ) -> Trial | None:
        """The best of the starts; None where none can be simulated, or the time is up.

        enough: chi^2 below which no further start is tried
        slopes: of the nuisances, which then follow each start as far as these foretell

        Raises:
            ValueError: effects that can't sit there together.

        """
        c = self.evidence.confrontation
        grown, paths = hypothesis.put_in(c.core, self.sizes, c.part_sizes(hypothesis.effects))
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

    def __call__(self, trial: Trial, slopes: Sequence[Array], *, renewals: int = 1) -> Refit:
        """A trial followed down.

        slopes: of the nuisances, near by: of the machine without the effect, say
        renewals: how often slopes of its own may be computed, at a dozen simulations each
        """
        c = self.evidence.confrontation
        if self._cheap(trial.grown):
            slopes = c.slopes(with_values(trial.grown, trial.free, trial.v), trial.u) or slopes
        elif self.is_late(trial.grown):  # its own would cost seconds
            slopes = c.slopes(c.core, trial.u) or slopes
        return self._fitted(trial, slopes, renewals=renewals)

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
        fresh = fresh and not self.stop() and not self.is_late(known.grown)
        if fresh:
            slopes = c.slopes(known.machine, where) or known.slopes
            columns = secants(c, known.grown, known.free, where, known.v, left) or columns
        chi = self.evidence.chi(where, left)
        trial = Trial(known.hypothesis, known.grown, known.free, where, known.v, left, chi)
        return self._fitted(trial, slopes, columns, renewals=2 if fresh else 0)

    def _cheap(self, grown: Any) -> bool:
        """Whether the engine's own slopes cost little: every law affine and none late."""
        if self.evidence.confrontation.mode == "balance":
            return True
        kinds = [_core.effect_type(e["effect"]) for e in grown.effects if not e["formula"]]
        plain = all(k.affine for k in kinds) and not self.is_late(grown)
        return plain and len(kinds) == len(grown.effects)

    def is_late(self, grown: Any) -> bool:
        """Whether any signal comes late: such a machine is slow to differentiate."""
        named = [e["effect"] for e in grown.effects if not e["formula"]]
        return any("delay" in _core.effect_type(name).acts_on for name in named)

    def _fitted(
        self,
        trial: Trial,
        slopes: Sequence[Array],
        columns: Sequence[Array] | None = None,
        *,
        renewals: int,
    ) -> Refit:
        t = trial
        if columns is None:
            columns = secants(self.evidence.confrontation, t.grown, t.free, t.u, t.v, t.left)
        raw = (t.hypothesis, t.grown, t.free)
        if columns is None:
            note = "its slopes can not be simulated"
            nothing = [np.zeros((len(x), len(t.v))) for x in t.left]
            return Refit(*raw, t.u, t.v, t.left, slopes, nothing, t.chi, False, note)
        m = len(t.u)
        jacobian = [np.concatenate(both, axis=1) for both in zip(slopes, columns, strict=True)]
        problem = _OneHypothesis(self, t, renewals)
        begin = Point(np.concatenate([t.u, t.v]), t.left, jacobian, t.chi)
        balance = self.evidence.confrontation.mode == "balance"
        most = _IN_A_BALANCE if balance else _SIMULATED
        end, whole = descend(problem, begin, most, self.stop)
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

    def __init__(self, fitter: Fitter, trial: Trial, renewals: int) -> None:
        self.evidence, self._fitter, self._trial = fitter.evidence, fitter, trial
        c = self.evidence.confrontation
        self.low = np.concatenate([c.low, [p.bounds[0] for p in trial.free]])
        self.high = np.concatenate([c.high, [p.bounds[1] for p in trial.free]])
        self._left = math.inf if c.mode == "balance" else renewals
        self._known: Array | None = None  # where slopes were computed last

    def left(self, x: Array) -> list[Array] | None:
        return self.evidence.confrontation.left(self._machine(x), x[: self._count])

    def renewed(self, point: Point) -> list[Array] | None:
        same = self._known is not None and np.array_equal(point.x, self._known)
        if self._left <= 0 or same or self._fitter.stop():
            return None
        self._left, self._known = self._left - 1, point.x
        u, v = point.x[: self._count], point.x[self._count :]
        c, slopes = self.evidence.confrontation, None
        if not self._fitter.is_late(self._trial.grown):
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
