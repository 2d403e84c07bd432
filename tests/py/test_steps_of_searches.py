"""Curvature along a step, chords that keep their promise, and who is taken into a contest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.decision.verdict import probabilities
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection import Fitted, Selection
from dualdrive.diagnose.selection.parts import brings
from dualdrive.diagnose.selection.refits import with_rivals
from dualdrive.innovations import GreyBox, Point, Variant, carried, first_noise
from dualdrive.innovations.levenberg_marquardt import (
    as_foretold,
    curvature,
    gentle,
    promised,
)
from test_innovations import bench

J = np.array([[1.0, 0.5], [-0.3, 2.0]])
BENT = np.array([0.4, -0.7])


def white() -> tuple[GreyBox, Variant, Point]:
    """Records of the bench, the machine as it is, and a point of it that leaves nothing."""
    own = grey_box(Machine.load("bench"), bench({}), 500, seed=8)
    nothing = Variant(own.core)
    blank = tuple(np.zeros_like(r.measured) for r in own.records)
    return own, nothing, Point(nothing, own.start(nothing), blank, 0.0, 0.0)


def test_the_curvature_along_a_step_is_that_of_a_parabola() -> None:
    r, d = np.array([3.0, -1.0]), np.array([0.2, 0.1])
    for share in (0.1, 0.3, 1.0):
        there = r + share * (d @ J) + share**2 * BENT
        assert curvature(r, there, d @ J, share) == pytest.approx(BENT)


def test_what_the_curvature_adds_must_be_smaller_than_the_step() -> None:
    along = np.array([1.0, 0.0])
    assert gentle(0.7 * along, along)
    assert not gentle(0.8 * along, along)


def test_a_chord_serves_while_steps_gain_what_it_promises() -> None:
    r = np.array([3.0, -1.0])
    g, H = J @ r, J @ J.T
    d = -np.linalg.solve(H, g)
    left = r + d @ J
    gained = float(r @ r - left @ left)
    gain = promised(g, H, d)
    assert as_foretold(gained, gain)
    assert not as_foretold(0.5 * gained, gain)
    assert not as_foretold(1.5 * gained, gain)


def test_numbers_are_carried_to_another_law_by_their_names() -> None:
    own, nothing, base = white()
    blank = base.residuals
    known = {v.label: v for v in Library(own.core, own).variants(nothing, base)}
    dry, late = known["coulomb@table"], known["sensor_delay@theta_m"]
    numbers = np.arange(own.shared + len(dry.extra), dtype=float)
    point = Point(dry, numbers, blank, 0.0, 0.0)
    assert carried(point, dry, np.full(len(numbers), -1.0)) == pytest.approx(numbers)
    other = carried(point, late, np.full(own.shared + len(late.extra), -1.0))
    assert other[: own.shared] == pytest.approx(numbers[: own.shared])
    assert other[own.shared :] == pytest.approx(-1.0)
    assert carried(point, nothing, own.start(nothing)) == pytest.approx(numbers[: own.shared])


def test_two_orders_of_a_law_are_compared_and_no_third_that_gains_less() -> None:
    own, nothing, base = white()
    blank = base.residuals
    noise = first_noise(own.core, own.records, 1e-3)
    laws = Library(own.core, own).variants(nothing, base)
    law = next(v for v in laws if v.label == "cogging@motors")
    orders = [replace(law, fixed=dict.fromkeys(law.fixed, n)) for n in (24.0, 6.0, 12.0)]
    places = [(Point(v, base.theta, blank, 0.0, 0.0), noise) for v in orders]
    for third, kept in ((80.0, 2), (95.0, 3)):
        ranked = list(zip((100.0, 99.0, third), places, strict=True))
        found = [p.variant.key for p, _ in with_rivals(ranked, 1)]
        assert found == [v.key for v in orders[:kept]]


def test_a_law_is_as_probable_as_all_its_orders_together() -> None:
    own, nothing, base = white()
    blank = base.residuals
    noise = first_noise(own.core, own.records, 1e-3)
    laws = {v.label: v for v in Library(own.core, own).variants(nothing, base)}
    law, other = laws["cogging@motors"], laws["coulomb@table"]
    orders = [replace(law, fixed=dict.fromkeys(law.fixed, n)) for n in (24.0, 6.0)]
    fits = [
        Fitted(Point(v, base.theta, blank, 0.0, 0.0), noise, 1.0, criterion, [])
        for v, criterion in zip([orders[0], other, orders[1], nothing], [0, 1, 2, 90], strict=True)
    ]
    found = Selection(own, fits[-1], fits, [], {}, finished=True, quiet=False)
    ranked = probabilities(found)
    weights = np.exp([0.0, -0.5, -1.0])
    assert [f.variant.label for f, _ in ranked] == ["cogging@motors", "coulomb@table", "nothing"]
    assert ranked[0][0] is fits[0]
    shares = [p for _, p in ranked]
    assert shares[:2] == pytest.approx(
        [(1 + weights[2]) / weights.sum(), weights[1] / weights.sum()]
    )


def test_a_shaft_brings_damping_and_is_tried_where_damping_is_named() -> None:
    core = Machine.load("bench")
    found = {
        label: Variant(core, effects=(effect,))
        for label, effect in {
            "shaft": ("shaft_compliance", "gearboxes"),
            "damping": ("mesh_damping", "meshes"),
            "friction": ("coulomb", "table"),
        }.items()
    }
    assert brings(found["shaft"], found["damping"])
    assert not brings(found["shaft"], found["friction"])
