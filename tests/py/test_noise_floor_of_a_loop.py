"""What sensors leave of a simulated loop is no more than what a machine leaves of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dualdrive.diagnose.decision import Decision
from dualdrive.diagnose.headline_errors import headline_errors
from dualdrive.diagnose.selection import Fitted, Selection
from dualdrive.diagnose.uncertainty import Uncertainty
from dualdrive.innovations import inflation
from test_likelihood import grey, likeliest


def error_under(times: float) -> dict[str, float]:
    """Headline errors where sensors' zeros are taken to drift so many times as far."""
    own = grey(0.0)
    point, noise, gains = likeliest(0.0)
    far = replace(noise, drift={kind: times * s for kind, s in noise.drift.items()})
    base = Fitted(point, far, inflation(point), 0.0, gains, told_under=noise)
    found = Selection(own, base, [base], [], {}, finished=True, quiet=True)
    return headline_errors(own, found, Decision("adequate", [(base, 1.0)]), Uncertainty(own))[1]


def test_zeros_that_are_taken_to_drift_far_leave_no_more_than_the_machine() -> None:
    near, far = error_under(1.0), error_under(1000.0)
    assert near["noise_floor"] == pytest.approx(near["refitted"], rel=0.1)
    assert far["noise_floor"] == far["refitted"] == near["refitted"]
