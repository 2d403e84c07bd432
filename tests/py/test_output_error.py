"""A joint with play, refitted by its simulated error from where a filter had left it."""

from __future__ import annotations

import functools
from copy import copy
from dataclasses import replace

import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import Fitted
from dualdrive.diagnose.selection.output_error import by_simulation, opens, without_unknown_torque
from dualdrive.diagnose.uncertainty import Uncertainty
from dualdrive.innovations import GreyBox, Point, Variant, coordinates, values
from dualdrive.innovations.greybox import Counter
from test_elimination import blank
from test_innovations import bench
from test_likelihood import SAMPLES, grey

GAP = 1e-3
#: 700 Hz: between two samples it closes and opens again
JOINT = {
    "gearbox_backlash@gearboxes": {"gap": GAP, "stiffness": 4e3},
    "mesh_damping@gearboxes": {"coefficient": 0.05},
}
TRUE = {f"{label}.{name}": x for label, own in JOINT.items() for name, x in own.items()}


@functools.cache
def recorded() -> GreyBox:
    """The data sheet's bench, which has no play there, on a record of one that has."""
    return grey_box(Machine.load("bench"), bench(JOINT), SAMPLES, seed=4)


def begun(own: GreyBox, gap: float) -> tuple[Estimator, Fitted]:
    """The machine with a play of this size, all other numbers as the data sheet has them."""
    library, nothing = Library(own.core, own), Variant(own.core)
    base = blank(nothing)
    beside = library.variants(nothing, base)
    variant = next(v for v in beside if v.label == "gearbox_backlash@gearboxes")
    estimator = Estimator(own.core, own)
    theta = own.start(variant)
    known = {"gearbox_backlash@gearboxes.gap": gap, "gearbox_backlash@gearboxes.stiffness": 8e3}
    theta[own.shared :] = coordinates(variant.extra, known)
    point = Point(variant, theta, base.residuals, 0.0, 0.0)
    return estimator, Fitted(point, estimator.wide, 1.0, 0.0, [])


@pytest.mark.long
def test_its_play_is_found_and_nothing_unknown_is_asked_for() -> None:
    own = recorded()
    estimator, first = begun(own, 0.85 * GAP)
    found = by_simulation(estimator, own, first)
    assert found is not None
    at = values(found.variant.extra, found.point.theta[own.shared :])
    assert at["gearbox_backlash@gearboxes.gap"] == pytest.approx(GAP, rel=0.03)
    assert found.noise.torque == {}
    # valleys of a rough surface: as likely, within little, as the one that the truth lies in
    truth = found.point.theta.copy()
    truth[own.shared :] = coordinates(found.variant.extra, TRUE)
    nearby = estimator.likeliest(own, found.variant, truth, found.noise)
    assert nearby is not None
    assert found.point.minus_two_log < nearby.point.minus_two_log + 50.0
    [start] = own.likelihoods(first.variant, [(first.point.theta, replace(found.noise, torque={}))])
    assert start is not None
    assert found.point.minus_two_log < start[0].minus_two_log - 1000.0
    sure = Uncertainty(own).intervals(found)["gearbox_backlash@gearboxes.gap"]
    assert sure.high - sure.low > 1e-3 * GAP, "told under the filter's noise"


@pytest.mark.long
def test_it_stands_only_where_it_is_likelier_than_its_filter() -> None:
    """Of a play that is there; not of one that a friction was taken for."""
    for own, stands in ((recorded(), True), (grey(0.4), False)):
        estimator, first = begun(own, 0.85 * GAP)
        assert (without_unknown_torque(estimator, own, first) is not None) is stands


def test_it_ends_where_it_is_stopped() -> None:
    own = copy(recorded())
    estimator, first = begun(own, 0.85 * GAP)
    own.counter = Counter(lambda: True)
    assert by_simulation(estimator, own, first) is None


def test_only_a_joint_with_a_play_opens() -> None:
    own = recorded()
    library, nothing = Library(own.core, own), Variant(own.core)
    labels = {v.label for v in library.variants(nothing, blank(nothing)) if opens(v)}
    assert labels == {"gearbox_backlash@gearboxes"}
    assert not opens(nothing)
