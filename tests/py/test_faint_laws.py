"""Laws that numbers alone nearly hide: what these leave is noise, as a whole, and a score tells."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.selection.fitted import EFFORTS, Effort, Selection
from dualdrive.diagnose.selection.search import select
from test_innovations import bench

SAMPLES = 4000


def found(samples: int = SAMPLES, effort: Effort = EFFORTS["quick"], **law: float) -> Selection:
    true = bench({"torque_constant_saturation@motors": law} if law else {})
    own = grey_box(Machine.load("bench"), true, samples, 3)
    return select(own.core, own, effort)


@pytest.mark.long
def test_a_law_is_found_where_numbers_alone_leave_noise() -> None:
    selection = found(loss=0.2)
    assert selection.quiet
    assert selection.best.variant.label == "torque_constant_saturation@motors"
    assert selection.base.criterion - selection.best.criterion > 25.0


@pytest.mark.long
def test_none_is_found_where_none_is() -> None:
    selection = found()
    assert selection.quiet
    assert [f.variant.label for f in selection.finals] == ["nothing"]


@pytest.mark.long
def test_it_is_sought_on_some_samples_and_held_against_all() -> None:
    selection = found(17_000, replace(EFFORTS["quick"], samples=12_000), loss=0.2)
    assert selection.quiet
    assert selection.best.variant.label == "torque_constant_saturation@motors"
    for f in selection.finals:
        assert [len(r) for r in f.point.residuals] == [17_000]
