"""Where a law begins that is met by two pinions, each at a phase of its own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dualdrive.diagnose.screening.score import _Probe, _start

SIZE, PHASE, SPACING = "error@table.amplitude", "error@table.phase", "error@table.spacing"


def probes() -> list[_Probe]:
    """Alike at both pinions and in turn, a quarter of a turn apart each."""
    at = {SIZE: 1e-4, PHASE: 0.0, SPACING: math.pi}
    return [
        _Probe(at, SIZE, PHASE, turned=turned, opposite=opposite)
        for opposite in ("", SPACING)
        for turned in (False, True)
    ]


def begun(kept: slice, sizes: list[float]) -> dict[str, float]:
    return _start([(probe, np.zeros(0)) for probe in probes()[kept]], np.array(sizes))


def test_what_both_meet_alike_and_in_turn_spans_every_spacing() -> None:
    """One pinion meets the sum of the two waves, the other their difference."""
    found = begun(slice(None), [1.0, 0.0, 0.0, 1.0])
    assert found[PHASE] == pytest.approx(0.25 * math.pi)
    assert found[SPACING] == pytest.approx(-0.5 * math.pi)
    assert found[SIZE] == pytest.approx(1e-4 * math.sqrt(2.0))


def test_a_law_whose_first_probes_lost_the_record_begins_by_the_others() -> None:
    """That had ended a diagnosis in a KeyError."""
    found = begun(slice(1, None), [5.0, 2.0, 0.0])
    assert found[SPACING] == pytest.approx(math.pi)
    assert found[PHASE] == pytest.approx(0.0)
    assert found[SIZE] == pytest.approx(2e-4)
