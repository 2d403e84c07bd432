"""Scores of parts with states of their own, before anything is refitted."""

from __future__ import annotations

import functools

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.parts import is_joint, is_part, part_score
from dualdrive.diagnose.thresholds import threshold
from dualdrive.innovations import Variant, first_noise, maximum_likelihood
from test_innovations import bench

SOFT = {"shaft_compliance@gearboxes": {"stiffness": 260.0}}


@functools.cache
def score(soft: bool) -> float:
    """Of a shaft that gives, on a record of a bench that has one or none."""
    own = grey_box(Machine.load("bench"), bench(SOFT if soft else {}), 2000, seed=6)
    nothing = Variant(own.core)
    found = maximum_likelihood(
        own, nothing, own.start(nothing), first_noise(own.core, own.records, 1e-2)
    )
    assert found is not None
    point, noise, gains = found
    columns = own.columns(point, range(len(point.theta)), gains)
    [variant] = [
        v
        for v in Library(own.core, own).variants(nothing, point)
        if v.effects[-1] == ("shaft_compliance", "gearboxes")
    ]
    assert is_part(variant)
    assert is_joint(variant)
    return part_score(own, point, columns, variant, noise)


def test_a_shaft_that_gives_is_seen_by_its_score() -> None:
    assert score(soft=True) > 10.0 * threshold("hopeless")


def test_where_none_gives_there_is_less_to_see() -> None:
    """Not nothing: at the sizes that are tried a shaft is no small change of a stiff machine."""
    assert score(soft=False) < 0.5 * score(soft=True)
