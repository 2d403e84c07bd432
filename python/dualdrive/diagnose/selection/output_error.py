"""A joint that opens, by its simulated error: where no filter comes to its best.

A pinion in its play has no sensor, and a Kalman filter, which has one flank at a time and a normal
distribution about it, asks for torque wherever the flank is another one. A simulation goes through
every flank. Without any torque of unknown course the likelihood is that of the simulated error
(output-error method: Ljung, System Identification, 2nd ed., section 4.3), and may be compared with
that of a filter under its own torque.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive import _core
from dualdrive.diagnose.selection.estimation import Estimator, on_all_samples
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.estimation.thresholds import threshold
from dualdrive.identify.closed_loop import FitError, Problem, channels_to_fit
from dualdrive.identify.search import Search
from dualdrive.innovations import GreyBox, Noise, Variant, coordinates, values
from dualdrive.mapper import Threads

Array = NDArray[np.float64]

_SIMULATIONS = 1500  # of single records, at most, in a round
_ROUNDS = 3  # of least squares, at most, each under the weights of what the one before left
_PRECISION = 1e-4  # of a round's sum of squares: the likelihood goes on from there

#: a joint's play and stiffness, times a filter's, and its damping, times the usual one: where its
#: simulation may begin
_WIDER, _STIFFER, _DAMPED = tuple(1.25**k for k in range(-1, 4)), (1.0, 10.0), (0.0, 0.1, 1.0)


def opens(variant: Variant) -> bool:
    """Whether a joint with a play has been put into the machine."""
    return any(p.path.endswith(".gap") for p in variant.extra)


def without_unknown_torque(estimator: Estimator, grey: GreyBox, f: Fitted) -> Fitted | None:
    """A machine by its simulation, if that is likelier than its filter; see `by_simulation`."""
    own = by_simulation(estimator, grey, f)
    if own is None or own.inflation > threshold("inflation"):
        return None
    there = on_all_samples(grey, f)
    return own if own.point.minus_two_log < there.point.minus_two_log else None


def by_simulation(estimator: Estimator, grey: GreyBox, f: Fitted) -> Fitted | None:
    """A machine refitted by its simulated error; None where it can't be simulated.

    By rounds of least squares, while they make it likelier: their weights are no likelihood, and a
    record in which the machine bounces otherwise than it did may lead them astray.

    Args:
        estimator: of the machine.
        grey: whole records: a simulation begins where they do.
        f: where its numbers begin.

    """
    variant, played = f.variant, [r.record for r in grey.records]
    parameters, n = [*grey.nominal, *variant.extra], len(grey.nominal)
    noise = replace(f.noise, torque={}, creep={})
    begun = _likeliest_joint(grey, f, noise)
    at, constants = grey.values(variant, begun), f.point.theta[n : grey.shared]
    start = [p.coordinate(at[p.path]) for p in parameters]
    mapper = Threads(grey.threads)
    channels = channels_to_fit(played, None)
    problem = Problem(variant.grown, played, parameters, [], channels=channels, mapper=mapper)

    counted = 0

    def told(_: Any) -> None:
        nonlocal counted
        grey.counter.add(problem.runs - counted)
        counted = problem.runs
        if grey.counter.stop():
            raise KeyboardInterrupt

    low, high = problem.bounds
    point = np.clip(np.r_[start, problem.start[len(parameters) :]], low, high)
    best: Fitted | None = None
    for _ in range(_ROUNDS):
        search = Search(problem, _SIMULATIONS, told, _PRECISION, rounds=1)
        search.first = point
        try:
            search.run()
        except (FitError, KeyboardInterrupt):
            break
        point = search.best
        theta = grey.point_of(variant, problem.values(point), constants)
        own = estimator.likeliest(grey, variant, theta, noise, roughly=True, guessed=True)
        if own is None or (best and own.point.minus_two_log > best.point.minus_two_log):
            break
        best, noise = own, own.noise
    if best is None or grey.counter.stop():
        return None
    own = estimator.likeliest(grey, variant, best.point.theta, best.noise)
    return replace(own or best, told_under=f.noise)


def _likeliest_joint(grey: GreyBox, f: Fitted, noise: Noise) -> Array:
    """The numbers of a machine, its joint the likeliest of several to a simulation.

    A filter has a contact without rebound: it does not tell the damping, and takes what rebounds do
    for a softer and a narrower joint. Shape (unknowns,).
    """
    own = f.variant.extra
    at, usual = values(own, f.point.theta[grey.shared :]), values(own, coordinates(own, {}))
    brings = {e: str(_core.effect_type(e).brings) for e, _ in f.variant.effects}
    begins = [f.point.theta]
    for wider, stiffer, damped in itertools.product(_WIDER, _STIFFER, _DAMPED):
        joint = dict(at)
        for p in own:
            effect = p.path.partition("@")[0]
            if brings.get(effect):
                joint[p.path] *= {"rad": wider, "N*m/rad": stiffer}.get(p.unit, 1.0)
            elif effect in brings.values():
                joint[p.path] = damped * usual[p.path]
        begins.append(np.r_[f.point.theta[: grey.shared], coordinates(own, joint)])
    seen = [p[0] for p in grey.likelihoods(f.variant, [(x, noise) for x in begins]) if p]
    best = min(seen, key=lambda p: p.minus_two_log, default=f.point)
    return best.theta
