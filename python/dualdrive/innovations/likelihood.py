"""Numbers and noise by maximum likelihood, together.

-2 log L = sum |r|^2 + sum log det S + priors falls by Gauss-Newton steps in the numbers and by
Fisher scoring in the logarithms of the noise: the information of the two is block-diagonal where
the model is right (Ljung, System Identification, 2nd ed., ch. 7 and 9), but not on the way there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.innovations.derivatives import slopes
from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.levenberg_marquardt import (
    SHORTER,
    as_foretold,
    inflation,
    step_within,
)
from dualdrive.innovations.noise import LEAST_CREEP, Logarithms, Noise
from dualdrive.innovations.variant import Point, Variant, flat

Array = NDArray[np.float64]

_Found = tuple[Point, list[Any]]

_STEP = 1e-3  # of a logarithm, for finite differences
_LONGEST = 1.5  # step of a logarithm
_DAMPINGS = (1e-4, 0.03, 1.0, 30.0)
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
        steps: most iterations.

    """
    enough = _NEARLY if roughly else _ENOUGH
    resting = grey.resting(variant) if noise.torque else {}
    own = Logarithms(noise.creeping(resting), floor and floor.creeping(resting, LEAST_CREEP))
    n, m = len(theta), len(own)
    low, high = (np.r_[a, b] for a, b in zip(grey.bounds(variant), own.bounds(), strict=True))
    reach = np.r_[np.full(n, np.inf), np.full(m, _LONGEST)]
    weight = np.zeros(n + m)
    weight[: grey.shared] = 1.0 / grey.sigma**2
    centre = np.zeros(n + m)
    centre[: grey.shared] = grey.centre

    def at(places: Sequence[Array]) -> list[_Found | None]:
        return grey.likelihoods(variant, [(x[:n], own.at(x[n:])) for x in places])

    x = np.clip(np.r_[theta, np.zeros(m)], low, high)
    [now] = at([x])
    if now is None:
        return None
    unit = np.r_[np.minimum(grey.sigma, 1.0), np.ones(n - grey.shared)]
    near = np.r_[_NEAR[0] * unit, np.full(m, _NEAR[1])]
    derivatives, taken = None, x
    lately = [np.inf] * _LATELY
    for left in reversed(range(steps)):
        if grey.counter.stop():
            break
        point, gains = now
        fresh = derivatives is None or bool(np.any(np.abs(x - taken) > near))
        if derivatives is None or fresh:
            columns, taken = np.stack(slopes(grey, point, range(n), gains)), x
            inward = np.where(x[n:] + _STEP > high[n:], -_STEP, _STEP)
            moved = at([x + np.r_[np.zeros(n), e] for e in np.diag(inward)])
            noisy, bend, information = _noise_slopes(now, moved, inward)
            derivatives = np.concatenate([columns, noisy]), bend, information
        J, bend, information = derivatives
        r = flat(point.residuals)
        H = J @ J.T + np.diag(weight)
        H[n:, n:] += information
        g = J @ r + weight * (x - centre)
        # of log det S: along a chord it bends as its information has it
        g[n:] += 0.5 * bend + information @ (x - taken)[n:]
        ends = np.maximum(low - x, -reach), np.minimum(high - x, reach)
        for damping in _DAMPINGS:
            damped = H + damping * np.diag(np.diag(H)) + 1e-9 * np.eye(n + m)
            d = step_within(damped, g, *ends)
            trials = [x + shorter * d for shorter in SHORTER]
            tried = [(t, f) for t, f in zip(trials, at(trials), strict=True) if f]
            lowest = min(tried, key=lambda t: t[1][0].minus_two_log, default=None)
            if lowest and lowest[1][0].minus_two_log < point.minus_two_log:
                x, now = lowest
                break
        gained = point.minus_two_log - now[0].minus_two_log
        if not as_foretold(gained, g, H, d):
            derivatives = None
        lately = [*lately[1:], gained]
        if now[0].minus_two_log - left * max(lately) > rival > -np.inf:
            break
        if gained < enough * inflation(now[0]):
            if roughly or fresh:
                break
            derivatives = None  # the chord, not the likelihood, may have come to its end
    return now[0], own.at(x[n:]), now[1]


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
