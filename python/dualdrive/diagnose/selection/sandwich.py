"""How far a law's gain may be believed where what is left is not white to it.

Of a model that is not quite right the gain in -2 log L by numbers that are none is no chi-squared
but a weighted sum of such, the weights being eigenvalues of I^-1 J: I is the information on these
numbers, J the variance of their score, both at what the other numbers leave of them (White,
Econometrica 50 (1982) 1-25; Kent, Biometrika 69 (1982) 19-27). The inflation tells of up to
400 samples. A law that acts over minutes meets what residuals do over minutes, and a ripple what
they do at its frequency: J is told by sums of the score over batches (Alexopoulos, Seila, in Banks
(ed.), Handbook of Simulation, 1998, ch. 7).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.screening import residual_maker
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.forward import Means
from dualdrive.diagnose.selection.ranking import Ranking
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, carried, flat, slopes

Array = NDArray[np.float64]


def forget_what_colour_gains(own: Means, ranking: Ranking, grey: GreyBox) -> None:
    """Leaders forgotten while one of their laws gains no more than the colour of what is left.

    Args:
        own: of the search.
        ranking: what is known on these records; what is not believed is forgotten.
        grey: the records.

    """
    while (best := ranking.best).variant.effects and not grey.counter.stop():
        own.tell(f"what is left by {best.variant.key}, against each of its laws")
        columns = slopes(grey, best.point, range(len(best.point.theta)), best.gains)
        effects = best.variant.effects
        if all(_believed(own, ranking, grey, best, effect, columns) for effect in effects):
            break
        ranking.forget(best)


def _believed(
    own: Means,
    ranking: Ranking,
    grey: GreyBox,
    f: Fitted,
    effect: tuple[str, str],
    columns: Sequence[Array],
) -> bool:
    """Whether one law of a fitted machine gains enough over its own inflation.

    columns: derivatives of its innovations by all its unknowns
    """
    rest = own.library.without(f.variant, effect)
    others = {p.path for p in rest.extra} if rest else set()
    mine = [grey.shared + k for k, p in enumerate(f.variant.extra) if p.path not in others]
    if rest is None or not mine:
        return True
    precision = grey.believed(f.variant)[1]
    kept = [k for k in range(len(columns)) if k not in mine]
    apart = residual_maker([columns[k] for k in kept], precision[kept])
    alone = apart(np.stack([columns[k] for k in mine]))
    times = score_inflation(alone, f.point.residuals) / f.inflation
    if times <= 1.0:
        return True
    least = times * threshold("gain")
    if rest.key not in ranking:
        theta = carried(f.point, rest, np.zeros(grey.shared + len(rest.extra)))
        behind = f.point.minus_two_log + (least + len(mine) * ranking.price()) * f.inflation
        fewer = own.estimator.likeliest(grey, rest, theta, f.noise, rival=behind)
        if fewer is None:
            return True
        ranking.keep([fewer])
    return ranking.criterion(ranking[rest.key]) - ranking.criterion(f) > least


def score_inflation(columns: Array, residuals: Sequence[Array]) -> float:
    """By how much the gain of some numbers counts what is left, 1 if white.

    The mean of the eigenvalues of I^-1 J: the gain over it has the mean of a chi-squared of as many
    degrees of freedom (Rotnitzky, Jewell, Biometrika 77 (1990) 485-497).

    Args:
        columns: derivatives of the whitened innovations by these numbers, as far as no other number
            does the same, shape (numbers, rows).
        residuals: the innovations, records end to end, shape (samples, channels) each.

    """
    batch = _batches(residuals)
    sums = np.stack([np.bincount(batch, score) for score in columns * flat(residuals)])
    ratio = np.linalg.pinv(columns @ columns.T, hermitian=True) @ (sums @ sums.T)
    return float(np.trace(ratio)) / len(columns)


def _batches(residuals: Sequence[Array]) -> NDArray[np.intp]:
    """Of every row, end to end: its batch, a share of one record's time."""
    samples, found, first = sum(len(r) for r in residuals), [], 0
    for r in residuals:
        count = max(1, round(threshold("batches") * len(r) / samples))
        own = first + np.minimum(np.arange(len(r)) * count // len(r), count - 1)
        found.append(np.repeat(own, r.shape[1]))
        first += count
    return np.concatenate(found)
