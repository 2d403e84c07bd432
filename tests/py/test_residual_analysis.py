"""Which equation needs a torque of unknown course, by likelihood, and which only has one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.residual_analysis import lost_without, missing_torque, suffices
from dualdrive.estimation.thresholds import threshold
from dualdrive.innovations import first_noise, inflation
from test_likelihood import FRICTION, grey, likeliest


def fitted(friction: float, **torque: float) -> Fitted:
    """The numbers alone, fitted, under the torques that were estimated, or these."""
    point, noise, _ = likeliest(friction)
    own = replace(noise, torque={**noise.torque, **torque})
    [found] = grey(friction).likelihoods(point.variant, [(point.theta, own)])
    assert found is not None
    return Fitted(found[0], own, inflation(found[0]), 0.0, found[1])


def test_a_missing_friction_needs_its_torque() -> None:
    own = grey(FRICTION)
    f = fitted(FRICTION)
    assert missing_torque(own.core, own, f)["table"].share > threshold("unexplained torque")
    assert lost_without(own.core, own, f, ["table"]) > 20.0 * threshold("gain")
    assert not suffices(own.core, own, f)


def test_a_torque_that_nothing_asks_for_is_none() -> None:
    """A filter that is given a torque has one; without it the records are likelier."""
    own = grey(0.0)
    wide = first_noise(own.core, own.records, threshold("wide torque"))
    f = fitted(0.0, motor_1=3.0 * wide.torque["motor_1"])
    missing = missing_torque(own.core, own, f)
    assert missing["motor_1"].share > threshold("unexplained torque")
    assert lost_without(own.core, own, f, ["motor_1"]) < 0.0
    assert suffices(own.core, own, f)


def test_innovations_far_from_noise_say_nothing() -> None:
    own = grey(0.0)
    f = replace(fitted(0.0), inflation=2.0 * threshold("inflation"))
    assert lost_without(own.core, own, f, ["table"]) == pytest.approx(float("inf"))
