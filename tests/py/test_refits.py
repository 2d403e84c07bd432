"""Where a law begins beside its leader, and where its refit ends."""

from __future__ import annotations

import pytest

from dualdrive.diagnose.screening import Library, Scored
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.refits import refitted
from dualdrive.innovations import inflation, values
from test_likelihood import FRICTION, grey, likeliest
from test_parts import columns_of, refitted_bench
from test_residual_analysis import fitted

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


def test_a_law_that_is_less_likely_than_none_is_found_under_the_noise_of_none() -> None:
    own, nothing = grey(FRICTION), fitted(FRICTION)
    point, noise, _ = likeliest(FRICTION, "coulomb@table")
    far = point.theta.copy()
    far[own.shared] *= 5.0
    [there] = own.likelihoods(point.variant, [(far, noise)])
    assert there is not None
    lost = Fitted(there[0], noise, inflation(there[0]), 0.0, there[1])
    assert lost.point.minus_two_log > nothing.point.minus_two_log
    found = Estimator(own.core, own).beside_nested(own, lost, nothing, far)
    assert found.point.minus_two_log < nothing.point.minus_two_log
    sizes = values(found.variant.extra, found.point.theta[own.shared :])
    assert sizes["coulomb@table.torque"] == pytest.approx(FRICTION, rel=0.05)
