"""Numbers and noise by maximum likelihood, together.

-2 log L = sum |r|^2 + sum log det S + priors falls by Gauss-Newton steps in the numbers. The
logarithms of the noise go where the spectra of what is left have them likeliest (`whittle`), and
where spectra promise more than they hold, and at the end, by Fisher scoring together with the
numbers: the information of the two is block-diagonal where the model is right (Ljung, System
Identification, 2nd ed., ch. 7 and 9), but not on the way there.

A noise that is but guessed comes first, numbers held: residuals that it leaves correlated count
themselves many times over, and would lead the numbers astray (feasible generalized least squares:
Greene, Econometric Analysis, 7th ed., ch. 9).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dualdrive.innovations.derivatives import slopes
from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.levenberg_marquardt import (
    SHORTER,
    as_foretold,
    covariance,
    inflation,
    promised,
    step_within,
)
from dualdrive.innovations.noise import LEAST_CREEP, Logarithms, Noise
from dualdrive.innovations.variant import Point, Variant, flat
from dualdrive.innovations.whittle import WhittleLikelihood

Array = NDArray[np.float64]

#: numbers of a variant and what they leave, under a noise
Place = tuple[Point, Noise]
_Found = tuple[Point, list[Any]]

_STEP = 1e-3  # of a logarithm, for finite differences
_LONGEST = 1.5  # step of a logarithm
_DAMPINGS = (1e-4, 0.03, 1.0, 30.0)
#: of what a step promises: one that brings less is tried at a share of its length, too, and if that
#: brings less as well, spectra are believed no more; only rough searches end otherwise for it
_FAIR = 0.2
_LATELY = 3  # steps, whose best is the present rate of a search
#: of -2 log L over the inflation: a step that brings less ends the search; one that only comes near
_ENOUGH, _NEARLY = 2.0, 50.0
#: how far numbers (of what is believed of them) and logarithms of the noise may be from where
#: derivatives were taken: a chord serves till then, while steps bring what it promises
_NEAR = (0.3, 2.0)


def maximum_likelihood(
    grey: GreyBox,
    variant: Variant,
    theta: Array,
    noise: Noise,
    *,
    floor: Noise | None = None,
    rival: float = -np.inf,
    roughly: bool = False,
    guessed: bool = False,
    steps: int = 40,
) -> tuple[Point, Noise, list[Any]] | None:
    """Numbers and noise under which the records are likeliest, and the gains there.

    None where the filter is lost from the first.

    Args:
        grey: records and shared unknowns.
        variant: what is fitted.
        theta: where its numbers begin, shape (unknowns,).
        noise: where the noise begins.
        floor: less drives nothing; see `least_noise`.
        rival: -2 log L of what leads: a search that would not come up to it at its present rate
            within the steps that it has left ends at once.
        roughly: whether coming near is enough.
        guessed: whether the noise is no estimate yet, near these numbers or others.
        steps: most iterations.

    """
    search = _Search(grey, variant, theta, noise, floor)
    now = search.at([search.begin])[0]
    if now is None:
        return None
    x, held = search.begin, guessed
    exact = False  # whether the noise goes by differences of replays, and no more by spectra
    derivatives: _Derivatives | None = None
    lately = [np.inf] * _LATELY
    for left in reversed(range(steps)):
        if grey.counter.stop():
            break
        point = now[0]
        least = (_NEARLY if roughly and exact else _ENOUGH) * inflation(point)
        fresh = derivatives is None or search.is_far(x, derivatives)
        if derivatives is None or fresh:
            derivatives = search.derivatives(x, now, numbers=not held, exact=exact)
        spectra = None if exact else search.spectra(now)
        gain = 0.0
        for damping in _DAMPINGS:
            step = search.step(x, point, derivatives, damping, spectra)
            gain = step.gain
            if gain < least and not exact:
                break
            lower = search.lower(x, point, step)
            if lower is not None:
                x, now = lower
            if lower is not None or gain < least:
                break
        gained = point.minus_two_log - now[0].minus_two_log
        little, failed = gained < least, gain > least and gained < _FAIR * gain
        if not as_foretold(gained, gain):
            derivatives = None
        if held and not failed:
            held, derivatives = not little, None if little else derivatives
            continue
        held, was_exact, exact = False, exact, exact or failed
        lately = [*lately[1:], gained]
        if now[0].minus_two_log - left * max(lately) > rival > -np.inf:
            break
        if little:
            if fresh and (was_exact or (roughly and not failed)):
                break
            exact = exact or fresh
            derivatives = None  # the chord, not the likelihood, may have come to its end
    return now[0], search.noise(x), now[1]


def score_of_order_two(
    grey: GreyBox, variant: Variant, theta: Array, noise: Noise, floor: Noise | None = None
) -> float:
    """The score test of sensors' noise of order two against one of order one that was fitted.

    What fitting it would take off -2 log L, were that a parabola: chi-squared of as many degrees
    of freedom as there are kinds of channels where the noise is of order one (Rao, Mathematical
    Proceedings of the Cambridge Philosophical Society 44 (1948) 50-57). What has been fitted has
    no slope left, or presses against its bound. Infinite where the filter is lost.

    Args:
        grey: records and shared unknowns.
        variant: what was fitted.
        theta: its numbers, shape (unknowns,).
        noise: the noise that was fitted, of order one.
        floor: less drives nothing; see `least_noise`.

    """
    search = _Search(grey, variant, theta, noise.of_order_two(), floor)
    now = search.at([search.begin])[0]
    if now is None:
        return np.inf
    H, g = search.normal(search.begin, now[0], search.by_noise(search.begin, now))
    two = search.second
    # of creep where nothing rests records tell nothing
    return float(g[two] @ covariance(H)[np.ix_(two, two)] @ g[two])


class _Derivatives(NamedTuple):
    """By some of the unknowns, logarithms of the noise the last of them.

    taken: where, shape (numbers + logarithms,)
    by: places of those unknowns
    J: of the residuals, shape (unknowns, rows)
    bend: of sum log det S by the logarithms
    information: what Gauss-Newton lacks of theirs
    """

    taken: Array
    by: NDArray[np.intp]
    J: Array
    bend: Array
    information: Array


class _Step(NamedTuple):
    """A step of all unknowns, and of those alone that derivatives know; what it promises."""

    all: Array
    known: Array
    gain: float


class _Search:
    """Numbers of a variant, and after them the logarithms of a noise, within their bounds.

    Attributes:
        begin: shape (numbers + logarithms,).
        second: places of the second partial autocorrelations among the logarithms.

    """

    def __init__(
        self, grey: GreyBox, variant: Variant, theta: Array, noise: Noise, floor: Noise | None
    ) -> None:
        self._grey, self._variant = grey, variant
        resting = grey.resting(variant) if noise.torque else {}
        floor = floor and floor.creeping(resting, LEAST_CREEP)
        self._logs = own = Logarithms(noise.creeping(resting), floor)
        self._n = n = len(theta)
        m, self.second = len(own), own.second
        ends = zip(grey.bounds(variant), own.bounds(), strict=True)
        self._low, self._high = (np.r_[a, b] for a, b in ends)
        self.begin = np.clip(np.r_[theta, np.zeros(m)], self._low, self._high)
        self._reach = np.r_[np.full(n, np.inf), np.full(m, _LONGEST)]
        self._weight, self._centre = np.zeros(n + m), np.zeros(n + m)
        self._centre[:n], self._weight[:n] = grey.believed(variant)
        unit = np.r_[np.minimum(grey.sigma, 1.0), np.ones(n - grey.shared)]
        self._near = np.r_[_NEAR[0] * unit, np.full(m, _NEAR[1])]

    def noise(self, x: Array) -> Noise:
        return self._logs.at(x[self._n :])

    def at(self, places: Sequence[Array]) -> list[_Found | None]:
        return self._grey.likelihoods(
            self._variant, [(x[: self._n], self.noise(x)) for x in places]
        )

    def is_far(self, x: Array, derivatives: _Derivatives) -> bool:
        """Whether derivatives that were taken elsewhere serve no more."""
        return bool(np.any(np.abs(x - derivatives.taken) > self._near))

    def spectra(self, now: _Found) -> WhittleLikelihood:
        """What one replay tells of the likelihood of all noises."""
        return WhittleLikelihood(self._grey, *now, self._logs)

    def derivatives(self, x: Array, now: _Found, *, numbers: bool, exact: bool) -> _Derivatives:
        """By numbers, and by all logarithms of the noise or those that no spectrum tells."""
        found = self.by_noise(x, now, self._logs.everything if exact else self._logs.unheard)
        if not numbers:
            return found
        columns = slopes(self._grey, now[0], range(self._n), now[1])
        by = np.r_[np.arange(self._n), found.by]
        return found._replace(by=by, J=np.vstack([*columns, found.J]))

    def by_noise(
        self, x: Array, now: _Found, logarithms: Sequence[int] | None = None
    ) -> _Derivatives:
        """Derivatives by logarithms of the noise, all of them unless told."""
        n = self._n
        by = n + np.array(self._logs.everything if logarithms is None else logarithms, dtype=int)
        inward = np.where(x[by] + _STEP > self._high[by], -_STEP, _STEP)
        trials = np.repeat(x[None, :], len(by), axis=0)
        trials[np.arange(len(by)), by] += inward
        J, bend, information = _noise_slopes(now, self.at(list(trials)), inward)
        # of a first state's deviation, the last logarithm, what its states would tell if they
        # were seen: cautious steps (Dempster, Laird, Rubin, J. Royal Stat. Soc. B 39, 1977)
        information[-1, -1] += 2.0 * _first_states(self._grey, self._variant)
        return _Derivatives(x, by, J, bend, information)

    def normal(self, x: Array, point: Point, derivatives: _Derivatives) -> tuple[Array, Array]:
        """Half the second derivatives of -2 log L and half its gradient, by the same unknowns."""
        taken, by, J, bend, information = derivatives
        m = len(bend)
        H = J @ J.T + np.diag(self._weight[by])
        H[-m:, -m:] += information
        g = J @ flat(point.residuals) + (self._weight * (x - self._centre))[by]
        # of log det S: along a chord it bends as its information has it
        g[-m:] += 0.5 * bend + information @ (x - taken)[by[-m:]]
        return H, g

    def step(
        self,
        x: Array,
        point: Point,
        derivatives: _Derivatives,
        damping: float,
        spectra: WhittleLikelihood | None,
    ) -> _Step:
        """A damped step; what derivatives know nothing of goes where spectra have it likeliest."""
        by, n = derivatives.by, self._n
        H, g = self.normal(x, point, derivatives)
        low, high = np.maximum(self._low - x, -self._reach), np.minimum(self._high - x, self._reach)
        known = np.zeros(len(x))
        damped = H + damping * np.diag(np.diag(H)) + 1e-9 * np.eye(len(g))
        known[by] = step_within(damped, g, low[by], high[by])
        d, gain = known.copy(), promised(g, H, known[by])
        if spectra is not None:
            free = np.ones(len(x), dtype=bool)
            free[by] = False
            ends = (np.where(free, end, x)[n:] for end in (self._low, self._high))
            there = spectra.minimum(x[n:], *ends, held=damping)
            d[n:] += there - x[n:]
            gain += spectra(x[n:]) - spectra(there)
        return _Step(d, known, gain)

    def lower(self, x: Array, point: Point, step: _Step) -> tuple[Array, _Found] | None:
        """Where a step leads to what is likelier, if it does: all of it, or less."""
        places = [x + step.all]
        found = self.at(places)
        if found[0] is None or point.minus_two_log - found[0][0].minus_two_log < _FAIR * step.gain:
            less = [x + SHORTER[-1] * step.all]
            if np.any(step.known != step.all):
                less += [x + step.known, x + step.all - step.known]
            places, found = places + less, found + self.at(less)
        lowest: tuple[Array, _Found] | None = None
        least = point.minus_two_log
        for place, own in zip(places, found, strict=True):
            if own is not None and own[0].minus_two_log < least:
                lowest, least = (place, own), own[0].minus_two_log
        return lowest


def _first_states(grey: GreyBox, variant: Variant) -> int:
    """How many numbers a first state's deviation is told by, over all stretches."""
    return len(variant.grown.states()) * sum(len(r.begins) for r in grey.records)


