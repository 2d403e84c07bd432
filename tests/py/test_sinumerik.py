"""A frequency measurement that a SINUMERIK control saved: read, tuned with, and damaged."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from dualdrive.linear import LinearError, differ, read_response
from dualdrive.tune import tune
from heavy_table import heavy

SINUMERIK = Path(__file__).parent / "exports" / "sinumerik_response.xml"


def test_a_measurement_that_a_control_saved_is_read_and_tuned_with() -> None:
    """A speed loop of a SINUMERIK 840D sl; nothing of dualdrive had a hand in the file.

    Its own numbers tell whether it is understood: lines 1/(2044 x 125 us) apart, a loop that
    follows at low frequencies, and a coherence near 1 that one wrong digit would end.
    """
    found = read_response(SINUMERIK)
    np.testing.assert_allclose(np.diff(found.frequency_hz), 1 / (2044 * 125e-6), rtol=1e-9)
    assert found.frequency_hz[[0, -1]] == pytest.approx([3.914, 191.78], abs=0.01)
    assert found.coherence is not None
    assert found.coherence.min() > 0.997
    assert found.coherence.max() <= 1.0
    assert found.magnitude_db[0] == pytest.approx(0.0, abs=0.05)
    assert found.phase_deg[0] == pytest.approx(-4.2, abs=0.1)
    assert (np.diff(found.phase_deg[::10]) < 0).all()
    assert np.interp(-3.0, -found.magnitude_db, found.frequency_hz) < 60.0
    both = differ(found, found)
    done = tune(heavy("empty"), until=3, measured=both)
    words = " ".join(line for step in done.steps for line in step.done)
    assert "measured" in words
    assert done.steps[2].status == "done"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("</ResponseTestCustom>", "", "no XML, or cut off"),
        ("kO3U-*9lJ3", "kO3U-*9lJ", "ends within a number"),
        ("kO3U-*9lJ3", "kO3U-<9lJ3", "'<' is no digit"),
        (
            '"m_iInputSigNodeUniqueInstanceID">1',
            '"m_iInputSigNodeUniqueInstanceID">7',
            "instance 7",
        ),
        (
            '<unsigned_int name="m_uSignodeId">62',
            '<unsigned_int name="m_uSignodeId">63',
            "no cross",
        ),
        ("m_crossSpecInfoList", "m_other", "no cross spectrum"),
        ('<?xml version="1.0"', '<!DOCTYPE a>\n<?xml version="1.0"', "document type"),
    ],
)
def test_a_damaged_measurement_says_what_is_wrong(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    text = SINUMERIK.read_text("latin-1")
    assert old in text
    path = tmp_path / "response.xml"
    path.write_text(text.replace(old, new), "latin-1")
    with pytest.raises(LinearError, match=re.escape(said)) as refused:
        read_response(path)
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)
