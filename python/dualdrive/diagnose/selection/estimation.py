"""A variant at its best: numbers and noise by likelihood, from near and from far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.residual_analysis import needs_no_torque
from dualdrive.estimation.thresholds import threshold
from dualdrive.identify import FitError
from dualdrive.innovations import (
    GreyBox,
    Noise,
    Variant,
    first_noise,
    fit,
    inflation,
    least_noise,
    maximum_likelihood,
    score_of_order_two,
)

Array = NDArray[np.float64]

_QUIET = 0.01  # of the wide torque, from which smooth noise is told from torques
_SLOWER = 100.0  # times as slow: where times of drifting zeros are sought from once more


class Estimator:
    """Estimates variants of one machine, its noise beginning with what the records show.

    Attributes:
        core: the machine of the data sheet.
        wide: a first noise, torques of unknown course so large that any machine follows.
        floor: less drives nothing.

    """

    def __init__(self, core: Any, grey: GreyBox) -> None:
        self.core = core
        self.wide = first_noise(core, grey.records, threshold("wide torque"))
        self.floor = least_noise(core, grey.records, threshold("least torque"))

    def likeliest(
        self,
        grey: GreyBox,
        variant: Variant,
        theta: Array,
        noise: Noise,
        rival: float = -np.inf,
        *,
        roughly: bool = False,
        guessed: bool = False,
    ) -> Fitted | None:
        """Numbers and noise together, from a point; None where it can't be followed.

        What would not come up to a rival's -2 log L is not followed to its end; nor is any, if
        coming near is enough. A noise that is but guessed is estimated first.
        """
        found = maximum_likelihood(
            grey, variant, theta, noise, floor=self.floor, rival=rival, roughly=roughly,
            guessed=guessed,
        )  # fmt: skip
        if found is None:
            return None
        point, own, gains = found
        return Fitted(point, own, inflation(point), 0.0, gains)

    def of_the_data_sheet(self, grey: GreyBox) -> Fitted | None:
        """The machine as its data sheet has it, under much unknown torque; None if it is lost."""
        nothing = Variant(self.core)
        [found] = grey.likelihoods(nothing, [(grey.of_the_data_sheet(nothing), self.wide)])
        return Fitted(found[0], self.wide, inflation(found[0]), 0.0, found[1]) if found else None

    def from_far(self, grey: GreyBox, variant: Variant, theta: Array) -> Fitted | None:
        """A variant near its best, from under much unknown torque; None where it is lost.

        The noise comes first, then it and the numbers together.
        """
        return self.likeliest(grey, variant, theta, self.wide, roughly=True, guessed=True)

    def under(
        self,
        grey: GreyBox,
        variant: Variant,
        thetas: Sequence[Array],
        noise: Noise,
        columns: Sequence[Array] | None = None,
        rival: float = -np.inf,
    ) -> Fitted | None:
        """A variant refitted under a given noise; None where it can't be followed.

        Args:
            grey: the records.
            variant: what is fitted.
            thetas: points, from the likeliest of which it begins, shape (unknowns,) each.
            noise: the noise.
            columns: derivatives by the shared unknowns to begin with (a chord).
            rival: -2 log L under it, from which on what does not come up to it is not followed.

        """
        seen = grey.likelihoods(variant, [(theta, noise) for theta in thetas])
        begin = min((f for f in seen if f), key=lambda f: f[0].minus_two_log, default=None)
        if begin is None:
            return None
        least = rival - begin[0].log_det
        near = fit(grey, variant, begin[0].theta, begin[1], shared_columns=columns, rival=least)
        [found] = grey.likelihoods(variant, [(near.theta, noise)])
        if found is None or found[0].minus_two_log > begin[0].minus_two_log:
            found = begin  # what gains that were held promised, those of its own do not keep
        return Fitted(found[0], noise, inflation(found[0]), 0.0, found[1])

    def beside_nested(self, grey: GreyBox, f: Fitted, nested: Fitted, begun: Array) -> Fitted:
        """A machine sought once more under the noise of one nested in it; as it is if no likelier.

        One that is less likely than what is nested in it was not found: under as little torque as
        it needs elsewhere a flank that is mistaken once hides all that it does. Under the other
        one's torque its filter follows.

        Args:
            grey: the records.
            f: the machine.
            nested: the machine without the law: the same at no size of it.
            begun: numbers of the machine, found on other samples, shape (unknowns,).

        """
        places = [(theta, nested.noise) for theta in (begun, f.point.theta)]
        seen = [p[0] for p in grey.likelihoods(f.variant, places) if p]
        best = min(seen, key=lambda p: p.minus_two_log, default=None)
        own = best and self.likeliest(grey, f.variant, best.theta, nested.noise)
        return own if own and own.point.minus_two_log < f.point.minus_two_log else f

    def of_order_two(self, grey: GreyBox, f: Fitted) -> Fitted:
        """The same under sensors' noise of order two where the Bayesian criterion asks for it.

        A converter's filter makes such noise; taken for one of order one it speaks for late
        sensors, and for a torque of unknown course, which is as smooth. Where that stands for it
        already, the noise that is left tells nothing: from a first noise with little of that
        torque, at the data sheet's numbers, the two part. Where no torque is asked for none stands
        for anything.
        """
        count, n, found = len(f.noise.drive), len(grey.nominal), f
        score = score_of_order_two(grey, f.variant, f.point.theta, f.noise, self.floor)
        if score > _price(grey, count) * f.inflation:
            found = self._richer(grey, f, f.noise.of_order_two(), count)
        if needs_no_torque(self.core, grey, found):
            return found
        sheet = np.r_[grey.centre[:n], f.point.theta[n:]]
        quiet = self.wide.with_torque(_QUIET).of_order_two()
        paid = 0 if found is not f else count
        return self._richer(grey, found, quiet, paid, found.point.minus_two_log, sheet)

    def drifting(self, grey: GreyBox, f: Fitted, rival: float = -np.inf) -> Fitted:
        """The same with zeros that drift over times of their own, where the criterion asks for it.

        From a fraction of a second (1/f noise) to minutes. What would not come up to a rival's
        -2 log L is not followed to its end.
        """
        count = len(f.noise.drift)
        found = self._richer(grey, f, f.noise.slower(1.0), count, rival)
        paid = 0 if found is not f else count
        return self._richer(grey, found, f.noise.slower(_SLOWER), paid, rival)

    def _richer(
        self,
        grey: GreyBox,
        f: Fitted,
        noise: Noise,
        numbers: int,
        rival: float = -np.inf,
        theta: Array | None = None,
    ) -> Fitted:
        """The same under this noise, of so many numbers more, or as it is.

        It begins at its own numbers unless others are given.
        """
        if grey.counter.stop():
            return f
        begin = f.point.theta if theta is None else theta
        own = self.likeliest(grey, f.variant, begin, noise, rival, roughly=True, guessed=True)
        if own is None:
            return f
        gained = (f.point.minus_two_log - own.point.minus_two_log) / own.inflation
        return own if gained > _price(grey, numbers) else f


def _price(grey: GreyBox, numbers: int) -> float:
    """What so many numbers of the noise more have to gain, by the Bayesian criterion."""
    return numbers * float(np.log(grey.samples))


def on_all_samples(whole: GreyBox, f: Fitted) -> Fitted:
    """A fitted machine on whole records, as it is."""
    [found] = whole.likelihoods(f.variant, [(f.point.theta, f.noise)])
    if found is None:
        raise FitError(f"{f.variant.key}: no Kalman filter follows the whole of these records")
    point, gains = found
    return replace(f, point=point, inflation=inflation(point), gains=gains)
