"""Pictures of a comparison hold its own numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dualdrive.plots import PlotError, Step, ladder, measured_vs_model, residuals
from pictured import comparison, drawn


def test_measured_and_model_are_the_comparisons_own() -> None:
    above, below = measured_vs_model(comparison()).axes
    assert above.get_ylabel() == "following error [arcsec]"
    assert below.get_ylabel() == "current I_1 [A]"
    t = comparison().quantities[0].t
    wave = 40 * np.sin(2 * np.pi * t)
    np.testing.assert_allclose(drawn(above, "measured")[1], wave, atol=1e-9)
    np.testing.assert_allclose(drawn(above, "model")[1], 0.75 * wave, atol=1e-9)
    assert above.get_title(loc="left") == "error 0.25 of the signal, noise floor 0.02"
    (only,) = measured_vs_model(comparison(), ["I_1"], record="second", window=(2, 3)).axes
    assert drawn(only, "measured")[0].min() == pytest.approx(2.0)
    with pytest.raises(PlotError, match="record 'third': not compared; the records are first, sec"):
        measured_vs_model(comparison(), record="third")
    with pytest.raises(PlotError, match="channel 'T_1': not compared; there are e, I_1"):
        residuals(comparison(), ["T_1"])


def test_residuals_over_time_by_size_and_by_frequency() -> None:
    figure = residuals(comparison(), ["e"])
    over_time, spread, spectrum, by_condition = figure.axes
    t = comparison().quantities[0].t
    left = np.asarray(over_time.lines[0].get_ydata())
    np.testing.assert_allclose(left, -10 * np.sin(2 * np.pi * t), atol=1e-9)
    bars: Any = spread.patches
    assert sum(bar.get_width() for bar in bars) == pytest.approx(1.0)
    for label, size in (("signal", 40.0), ("residual", 10.0)):
        frequency, density = drawn(spectrum, label)
        assert frequency[np.argmax(density)] == pytest.approx(1.0, abs=0.4)
        power = np.trapezoid(density**2, frequency)
        assert np.sqrt(2 * power) == pytest.approx(size, rel=0.05)  # of a sine: its amplitude
    bars = by_condition.patches
    assert [bar.get_width() for bar in bars] == [2.5]
    assert [label.get_text() for label in by_condition.get_yticklabels()] == ["reversal"]


def test_ladder_shows_per_cent_and_refuses_nonsense() -> None:
    steps = [Step("nominal", 0.41, 0.43), Step("+ coulomb@table", 0.031, 0.034)]
    (axes,) = ladder(steps, noise_floor=0.029).axes
    np.testing.assert_allclose(drawn(axes, "fitted records")[1], [41.0, 3.1])
    np.testing.assert_allclose(drawn(axes, "held-out records")[1], [43.0, 3.4])
    np.testing.assert_allclose(drawn(axes, "noise floor")[1], 2.9)
    low, high = axes.get_ylim()
    assert low < 2.9
    assert high > 43
    with pytest.raises(PlotError, match=r"'b', fitted records: error nan must be above 0"):
        ladder([Step("a", 0.1), Step("b", float("nan"))])
    with pytest.raises(PlotError, match="no step given"):
        ladder([])