def _noise_slopes(
    now: _Found, moved: Sequence[_Found | None], steps: Array
) -> tuple[Array, Array, Array]:
    """Derivatives by the logarithms of the noise.

    Of the residuals, shape (logarithms, rows), of sum log det S, and what Gauss-Newton lacks of
    their information.
    """
    point, gains = now
    r = flat(point.residuals)
    noisy = [
        (flat(f[0].residuals) - r) / s if f else np.zeros_like(r)
        for f, s in zip(moved, steps, strict=True)
    ]
    bend = [
        (f[0].log_det - point.log_det) / s if f else 0.0 for f, s in zip(moved, steps, strict=True)
    ]
    return np.stack(noisy), np.array(bend), _scale_information(gains, moved, steps, point)


def _scale_information(
    gains: Sequence[Any],
    moved: Sequence[_Found | None],
    steps: Array,
    point: Point,
) -> Array:
    """What Gauss-Newton lacks of the information on the noise: 1/4 tr(S^-1 dS S^-1 dS) a sample.

    From the steady covariance where all contacts carry.
    """
    total = np.zeros((len(moved), len(moved)))
    for k, (own, r) in enumerate(zip(gains, point.residuals, strict=True)):
        phases = own.phases
        for phase in range(phases):
            W = own.whitening(phase)
            inverse = np.linalg.inv(W)
            rows = [
                ((f[1][k].whitening(phase) - W) / s @ inverse).ravel() if f else np.zeros(W.size)
                for f, s in zip(moved, steps, strict=True)
            ]
            B = np.stack(rows)
            total += len(r) / phases * (B @ B.T)
    return total
