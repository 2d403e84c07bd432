"""When a load sets in and ends: the generalized likelihood ratio of a torque in time.

A torque u at the table that a model lacks leaves in the innovations of a filter with gains held

    r_k = sum over i of h_i u_(k-i),   h_i = S^(-1/2) C (F (1 - K C))^(i-1) b,

b what it does to the states over a sample. lambda_j = sum over i of h_i' r_(j+i) is the score of a
torque at sample j alone. Sums of it tell the likelihood ratio of every box in time, and of every
wave within one (Willsky, Jones, IEEE Transactions on Automatic Control 21 (1976) 108-112), as far
as the machine keeps to the modes in which all meshes carry. Most of what a constant load tells it
tells as it sets in and ends, so that a box has the law's own edges: one that is eased over a rise
is a sharp one, as much shorter, averaged over it. What the machine's numbers could do as well is
not taken off here: a score test does that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.loads import (
    FINER,
    HIGHEST,
    INSTANTS,
    LOAD,
    PER_PERIOD,
    PERIODS,
    hypothesis,
)
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import GreyBox, Noise, Point, inflation
from dualdrive.innovations.records import Predictable
from dualdrive.replay.record import with_settings

Array = NDArray[np.float64]

_LONGEST = 4096  # samples that innovations remember a torque
_ABOUT = 3  # periods before and after, where a wave may begin
_HEARD = 1e-3  # of the most that any frequency tells: of a wave that is fainter noise tells as much


@dataclass(frozen=True, eq=False)
class _Score:
    """Of a torque at every sample of a record.

    t: s, shape (n,)
    score: lambda, shape (n,); response: h, shape (samples, channels)
    eased: lambda of a torque that sets in over a rise, shape (n,)
    power: of that, sum of h_i' h_(i+d) by the distance d, shape (n,)
    """

    t: Array
    score: Array
    response: Array
    eased: Array
    power: Array

    def before(self, instants: Array) -> tuple[NDArray[np.intp], Array]:
        """How many samples lie before instants, and the sum of `eased` there, shape as these."""
        k = np.searchsorted(self.t, instants)
        return k, np.concatenate([[0.0], np.cumsum(self.eased)])[k]

    def information(self) -> Array:
        """Of a torque that lasts 0 .. n samples, shape (n + 1,)."""
        d = np.arange(1, len(self.power))
        near, far = np.cumsum(self.power[1:]), np.cumsum(d * self.power[1:])
        lasting = np.arange(2, len(self.power) + 1)
        found = np.zeros(len(self.t) + 1)
        found[1:] = self.power[0] * np.arange(1, len(self.power) + 1)
        found[2:] += 2.0 * (lasting * near - far)
        return found


def loads(grey: GreyBox, point: Point, gains: Sequence[Any], noise: Noise) -> list[Hypothesis]:
    """A load in time, where one stands out of what a machine leaves; none, where none does.

    Args:
        grey: whole records.
        point: the machine at a point.
        gains: Kalman gains there, per record.
        noise: under which these are; no load is told where no torque of unknown course acts on the
            table.

    Returns:
        One hypothesis, with the start, the duration and, where a wave stands out too, the frequency
        from which a refit goes on.

    """
    effect, body = LOAD
    if body not in noise.torque or LOAD in point.variant.effects:
        return []
    core = grey.machine(point.variant, point.theta)
    column = sorted(noise.torque).index(body)
    kind = _core.effect_type(effect)
    [rise] = [float(p.standard) for p in kind.parameters if p.path == "rise"]
    jobs = zip(grey.records, point.residuals, gains, strict=True)
    known = [_score(core, record, left, own, column, rise) for record, left, own in jobs]
    grid = np.linspace(min(x.t[0] for x in known), max(x.t[-1] for x in known), INSTANTS)
    step = float(grid[1] - grid[0])
    start, end, _ = _best(_boxes(known, grid, grid - rise), grid, grid)
    near = step * np.linspace(-1.0, 1.0, 2 * FINER + 1)
    starts, ends = start + near, end + near
    start, end, gain = _best(_boxes(known, starts, ends - rise), starts, ends)
    over, least = inflation(point), threshold("gain")
    if gain / over - 4.0 * math.log(INSTANTS) < least:
        return []
    looks, wave = INSTANTS**2, dict[str, float]()
    frequency, late, more, tried = _wave(known, start, end)
    if more / over - 2.0 * math.log(max(tried, 1)) > least:
        # its sine begins where the load does: by whole periods the two tell together
        starts = start + late + np.arange(-_ABOUT, _ABOUT + 1) / frequency
        ends = end + max(step, _ABOUT / frequency) * np.linspace(-1.0, 1.0, 4 * FINER + 1)
        both = _boxes(known, starts, ends - rise) + _waves(known, starts, ends, frequency)
        start, end, _ = _best(both, starts, ends)
        wave, looks = {f"{effect}@{body}.frequency": frequency}, looks * tried
    return [hypothesis(start, end, wave, looks)]


def _score(
    core: Any, record: Predictable, left: Array, gains: Any, column: int, rise: float
) -> _Score:
    there = with_settings(core, record.record.settings)
    F, C, states = _core.linear_filter(there, record.sampled, gains)
    K = [gains.K(phase) for phase in range(len(F))]
    whitening = [gains.whitening(phase) for phase in range(len(F))]
    n = len(left)
    moved = np.zeros(len(C.T))
    moved[:states] = F[0][:states, states + column]
    response = np.zeros((min(n, _LONGEST), len(C)))
    for i in range(1, len(response)):
        phase = i % len(F)
        shown = C @ moved
        response[i] = whitening[phase] @ shown
        moved = F[phase] @ (moved - K[phase] @ shown)
    room = 1 << (2 * n - 1).bit_length()
    r, h = np.fft.rfft(left, room, axis=0), np.fft.rfft(response, room, axis=0)
    edge = np.fft.rfft(_edge(rise / record.sampled.step), room)
    score = np.sum(r * h.conj(), axis=1)
    power = np.sum(np.abs(h) ** 2, axis=1) * np.abs(edge) ** 2
    told = (np.fft.irfft(own, room)[:n] for own in (score, score * edge.conj(), power))
    own, eased, power = told
    return _Score(np.asarray(record.record.t[:n], dtype=np.float64), own, response, eased, power)


def _edge(samples: float) -> Array:
    """By how much a load that sets in over so many samples grows from one to the next."""
    return np.diff(_core.eased([k / max(samples, 1.0) for k in range(math.ceil(samples) + 2)]))


def _boxes(known: Sequence[_Score], starts: Array, ends: Array) -> Array:
    """Fall of -2 log L of every box, shape (starts, ends); what lasts all the time is no load."""
    pull = np.zeros((len(starts), len(ends)))
    information, amid = np.zeros_like(pull), np.zeros(pull.shape, dtype=bool)
    for own in known:
        (first, begun), (last, done) = own.before(starts), own.before(ends)
        lasts = np.maximum(last[None, :] - first[:, None], 0)
        pull += np.where(lasts > 0, done[None, :] - begun[:, None], 0.0)
        information += own.information()[lasts]
        amid |= (lasts > 0) & (lasts < len(own.t))
    told = amid & (information > 0.0)
    return np.where(told, pull**2 / np.maximum(information, 1e-300), 0.0)


def _waves(known: Sequence[_Score], starts: Array, ends: Array, frequency: float) -> Array:
    """The same of a wave of this frequency, in every box."""
    pull = np.zeros((len(starts), len(ends)), dtype=complex)
    information = np.zeros(pull.shape)
    for own in known:
        turned = np.exp(-2j * np.pi * frequency * own.t)
        sums = np.concatenate([[0.0], np.cumsum(own.score * turned)])
        first, last = np.searchsorted(own.t, starts), np.searchsorted(own.t, ends)
        lasts = np.maximum(last[None, :] - first[:, None], 0)
        pull += np.where(lasts > 0, sums[last][None, :] - sums[first][:, None], 0.0)
        heard = turned[: len(own.response)] @ own.response
        information += lasts * float(np.sum(np.abs(heard) ** 2))
    told = information > 0.0
    return np.where(told, 2.0 * np.abs(pull) ** 2 / np.maximum(information, 1e-300), 0.0)


def _best(gain: Array, starts: Array, ends: Array) -> tuple[float, float, float]:
    """Start and end, s, of the largest gain, and that; shape of all (starts, ends)."""
    lasting = np.where(ends[None, :] > starts[:, None], gain, 0.0)
    i, j = np.unravel_index(int(np.argmax(lasting)), gain.shape)
    return float(starts[i]), float(ends[j]), float(lasting[i, j])


def _wave(known: Sequence[_Score], start: float, end: float) -> tuple[float, float, float, int]:
    """The strongest wave in a box.

    Returns:
        Frequency, Hz; how much later than the box it begins, s; its fall of -2 log L; and among how
        many frequencies it is.

    """
    from scipy.signal import zoom_fft

    every = max(float(np.median(np.diff(x.t))) for x in known)
    low, high = PERIODS / (end - start), HIGHEST / every
    count = int((high - low) * PER_PERIOD * (end - start))
    if count < 1:
        return 0.0, 0.0, 0.0, 0
    frequency = np.linspace(low, high, count, endpoint=False)
    pull, information = np.zeros(count, dtype=complex), np.zeros(count)
    for own in known:
        (first, last), _ = own.before(np.array([start, end]))
        if last <= first:
            continue
        rate = 1.0 / float(np.median(np.diff(own.t)))
        turned = np.exp(-2j * np.pi * frequency * (own.t[first] - start))
        pull += turned * zoom_fft(own.score[first:last], [low, high], count, fs=rate)
        heard = zoom_fft(own.response, [low, high], count, fs=rate, axis=0)
        information += float(last - first) * np.sum(np.abs(heard) ** 2, axis=1)
    told = information > _HEARD * np.max(information)
    gain = np.where(told, 2.0 * np.abs(pull) ** 2 / np.maximum(information, 1e-300), 0.0)
    k = int(np.argmax(gain))
    # the torque is |c| cos(w (t - start) + arg c), the law's -a sin(w (t - its start))
    period = 1.0 / float(frequency[k])
    late = (0.25 - np.angle(pull[k]) / (2.0 * np.pi)) * period
    return float(frequency[k]), math.remainder(late, period), float(gain[k]), count
