"""From what a search found to probabilities."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dualdrive.diagnose.decision.verdict import probabilities
from dualdrive.diagnose.selection import Fitted, Selection
from dualdrive.innovations import Noise, Point, Variant

Effects = tuple[tuple[str, str], ...]
FRICTION, RIPPLE = ("coulomb", "table"), ("torque_ripple", "motor_1")


def fitted(effects: Effects, order: float, criterion: float) -> Fitted:
    """A fit of laws, as far as a decision sees it."""
    variant = Variant(None, (), effects, {"torque_ripple@motor_1.order": order} if effects else {})
    point = Point(variant, np.zeros(0), (np.zeros((1, 1)),), 0.0, 0.0)
    return Fitted(point, Noise({}, {}, {}), 1.0, criterion, [])


def test_two_laws_are_no_rivals_of_themselves_in_the_other_order() -> None:
    """A runner-up, or a swap, finds the same pair the other way about, at another order."""
    nothing = fitted((), 0.0, 500.0)
    best = fitted((FRICTION, RIPPLE), 6.0, 0.0)
    other = fitted((RIPPLE, FRICTION), 12.0, 3.0)
    grey: Any = None
    found = Selection(grey, nothing, [best, other, nothing], [], {}, True, False)
    [(leader, sure), (last, never)] = probabilities(found)
    assert leader is best
    assert sure == pytest.approx(1.0)
    assert last is nothing
    assert never == pytest.approx(0.0, abs=1e-12)
