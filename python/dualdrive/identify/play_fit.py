"""Robust regression over contact episodes, and the wild bootstrap of its figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.identify.contact import Episode
from dualdrive.identify.play_result import Interval

Array = NDArray[np.float64]

#: Huber's constant: 95 % efficiency on Gaussian noise
HUBER = 1.345
_TOLD = 1e-3  # of a figure that rounding may take in a projection


class PlayFit:
    """c + s P/2 − τ ω + κ T fitted to the deflections of settled contact.

    Samples of one episode share their errors (ring runout, quantisation, a skew that is not quite
    constant), so an episode is the unit of the bootstrap: its influence, what the solution would
    move by without it, is drawn anew with a random sign and size (A. Cameron, J. Gelbach, D.
    Miller, Rev. Econ. Stat. 90, 2008; six-point weights of M. Webb).

    Attributes:
        both: both flanks were loaded; else only the skew is fitted, a zero per record and flank.
        torque: working torque, the median magnitude, N*m.
        scatter: robust standard deviation of single samples, rad.
        spread: width of the middle 95 % of them, rad.

    """

    def __init__(self, episodes: Sequence[Episode], *, both: bool) -> None:
        self.episodes, self.both = episodes, both
        self.names = ["skew", "play", "compliance"] if both else ["skew"]
        self.groups = list(dict.fromkeys(self._group(e) for e in episodes))
        self.torque = float(np.median(np.abs(np.concatenate([e.torque for e in episodes]))))
        self._solve()

    def interval(self, name: str, confidence: float, draws: Array) -> Interval:
        """Symmetric about the value, widened for few episodes as Student does."""
        from scipy.stats import norm, t

        level = 0.5 + confidence / 2
        widen = float(t.ppf(level, self.freedom) / norm.ppf(level))
        value = float(self._reads(name) @ self.solution)
        reach = widen * float(np.quantile(np.abs(draws - value), confidence))
        return Interval(value, value - reach, value + reach)

    def told(self, name: str) -> bool:
        """Whether a figure is still known where any one episode is left out.

        The skew is not where there is one alone, nor where the ring rests in all of them.
        """
        row = self._reads(name)
        return bool(np.allclose(self._left @ row, row, atol=_TOLD))

    def draws(self, name: str, count: int, seed: int) -> Array:
        """Bootstrap draws of ``skew``, ``play``, ``compliance`` or ``loaded``, shape (count,)."""
        row = self._reads(name)
        sizes = np.sqrt([0.5, 1.0, 1.5])
        weights = np.random.default_rng(seed).choice(
            np.concatenate([-sizes, sizes]), (count, len(self.episodes))
        )
        result: Array = row @ self.solution + weights @ (self.influence @ row)
        return result

    def zero(self) -> dict[str, float]:
        """Deflection at mid-play by record; empty where one flank was never loaded."""
        if not self.both:
            return {}
        values = self.solution[len(self.names) :].tolist()
        return {record: v for (record, _), v in zip(self.groups, values, strict=True)}

    def _solve(self) -> None:
        y = np.concatenate([e.deflection for e in self.episodes])
        design = np.concatenate([self._columns(e) for e in self.episodes])
        weight = np.ones(len(y))
        for _ in range(20):  # reweighted, so that a sample still inside the play does not pull
            root = np.sqrt(weight)
            self.solution = np.linalg.lstsq(design * root[:, None], y * root, rcond=None)[0]
            left = y - design @ self.solution
            self.scatter = 1.4826 * float(np.median(np.abs(left)))
            weight = 1 / np.maximum(1.0, np.abs(left) / (HUBER * self.scatter + 1e-300))
        self.spread = float(np.diff(np.quantile(left, [0.025, 0.975]))[0])
        starts = np.cumsum([0] + [len(e.deflection) for e in self.episodes])[:-1]
        pulls = np.add.reduceat(design * (weight * left)[:, None], starts)
        outer = design[:, :, None] * (design * weight[:, None])[:, None, :]
        shares = np.add.reduceat(outer, starts)
        others = shares.sum(axis=0) - shares
        without = np.linalg.pinv(others, hermitian=True)
        self._left = without @ others  # projects on what is known without each episode
        self.influence = np.einsum("eij,ej->ei", without, pulls)
        self.freedom = max(len(self.episodes) - design.shape[1], 1)

    def _columns(self, episode: Episode) -> Array:
        """Rows of the regression: skew, play and compliance, then one zero per group."""
        n = len(episode.deflection)
        own = [-episode.speed]
        if self.both:
            own += [np.full(n, 0.5 * episode.flank), episode.torque]
        zeros = [np.full(n, float(self._group(episode) == group)) for group in self.groups]
        return np.column_stack(own + zeros)

    def _group(self, episode: Episode) -> tuple[str, int]:
        """Episodes that share a zero: a record's, and a flank's where the play is not known."""
        return episode.record, 0 if self.both else episode.flank

    def _reads(self, name: str) -> Array:
        """The row that reads a named figure off the solution."""
        row = np.zeros(len(self.solution))
        if name == "loaded":
            row[self.names.index("play")] = 1.0
            row[self.names.index("compliance")] = 2 * self.torque
        else:
            row[self.names.index(name)] = 1.0
        return row
