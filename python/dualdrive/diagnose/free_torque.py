"""What a torque of any course could still explain: no law is asked.

Torques and readings without a law (`courses.py`) are scored on what a refit leaves, as signatures
are. Noise that the series of a record share, and noise that a filter has coloured beyond what the
whiteners know of, makes courses gain. The first is reckoned for each course; for the second all
are divided by what the middle one gains more than noise would let it (Devlin and Roeder, Biometrics
55, 1999, 997-1004, do so with genes).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.courses import Kind, courses
from dualdrive.diagnose.evidence import Evidence, alike, effective, shared_curvature
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.stage import scale_of

Array = NDArray[np.float64]

#: chance, log10, the looking paid for, below which a course is surely there
RARER_THAN = -4.0
_ALIKE = 1e-8  # of the largest curvature: columns are one


@dataclass(frozen=True)
class Course:
    """A torque, or an error of a reading, that a free curve explains.

    kind:    what it follows; ``readings``: a channel that drifts or takes from others
    place:   body it acts on; of readings the channel
    gain:    fall of chi^2 over its inflation; numbers: of the curve
    chance:  log10 of how often noise alone would gain as much in any of the courses tried
    """

    kind: Kind
    place: str
    gain: float
    numbers: int
    chance: float


def courses_left(
    seen: Evidence,
    refit: Refit,
    stop: Callable[[], bool] = lambda: False,
    rarer_than: float = RARER_THAN,
) -> list[Course]:
    """Courses of what a refit leaves, each kind at each place, the rarest first.

    None where not even the first is as rare as it must be, surely there unless something else is
    asked for: the others only tell how well it is placed. A
    closed loop alone shows any: the floors of a torque balance are reckoned, not seen. Nothing is
    told where no pulse has an answer, or once `stop` asks for an end.
    """
    from scipy.stats import chi2

    c = seen.confrontation
    if c.mode != "closed_loop":
        return []
    scorer, over = scale_of(seen, refit).scorer, effective(seen.white(refit.left), seen)
    shared, tried = _Shared(seen, refit.left), list[Course]()
    for kind, place, columns in courses(c, refit):
        if stop():
            return []
        white = seen.white(columns)
        share, numbers = shared(scorer.rest(white))
        if numbers:
            tried.append(Course(kind, place, scorer(white).gain / over / share, numbers, 0.0))
    if all(x.kind == "readings" for x in tried):
        return []
    colour = max(float(np.median([x.gain / chi2.median(x.numbers) for x in tried])), 1.0)
    best: dict[tuple[str, str], Course] = {}
    for x in tried:
        gain = x.gain / colour
        chance = min(_log_chance(gain, x.numbers) + math.log10(len(tried)), 0.0)
        known = best.get((x.kind, x.place))
        if known is None or chance < known.chance:
            best[x.kind, x.place] = replace(x, gain=gain, chance=chance)
    found = sorted(best.values(), key=lambda x: x.chance)
    return found if found[0].chance < rarer_than else []


def _log_chance(gain: float, numbers: int) -> float:
    """Log10 of how often noise gains as much with so many numbers."""
    from scipy.stats import chi2

    half, a = max(gain, 0.0) / 2.0, numbers / 2.0
    chance = float(chi2.logsf(2.0 * half, numbers))
    if not math.isfinite(chance):  # Abramowitz and Stegun 6.5.32: too rare for a number
        chance = (a - 1.0) * math.log(half) - half - math.lgamma(a)
    return chance / math.log(10.0)


class _Shared:
    """By how much noise that series of one record share makes columns gain.

    The table's encoder is in the following error and in every deflection. A sum of chi-squared
    over such series counts it more than once, and most where a column looks alike in all of them:
    the mean eigenvalue of their design (Rao and Scott, Annals of Statistics 12, 1984, 46-60).
    """

    def __init__(self, seen: Evidence, left: Sequence[Array]) -> None:
        self.seen, self.alike = seen, alike(seen, left)

    def __call__(self, rest: Array) -> tuple[float, int]:
        """Factor, 1 or more, and rank of white columns (n, k), the nuisances' share removed."""
        size = np.linalg.norm(rest, axis=0)
        kept = rest[:, size > _ALIKE * size.max(initial=0.0)] if size.any() else rest[:, :0]
        if not kept.shape[1]:
            return 1.0, 0
        kept = kept / np.linalg.norm(kept, axis=0)
        gram, meat = kept.T @ kept, shared_curvature(self.seen, self.alike, kept)
        rank = int(np.linalg.matrix_rank(gram, tol=_ALIKE * len(gram), hermitian=True))
        inverse = np.linalg.pinv(gram, rcond=_ALIKE, hermitian=True)
        return max(float(np.trace(inverse @ meat)) / max(rank, 1), 1.0), rank
