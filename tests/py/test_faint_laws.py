"""Laws that numbers alone nearly hide: what these leave is noise, as a whole, and a score tells."""

from __future__ import annotations

import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.selection.fitted import EFFORTS, Selection
from dualdrive.diagnose.selection.search import select
from test_innovations import bench

SAMPLES = 4000


def found(**saturation: float) -> Selection:
    true = bench({"torque_constant_saturation@motors": saturation} if saturation else {})
    own = grey_box(Machine.load("bench"), true, SAMPLES, 3)
    return select(own.core, own, EFFORTS["quick"])


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
