"""The machine as it is, its numbers refitted: what every law is weighed against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.selection.estimation import Estimator, on_all_samples
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.residual_analysis import needs_no_torque, suffices, white
from dualdrive.estimation.thresholds import threshold
from dualdrive.identify import FitError
from dualdrive.innovations import GreyBox, Point, Variant, fit, slopes, some

Array = NDArray[np.float64]

_CHOSEN_ANEW = 3  # times that stretches are chosen where the refitted machine fails
#: times as many samples as stretches have: records of no more are looked at whole. Stretches begin
#: anew, each where another machine had it, and cost more than as many samples in one piece
_WHOLE = 2
_AGAIN = (0.1, 0.01)  # of the wide torque, from which the base's valley is sought anew


@dataclass(frozen=True, eq=False)
class Base:
    """Nothing is missing: numbers alone, from far.

    grey: stretches of the records on which laws are sought, or all of them where they are short
    there: on those
    everywhere: on all samples; None where too much is missing for that to tell anything
    """

    grey: GreyBox
    there: Fitted
    everywhere: Fitted | None


def refitted_base(estimator: Estimator, whole: GreyBox) -> Base:
    """Refit the data sheet's numbers.

    Raises:
        FitError: no filter follows the records.

    """
    nothing = Variant(estimator.core)
    theta = whole.start(nothing)
    lost = FitError(f"{estimator.core.name}: no Kalman filter follows these records")
    try:
        gains = whole.gains(nothing, theta, estimator.wide)
    except ValueError:
        raise lost from None
    [point] = whole.points([nothing], [theta], gains)
    grey = _some(whole, point, gains)
    found = estimator.from_far(grey, nothing, theta)
    if found is None:
        raise lost
    # stretches that begin from where the refitted machine has them, and lie where it fails
    grey = _stretches(whole, found)
    found = _nearly(estimator, grey, found)
    better = _other_valleys(estimator, grey, found)
    if better is not None:
        found = _nearly(estimator, grey, replace(found, point=better))
        grey = _stretches(whole, found)
    found = estimator.of_order_two(grey, _nearly(estimator, grey, found))
    for _ in range(_CHOSEN_ANEW):
        if grey is whole or not _elsewhere(found, on_all_samples(whole, found)):
            break
        grey = _stretches(whole, found)
        found = _nearly(estimator, grey, found)
    found = _with_drifting_zeros(estimator, grey, _to_the_end(estimator, grey, found))
    if grey is whole:
        return Base(whole, found, found)
    if not (white(found) and suffices(estimator.core, grey, found)):
        return Base(grey, found, None)
    everywhere = _to_the_end(estimator, whole, on_all_samples(whole, found))
    if white(everywhere):
        # where only noise is left, faint laws show where the records tell of a machine at all
        point = everywhere.point
        columns = slopes(whole, point, range(len(point.theta)), everywhere.gains)
        grey = _some(whole, point, everywhere.gains, columns)
        return Base(grey, on_all_samples(grey, everywhere), everywhere)
    grey = _some(whole, everywhere.point, everywhere.gains)
    return Base(grey, _to_the_end(estimator, grey, everywhere), everywhere)


def _elsewhere(found: Fitted, everywhere: Fitted) -> bool:
    """Whether a machine fails elsewhere than on its stretches: these have led it astray.

    Where it fails on these as well something is missing, and others would show no more.
    """
    bears = white(found) or found.inflation < threshold("inflation") < everywhere.inflation
    return bears and not white(everywhere)


def _nearly(estimator: Estimator, grey: GreyBox, f: Fitted) -> Fitted:
    return estimator.likeliest(grey, f.variant, f.point.theta, f.noise, roughly=True) or f


def _to_the_end(estimator: Estimator, grey: GreyBox, f: Fitted) -> Fitted:
    return estimator.likeliest(grey, f.variant, f.point.theta, f.noise) or f


def _with_drifting_zeros(estimator: Estimator, grey: GreyBox, f: Fitted) -> Fitted:
    """The same, zeros drifting over times of their own, where nothing but that is left.

    Where no equation lacks much torque and innovations have a colour all the same, what is missing
    acts slowly, on sensors. Zeros that drift do, and so do eccentric encoders; and a noise that
    has no room for them hides all that is faint. Laws are scored beside such a noise, and weighed
    against it, before one is named or none.
    """
    if white(f) or not suffices(estimator.core, grey, f):
        return f
    found = estimator.drifting(grey, f)
    return found if white(found) and suffices(estimator.core, grey, found) else f


def _stretches(whole: GreyBox, f: Fitted) -> GreyBox:
    """Stretches of the records, begun as a fitted machine has it."""
    everywhere = on_all_samples(whole, f)
    return _some(whole, everywhere.point, everywhere.gains)


def _some(
    whole: GreyBox, point: Point, gains: Sequence[Any], columns: Sequence[Array] | None = None
) -> GreyBox:
    """Stretches of records that are long enough for it."""
    most = int(threshold("stretches"))
    return whole if whole.samples <= _WHOLE * most else some(whole, point, gains, most, columns)


def _other_valleys(estimator: Estimator, grey: GreyBox, found: Fitted) -> Point | None:
    """Numbers that are likelier than the base's under its own noise; None where none are.

    From under less unknown torque: a record that begins within the play has a valley for each
    flank that may be meant. And from the data sheet's numbers, held at first: those that are
    told only together wander off while much torque is unknown, and may end worse than where
    they began. All end under one noise, where they can be compared. What needs no torque is in the
    right one.
    """
    if needs_no_torque(estimator.core, grey, found):
        return None
    n = len(grey.nominal)
    sheet = found.point.theta.copy()
    sheet[:n] = grey.centre[:n]
    begins = [(grey, found.point.theta, lower) for lower in _AGAIN]
    begins.append((grey.held(), sheet, 1.0))
    best, least = None, found.point.minus_two_log - threshold("clearly") * found.inflation
    for own, theta, lower in begins:
        if grey.counter.stop():
            break
        wide = replace(found.noise, torque=estimator.wide.with_torque(lower).torque)
        for box, noise in ((own, wide), (grey, found.noise)):
            try:
                gains = box.gains(found.variant, theta, noise)
            except ValueError:
                break
            theta = fit(box, found.variant, theta, gains).theta
        [there] = grey.likelihoods(found.variant, [(theta, found.noise)])
        if there is not None and there[0].minus_two_log < least:
            best, least = there[0], there[0].minus_two_log
    return best
