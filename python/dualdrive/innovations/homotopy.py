"""From far: numbers fitted under less and less torque of unknown course.

Under much of it any machine follows its records, and they tell little of its numbers; under less
they tell more. What was found under one level is where the next begins (a homotopy, or
continuation: Allgower, Georg, Introduction to Numerical Continuation Methods, ch. 1; that process
noise widens the valleys of a prediction error: Kristensen, Madsen, Jørgensen, Automatica 40, 2004).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dualdrive.innovations.greybox import GreyBox
from dualdrive.innovations.levenberg_marquardt import fit
from dualdrive.innovations.likelihood import Place
from dualdrive.innovations.noise import Noise
from dualdrive.innovations.variant import Variant

Array = NDArray[np.float64]

#: of the torque with which it begins, under which numbers are fitted one after another
LOWERED = (1.0, 0.1, 0.01)
_PATIENT = 20  # steps at most under each: a valley may be bent


def levels(noise: Noise, floor: Noise | None) -> list[Noise]:
    """A noise under less and less torque, down to that of the floor."""
    found = [noise.with_torque(k).at_least(floor) for k in LOWERED]
    # where the least torque is reached, less is no other level
    return [own for k, own in enumerate(found) if own not in found[:k]]


def followed(grey: GreyBox, variant: Variant, theta: Array, noises: Sequence[Noise]) -> list[Place]:
    """Where a variant comes to under one noise after another, until it can't be followed.

    Args:
        grey: the records.
        variant: what is fitted.
        theta: where its numbers begin, shape (unknowns,).
        noises: widest first.

    """
    found: list[Place] = []
    for noise in noises:
        place = _near(grey, variant, theta, noise)
        if place is None:
            break
        found.append(place)
        theta = place[0].theta
    return found


def _near(grey: GreyBox, variant: Variant, theta: Array, noise: Noise) -> Place | None:
    """A variant refitted under a noise, from a point; None where it can't be followed."""
    try:
        gains = grey.gains(variant, theta, noise)
    except ValueError:
        return None
    near = fit(grey, variant, theta, gains, steps=_PATIENT)
    # gains were held: under its own a point far away may be worse than where it came from
    seen = [f[0] for f in grey.likelihoods(variant, [(near.theta, noise), (theta, noise)]) if f]
    return (min(seen, key=lambda p: p.minus_two_log), noise) if seen else None
