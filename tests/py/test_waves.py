"""Waves are fitted by their cosine and sine: a fit passes through none of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.laws import carrier
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.screening.orders import strongest_orders
from dualdrive.innovations import (
    GreyBox,
    Point,
    Variant,
    coordinates,
    deviations,
    first_noise,
    fit,
    values,
    waves,
)
from test_innovations import bench

SIZE, PHASE = 0.1, 2.5
LAW = "torque_ripple@motors"


def record() -> tuple[GreyBox, Variant]:
    """Of motors whose torque ripples, and the law that says so: a wave at each."""
    own = {"amplitude": SIZE, "order": 24.0, "phase": PHASE}
    grey = grey_box(Machine.load("bench"), bench({LAW: own}), 2000, 3)
    nothing = Variant(grey.core)
    blank = tuple(np.zeros_like(r.measured) for r in grey.records)
    known = Library(grey.core, grey).variants(
        nothing, Point(nothing, grey.start(nothing), blank, 0.0, 0.0)
    )
    return grey, next(v for v in known if v.key == f"{LAW} (order 24)")


def told(law: Variant, amplitude: float, phase: float) -> dict[str, float]:
    """These numbers for each of its waves."""
    own = {"amplitude": amplitude, "phase": phase}
    return {p.path: own[p.path.rpartition(".")[2]] for p in law.extra}


def test_values_come_back_and_other_numbers_stand_as_they_are() -> None:
    grey, law = record()
    known = told(law, 0.2, -3.0)
    assert len(waves(law.extra)) == 2
    assert values(law.extra, coordinates(law.extra, known)) == pytest.approx(known)
    assert waves(grey.nominal) == []
    u = np.array([p.start for p in grey.nominal])
    assert values(grey.nominal, u) == {p.path: p.value(p.start) for p in grey.nominal}


def test_deviations_are_those_of_amplitude_and_phase() -> None:
    """Against a cloud of points."""
    own = record()[1].extra[:2]
    u = coordinates(own, {own[0].path: 0.2, own[1].path: 1.0})
    covariance = u[0] ** 2 * np.array([[4e-3, 1e-3], [1e-3, 1e-3]])
    cloud = np.random.default_rng(1).multivariate_normal(u, covariance, 20_000)
    found = np.array([list(values(own, x).values()) for x in cloud])
    spread = deviations(own, u, covariance)
    np.testing.assert_allclose(np.std(found, axis=0), spread * [own[0].scale, 1.0], rtol=0.03)


@pytest.mark.parametrize("far", [0.5, math.pi])
def test_a_fit_passes_through_none_of_it(far: float) -> None:
    """From the opposite phase an amplitude would be stopped at zero, and its phase wander."""
    grey, law = record()
    own = coordinates(law.extra, told(law, 0.05, PHASE + far))
    theta = np.r_[grey.start(Variant(grey.core)), own]
    gains = grey.gains(law, theta, first_noise(grey.core, grey.records, 0.01))
    found = fit(grey, law, theta, gains, steps=10)
    numbers = values(law.extra, found.theta[grey.shared :])
    for path, x in numbers.items():
        assert x == pytest.approx(told(law, SIZE, PHASE)[path], rel=0.1), path


def test_slow_torques_of_a_low_order_are_tried_though_no_innovation_shows_them() -> None:
    """A filter follows them by torques of unknown course."""
    law = "angle_dependent_friction@table"
    own = {"torque": 0.3, "order": 3.0, "phase": 0.5}
    grey = grey_box(Machine.load("bench"), bench({law: own}), 2000, 3)
    nothing, noise = Variant(grey.core), first_noise(grey.core, grey.records, 0.1)
    [found] = grey.likelihoods(nothing, [(grey.start(nothing), noise)])
    assert found is not None
    by = carrier(law.partition("@")[0])
    shown = strongest_orders(grey.core, grey.records, found[0], "table", by, 2)
    assert 3 not in shown
    tried = [v for v in Library(grey.core, grey).variants(nothing, found[0]) if v.label == law]
    assert {f"{law}.order": 3.0} in [dict(v.fixed) for v in tried]
