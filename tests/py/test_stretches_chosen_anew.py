"""When stretches of a record have led a machine's numbers astray, and others are chosen."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dualdrive.diagnose.selection.base import _elsewhere
from dualdrive.estimation.thresholds import threshold
from test_residual_analysis import fitted


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
