"""A hypothesis fitted: its effects' numbers and every nuisance together.

Levenberg-Marquardt on whitened rows. The nuisances' slopes are the engine's own where that is
cheap, else those of the machine without the effect (a chord, good enough because the nuisances
hardly move); those of the effects are secants, so that every law can be fitted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.hypotheses import Hypothesis, is_strength
from dualdrive.identify.unknowns import Unknown

Array = NDArray[np.float64]

_ROUNDS, _MANY = 8, 16  # of steps: simulated, and in a balance, which costs next to nothing
_REJECTED = 4  # growing dampings tried before a descent ends
_SETTLED = 0.3  # a fall of chi^2 that tells nothing
_ELSEWHERE = 4  # starts tried from other nuisances than those of the refitted machine
_RENEW = 0.03  # fall of chi^2, relative, that makes slopes worth renewing
_SECANT, _LEAST = 0.02, 0.1  # step of a secant: share of a number, and of its usual size


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
        return _at(self.grown, self.free, self.v)

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


def _at(grown: Any, free: Sequence[Unknown], v: Array) -> Any:
    core = grown.copy()
    for p, x in zip(free, v, strict=True):
        core.set(p.path, p.value(float(x)))
    return core


class Fitter:
    """Fits hypotheses to one evidence; `stop` ends a fit between two simulations.

    origins: nuisances, shape (m,) each, from which a fit may begin beside those of the machine
        without the effect, which the missing effect may have dragged far away
    """

    def __init__(
        self,
        evidence: Evidence,
        stop: Callable[[], bool] = lambda: False,
        origins: Sequence[Array] = (),
    ) -> None:
        self.evidence, self.stop, self.origins = evidence, stop, origins
        self.sizes = evidence.confrontation.sizes()

    def nominal(self, u: Array) -> Refit | None:
        """No effect at all: the nuisances at their best."""
        return self._descend(
            Hypothesis(), self.evidence.confrontation.core, [], u, np.zeros(0), None
        )

    def __call__(
        self, hypothesis: Hypothesis, base: Refit, starts: Sequence[dict[str, float]]
    ) -> Refit | None:
        """From the best of several starts (path -> SI value); None where none can be simulated."""
        c = self.evidence.confrontation
        grown, paths = hypothesis.put_in(c.core, self.sizes, c.part_sizes(hypothesis.effects))
        free = hypothesis.unknowns(grown, paths, self.sizes)
        best: tuple[float, Array, Array] | None = None
        for u in (base.u, *self.origins):
            for start in starts if u is base.u else starts[:_ELSEWHERE]:
                v = np.array([_coordinate(p, start.get(p.path)) for p in free])
                left = self.evidence.confrontation.left(_at(grown, free, v), u)
                if left is None or self.stop():
                    continue
                chi = self.evidence.chi(u, left)
                if best is None or chi < best[0]:
                    best = (chi, u, v)
        if best is None:
            return None
        chord = None if self._cheap(grown) else base.slopes
        return self._descend(hypothesis, grown, free, best[1], best[2], chord)

    def afresh(self, known: Refit, u: Array) -> Refit | None:
        """The same hypothesis from other nuisances: a wrong machine may have dragged them away."""
        at = _at(known.grown, known.free, known.v)
        chord = self.evidence.confrontation.slopes(at, u) if not self._late(known.grown) else None
        return self._descend(
            known.hypothesis, known.grown, known.free, u, known.v, chord or known.slopes
        )

    def again(self, known: Refit, *, fresh: bool = False) -> Refit:
        """A refit continued from where it stands, under this evidence.

        fresh: whether the engine's own slopes are worth their time here
        """
        chord: Sequence[Array] | None = known.slopes
        if fresh and not self._late(known.grown):
            at = _at(known.grown, known.free, known.v)
            chord = self.evidence.confrontation.slopes(at, known.u) or known.slopes
        found = self._descend(known.hypothesis, known.grown, known.free, known.u, known.v, chord)
        return found or replace(known, chi=self.evidence.chi(known.u, known.left))

    def _cheap(self, grown: Any) -> bool:
        """Whether the engine's own slopes cost little: every law affine and none late."""
        if self.evidence.confrontation.mode == "balance":
            return True
        kinds = [_core.effect_type(e["effect"]) for e in grown.effects if not e["formula"]]
        plain = all(k.affine for k in kinds) and not self._late(grown)
        return plain and len(kinds) == len(grown.effects)

    def _late(self, grown: Any) -> bool:
        """Whether any signal comes late: such a machine is slow to differentiate."""
        named = [e["effect"] for e in grown.effects if not e["formula"]]
        return any("delay" in _core.effect_type(name).acts_on for name in named)

    def _descend(
        self,
        hypothesis: Hypothesis,
        grown: Any,
        free: Sequence[Unknown],
        u: Array,
        v: Array,
        chord: Sequence[Array] | None,
        columns: Sequence[Array] | None = None,
    ) -> Refit | None:
        c, seen = self.evidence.confrontation, self.evidence
        left = c.left(_at(grown, free, v), u)
        slopes = chord if chord is not None else c.slopes(_at(grown, free, v), u)
        if left is None or slopes is None:
            return None
        columns = self._secants(grown, free, u, v, left) if columns is None else columns
        if columns is None:
            return None
        found = Refit(hypothesis, grown, free, u, v, left, slopes, columns, seen.chi(u, left))
        damping, cheap, renewed = 1e-4, c.mode == "balance", False
        for _ in range(_MANY if cheap else _ROUNDS):
            if self.stop():
                return replace(found, resolved=False, note="cut by the time limit")
            better, damping = self._step(found, damping)
            if better is None:
                if chord is None or renewed:
                    break
                own = c.slopes(found.machine, found.u)  # the chord leads nowhere from here
                if own is None:
                    break
                found, renewed, damping = replace(found, slopes=own), True, 1e-4
                continue
            gained = found.chi - better.chi
            v_moved = bool(len(free)) and bool(np.any(better.v != found.v))
            if chord is None and gained > (0.0 if cheap else _RENEW) * found.chi:
                slopes = c.slopes(better.machine, better.u) or found.slopes
            moved = self._secants(grown, free, better.u, better.v, better.left) if v_moved else None
            found = replace(better, slopes=slopes, columns=moved or found.columns)
            if gained < _SETTLED:
                break
        return found

    def _step(self, at: Refit, damping: float) -> tuple[Refit | None, float]:
        """A step that lowers chi^2, None where none of the dampings finds one."""
        c, seen = self.evidence.confrontation, self.evidence
        rows = seen.rows(at.u, at.left, at.slopes)
        jacobian = np.concatenate([rows.slopes, seen.white(at.columns)], axis=1)
        m = len(at.u)
        belief = np.concatenate([rows.precision, np.zeros(len(at.v))])
        gradient = jacobian.T @ rows.left
        gradient[:m] -= np.where(rows.precision > 0, rows.pull / rows.sigma, 0.0)
        gram = jacobian.T @ jacobian + np.diag(belief)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
        low = np.concatenate([c.low, [p.bounds[0] for p in at.free]])
        high = np.concatenate([c.high, [p.bounds[1] for p in at.free]])
        here = np.concatenate([at.u, at.v])
        for _ in range(_REJECTED):
            step = _bounded(gram, gradient, scale, damping, low - here, high - here)
            if not np.isfinite(step).all():
                break
            there = here + step
            u, v = there[:m], there[m:]
            left = c.left(_at(at.grown, at.free, v), u)
            if left is not None:
                chi = seen.chi(u, left)
                if chi < at.chi:
                    return replace(at, u=u, v=v, left=left, chi=chi), max(damping / 10, 1e-8)
            damping = max(damping, 1e-4) * 10
            if self.stop():
                break
        return None, damping

    def _secants(
        self, grown: Any, free: Sequence[Unknown], u: Array, v: Array, left: Sequence[Array]
    ) -> list[Array] | None:
        """Change of every series per effects' number, (n, k) each."""
        c = self.evidence.confrontation
        found = []
        for j, p in enumerate(free):
            step = _SECANT * max(abs(float(v[j])), _LEAST * max(1.0, abs(p.start)))
            if v[j] + step > p.bounds[1]:
                step = -step
            moved = v.copy()
            moved[j] += step
            there = c.left(_at(grown, free, moved), u)
            if there is None:
                return None
            found.append([(b - a) / step for a, b in zip(left, there, strict=True)])
        if not found:
            return [np.zeros((len(part), 0)) for part in left]
        return [np.stack(parts, axis=1) for parts in zip(*found, strict=True)]


def _bounded(
    gram: Array, gradient: Array, scale: Array, damping: float, low: Array, high: Array
) -> Array:
    """The damped step inside its bounds: what would leave them is held there, the rest solved."""
    free = np.ones(len(gradient), dtype=bool)
    step = np.zeros(len(gradient))
    for _ in range(len(gradient)):
        rows = np.flatnonzero(free)
        if not len(rows):
            break
        right = gradient + gram @ np.where(free, 0.0, step)
        even = gram[np.ix_(rows, rows)] * np.outer(scale[rows], scale[rows])
        even[np.diag_indices_from(even)] += damping + 1e-10
        step[rows] = -scale[rows] * np.linalg.solve(even, scale[rows] * right[rows])
        outside = free & ((step < low) | (step > high))
        if not outside.any():
            break
        step = np.clip(step, low, high)
        free &= ~outside
    result: Array = np.clip(step, low, high)
    return result


def _coordinate(p: Unknown, value: float | None) -> float:
    """A start in the unknown's own scale, inside its bounds."""
    if value is None:
        return p.start
    low, high = p.bounds
    return float(min(max(p.coordinate(value), low), high))
