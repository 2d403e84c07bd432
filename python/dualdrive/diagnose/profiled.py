"""Hypotheses each under the noise that they leave themselves.

A series that a wrong model leaves is alike from sample to sample and counts as few samples. Under
that noise the right effect gains little, though it takes four fifths of what is left, and its refit
has no reason to go on. Each refit is therefore continued under the noise that it leaves itself, and
the first leader is the one with the least profile likelihood, the sizes of the noise at their best:
sum over the series of n log(mean square), n counted as the machine without any effect has it.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from dualdrive.diagnose import whitening
from dualdrive.diagnose.evidence import Evidence, evidence
from dualdrive.diagnose.refit import Fitter, Refit, Trial

_ROUNDS = 3
_HARDLY = 30.0  # times the beliefs: as good as none


def sharpened(fitter: Fitter, refit: Refit) -> Refit:
    """The refit continued under its own noise; chi^2 as the fitter has it."""
    seen = fitter.evidence
    c = seen.confrontation
    best, least = refit, profile(seen, refit)
    if len(refit.hypothesis.effects) < 2:
        best = _unbelieving(fitter, refit)
        least = profile(seen, best)
    for _ in range(_ROUNDS):
        if fitter.stop():
            break
        own = Fitter(evidence(c, whitening.sized(c.series, best.left)), fitter.stop)
        further = own.again(best)
        cost = profile(seen, further)
        if cost > least - 1.0:
            break
        best, least = further, cost
    return replace(best, chi=seen.chi(best.u, best.left))


def _unbelieving(fitter: Fitter, refit: Refit) -> Refit:
    """The refit under the noise that would be left if nothing were believed of the numbers.

    Held to a wrong number, a machine leaves a torque that is alike for seconds and counts as few
    samples, too few to move that number: a data sheet's guess would stand by itself. How much the
    records know is told by what they leave when they alone decide; under that noise the beliefs are
    weighed again.
    """
    c = fitter.evidence.confrontation
    free = copy(c)
    free.sigma = np.where(np.arange(len(c.sigma)) < len(c.nominal), _HARDLY * c.sigma, c.sigma)
    alone = refit
    for _ in range(_ROUNDS):
        if fitter.stop():
            return refit
        own = Fitter(evidence(free, whitening.sized(c.series, alone.left)), fitter.stop)
        alone = own.again(alone, fresh=True)
    noise = evidence(c, whitening.sized(c.series, alone.left))
    found = Fitter(noise, fitter.stop).again(alone, fresh=True)
    return found if profile(noise, found) < profile(noise, refit) else refit


def profile(seen: Evidence, refit: Refit | Trial) -> float:
    """Minus twice the log likelihood at the best sizes of the noise, priors included."""
    c = seen.confrontation
    believed = np.isfinite(c.sigma)
    off = (refit.u - c.centre)[believed] / c.sigma[believed]
    whole = float(off @ off)
    parts = seen.apart(seen.white(refit.left))
    for series, whitener, rows in zip(c.series, seen.whiteners, parts, strict=True):
        if count := int(whitener.keep.sum()):
            least = 1e-6 * series.spread / float(whitener.scale.max())
            size = max(whitening.rms(rows[whitener.keep]), least, 1e-300)
            whole += 2.0 * count / whitener.alike * float(np.log(size))
    return whole
