"""A joint that opens, by its simulated error: where no filter comes to its best.

A pinion in its play has no sensor, and a Kalman filter, which has one flank at a time and a normal
distribution about it, asks for torque wherever the flank is another one. A simulation goes through
every flank. Without any torque of unknown course the likelihood is that of the simulated error
(output-error method: Ljung, System Identification, 2nd ed., section 4.3), and may be compared with
that of a filter under its own torque.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dualdrive.diagnose.selection.estimation import Estimator, on_all_samples
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.estimation.thresholds import threshold
from dualdrive.identify.closed_loop import FitError, Problem, channels_to_fit
from dualdrive.identify.search import Search
from dualdrive.innovations import GreyBox, Variant, coordinates, values
from dualdrive.mapper import Threads

_SIMULATIONS = 1500  # of single records, at most, in a round
_ROUNDS = 3  # of least squares, at most, each under the weights of what the one before left
_PRECISION = 1e-4  # of a round's sum of squares: the likelihood goes on from there


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
    at = values(variant.extra, f.point.theta[grey.shared :])
    start = [*f.point.theta[:n], *(p.coordinate(at[p.path]) for p in variant.extra)]
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
    noise = replace(f.noise, torque={}, creep={})
    for _ in range(_ROUNDS):
        search = Search(problem, _SIMULATIONS, told, _PRECISION, rounds=1)
        search.first = point
        try:
            search.run()
        except (FitError, KeyboardInterrupt):
            break
        point, theta = search.best, f.point.theta.copy()
        found = problem.values(point)
        theta[:n] = point[:n]
        theta[grey.shared :] = coordinates(
            variant.extra, {p.path: found[p.path] for p in variant.extra}
        )
        own = estimator.likeliest(grey, variant, theta, noise, roughly=True, guessed=True)
        if own is None or (best and own.point.minus_two_log > best.point.minus_two_log):
            break
        best, noise = own, own.noise
    if best is None or grey.counter.stop():
        return None
    own = estimator.likeliest(grey, variant, best.point.theta, best.noise)
    return replace(own or best, told_under=f.noise)
