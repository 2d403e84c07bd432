"""Which records are searched on stretches; when these led numbers astray, and others are chosen."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.selection.base import _elsewhere, refitted_base
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.estimation.thresholds import threshold
from test_innovations import bench
from test_residual_analysis import fitted


@pytest.mark.parametrize(("samples", "searched"), [(9000, 9000), (17000, 8000)])
def test_only_long_records_are_searched_on_stretches(samples: int, searched: int) -> None:
    own = grey_box(Machine.load("bench"), bench(), samples, 1)
    base = refitted_base(Estimator(own.core, own), own)
    assert base.grey.samples == searched
    assert base.everywhere is not None
    assert len(base.everywhere.point.residuals[0]) == samples


@pytest.mark.parametrize(
    ("there", "elsewhere", "anew"),
    [
        (1.0, 1.0, False),
        (1.0, 3.0, True),
        (2.5, 44.0, True),
        (2.5, 3.0, False),
        (5.0, 44.0, False),
    ],
    ids=[
        "white on all samples",
        "white on stretches alone",
        "nearly so there, and far from it elsewhere",
        "something is missing on both",
        "much is missing on both",
    ],
)
def test_others_are_chosen_where_a_machine_fails_elsewhere_only(
    there: float, elsewhere: float, anew: bool
) -> None:
    known = fitted(0.0)
    assert there < threshold("inflation") or not anew
    own, all_of_it = (replace(known, inflation=x) for x in (there, elsewhere))
    assert _elsewhere(own, all_of_it) == anew
