"""Where a law begins beside its leader, and where its refit ends."""

from __future__ import annotations

import pytest

from dualdrive.diagnose.screening import Library, Scored
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.refits import refitted
from dualdrive.innovations import values
from test_parts import columns_of, refitted_bench

LAW, TORQUE = "coulomb@table", 0.02


@pytest.mark.parametrize("times", [1.0, 100.0, 1000.0])
def test_a_law_whose_score_asks_for_far_too_much_of_it_is_found(times: float) -> None:
    """At a hundred times its size a fit had spent its steps on the way back to the leader."""
    own, leader = refitted_bench(LAW, 4000, torque=TORQUE)
    variants = Library(own.core, own).variants(leader.variant, leader.point)
    [law] = [v for v in variants if v.label == LAW]
    path = f"{LAW}.torque"
    scored = Scored(law, 10.0, {path: times * TORQUE})
    near = refitted(Estimator(own.core, own), own, leader, scored, columns_of(own, leader))
    assert near is not None
    assert leader.point.minus_two_log - near[0].minus_two_log > 300.0
    assert values(law.extra, near[0].theta[own.shared :])[path] == pytest.approx(TORQUE, rel=0.1)
