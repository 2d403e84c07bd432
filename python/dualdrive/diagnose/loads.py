"""Where a load sets in and ends: nobody tells its hour, so it is looked for in what is left.

The sum at the table of a torque balance shows a load as a box in time, the same in every record.
Steps at a grid of instants, the nuisances' share removed, give the fall of chi^2 of every box at
once, since a box is the difference of two steps; a harmonic is then looked for inside the best one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.candidates import possible
from dualdrive.diagnose.evidence import Evidence
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.stage import Score
from dualdrive.diagnose.whitening import count_as_one

Array = NDArray[np.float64]

LOAD = ("cutting_torque", "table")
_PATH = "@".join(LOAD)
INSTANTS, FINER = 160, 12  # of the grid over all records; between two of them
_SHORTEST = 3  # steps of the grid: a box
#: fall of chi^2, in units of the noise that is left, below which no box, and no harmonic, is named
_A_BOX, _A_WAVE = 15.0, 25.0
PERIODS, PER_PERIOD = 2.0, 5.0  # in the box, at least; steps of frequency per 1 / duration
HIGHEST = 0.4  # frequency, of the sampling rate
#: harmonics that are tried; of the strongest one's gain, at least; between two, of 1 / duration
_SEVERAL, _ABOUT, _APART = 3, 0.5, 1.5
_MOST = 600  # frequencies tried, the lowest first: a long load would take for ever


@dataclass(frozen=True, eq=False)
class _Sum:
    """The sums at the table of all records as white rows, beside what nuisances can imitate.

    t:      time, (n,); weight: what whitens a row, (n,)
    rest:   what the machine leaves, the nuisances' share removed, (n,)
    slopes: of the nuisances, (n, m); inverse: of their normal matrix over all rows, (m, m)
    every:  sampling interval, s
    """

    t: Array
    weight: Array
    rest: Array
    slopes: Array
    inverse: Array
    every: float

    def white(self, columns: Array) -> Array:
        """White rows of columns (n, k)."""
        return columns * self.weight[:, None]

    def inner(self, columns: Array) -> Array:
        """Products of white columns (n, k) with each other, nuisances free, (k, k)."""
        seen = self.slopes.T @ columns
        result: Array = columns.T @ columns - seen.T @ self.inverse @ seen
        return result

    def fitted(self, columns: Array) -> tuple[float, Array]:
        """Fall of chi^2 by white columns (n, k) at their best strengths, and these, (k,)."""
        pull = columns.T @ self.rest
        strengths = np.asarray(np.linalg.lstsq(self.inner(columns), pull, rcond=1e-9)[0], float)
        return float(pull @ strengths), strengths

    def noise(self, columns: Array) -> float:
        """What a chi^2 counts in under the noise that white columns (n, k) leave, not the load."""
        _, strengths = self.fitted(columns)
        own = columns - self.slopes @ (self.inverse @ (self.slopes.T @ columns))
        left = self.rest - own @ strengths
        return float(np.mean(left**2)) * count_as_one(left) or 1.0

    def box(self, start: float, end: float) -> Array:
        """One from start to end, (n,)."""
        return ((self.t >= start) & (self.t < end)).astype(float)


def sought(seen: Evidence, base: Refit) -> list[Hypothesis]:
    """A load in time, where one stands out of what a torque balance leaves.

    In a noisy balance the strongest harmonic may be a wrong one: the next ones that gain about as
    much are hypotheses, too.

    Args:
        seen: the balance under white noise.
        base: the machine refitted without a load.

    Returns:
        Hypotheses with start, duration and the frequency of a harmonic, from where a refit goes
        on, the strongest first; without a frequency where there is no harmonic, and none where no
        load stands out.

    """
    table = _sum(seen, base)
    if table is None or possible(seen.confrontation.core, *LOAD) is None:
        return []
    grid = np.linspace(table.t.min(), table.t.max() + table.every, INSTANTS)
    step = float(grid[1] - grid[0])
    start, end, _ = _best_box(table, grid, grid, _SHORTEST * step)
    near = step * np.linspace(-1.0, 1.0, 2 * FINER + 1)
    start, end, gain = _best_box(table, start + near, end + near, step)
    if gain < _A_BOX * table.noise(table.white(table.box(start, end)[:, None])):
        return []
    harmonics, count = _harmonics(table, start, end)
    if not harmonics:
        return [hypothesis(start, end, {}, INSTANTS)]
    turned = math.pi if _turned(seen, base, hypothesis(start, end, {}, 1)) else 0.0
    found = []
    for frequency, phase in harmonics:
        late = math.remainder(phase + turned, 2 * math.pi) / (2 * math.pi * frequency)
        begins = {f"{_PATH}.frequency": frequency}  # its sine begins where the load does
        found.append(hypothesis(start - late, end, begins, INSTANTS * count))
    return found


def stands_out(score: Score) -> bool:
    """Whether it is a load whose hour was looked for: what was found stands out already."""
    return LOAD in score.signature.hypothesis.effects


def hypothesis(start: float, end: float, more: dict[str, float], searched: int) -> Hypothesis:
    """A load from start to end, s, found among so many; more: path -> value of its wave."""
    begins = {f"{_PATH}.start": start, f"{_PATH}.duration": end - start, **more}
    return Hypothesis((LOAD,), {}, {_PATH: searched}, begins)


def _sum(seen: Evidence, base: Refit) -> _Sum | None:
    c = seen.confrontation
    rows = seen.rows(base.u, base.left, base.slopes)
    normal = rows.slopes.T @ rows.slopes + np.diag(rows.precision)
    inverse = np.asarray(np.linalg.pinv(normal, rcond=1e-10, hermitian=True), float)
    rest = rows.left - rows.slopes @ (inverse @ (rows.slopes.T @ rows.left))
    weight = seen.white([np.ones(len(s.t)) for s in c.series])
    mine = np.concatenate([np.full(len(s.t), s.name == "total") for s in c.series]) & (weight > 0)
    t = np.concatenate([s.t for s in c.series])
    if mine.sum() < INSTANTS:
        return None
    every = max(float(np.median(np.diff(s.t))) for s in c.series)
    return _Sum(t[mine], weight[mine], rest[mine], rows.slopes[mine], inverse, every)


def _best_box(table: _Sum, starts: Array, ends: Array, least: float) -> tuple[float, float, float]:
    """Start, end and fall of chi^2 of the best box no shorter than the least, s."""
    instants = np.concatenate([starts, ends])
    steps = table.white((table.t[:, None] >= instants).astype(float))
    inner, pull, n = table.inner(steps), steps.T @ table.rest, len(starts)
    power = np.diag(inner)
    both = power[:n, None] + power[None, n:] - 2 * inner[:n, n:]
    gain = (pull[:n, None] - pull[None, n:]) ** 2 / np.maximum(both, 1e-9 * power.max())
    gain[ends[None, :] - starts[:, None] < least] = 0.0
    i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
    return float(starts[i]), float(ends[j]), float(gain[i, j])


def _harmonics(table: _Sum, start: float, end: float) -> tuple[list[tuple[float, float]], int]:
    """Frequency and phase at the start of the strongest harmonics; among how many frequencies."""
    alone, _ = table.fitted(_waves(table, start, end, 0.0)[:, :1])
    low, high = PERIODS / (end - start), HIGHEST / table.every
    several = np.arange(low, high, 1.0 / (PER_PERIOD * (end - start)))[:_MOST]
    gains = np.array([table.fitted(_waves(table, start, end, f))[0] for f in several]) - alone
    found: list[tuple[float, float]] = []
    least = 0.0
    for k in np.argsort(-gains):
        f = float(several[k])
        if len(found) == _SEVERAL or gains[k] < least:
            break
        if any(abs(f - other) * (end - start) < _APART for other, _ in found):
            continue  # the same peak
        waves = _waves(table, start, end, f)
        _, strengths = table.fitted(waves)
        least = max(_ABOUT * gains[k], _A_WAVE * table.noise(waves)) if not found else least
        if gains[k] >= least:
            found.append((f, math.atan2(float(strengths[2]), float(strengths[1]))))
    return found, len(several)


def _waves(table: _Sum, start: float, end: float, frequency: float) -> Array:
    """A constant, a sine and a cosine from start to end, white, (n, 3)."""
    turned = 2 * np.pi * frequency * (table.t - start)
    waves = np.stack([np.ones_like(turned), np.sin(turned), np.cos(turned)], axis=1)
    return table.white(table.box(start, end)[:, None] * waves)


def _turned(seen: Evidence, base: Refit, load: Hypothesis) -> bool:
    """Whether what is left for want of a load has the load's sign turned, as the core has it."""
    c = seen.confrontation
    grown, _ = load.put_in(c.core)
    grown.set(f"{_PATH}.mean", c.sizes()["torque"])
    left = c.left(grown, base.u)
    return left is not None and float((seen.white(left) - seen.white(base.left)).sum()) > 0.0
