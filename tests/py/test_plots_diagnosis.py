"""Pictures of a diagnosis hold its own numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import diagnosed as example
from diagnosed import diagnosis
from dualdrive.plots import (
    PlotError,
    Step,
    candidates,
    conditions,
    diagnosed,
    equations,
    experiments,
    ladder,
    missing_torque,
    planned_motion,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def widths(axes: Axes) -> list[float]:
    return [bar.get_width() for bar in axes.patches]  # type: ignore[attr-defined]


def labels(axes: Axes) -> list[str]:
    return [tick.get_text() for tick in axes.get_yticklabels()]


def words(figure: Figure) -> str:
    return " ".join(text.get_text() for axes in figure.axes for text in axes.texts)


def test_missing_torque_is_drawn_in_units_people_read() -> None:
    [shape] = diagnosis().shapes
    [axes] = missing_torque(shape).axes
    x, y = axes.lines[0].get_data()
    assert np.asarray(x) == pytest.approx(1e3 * shape.at)  # mrad/s
    assert np.asarray(y) == pytest.approx(shape.value)
    band = axes.collections[0].get_paths()[0].vertices
    assert np.asarray(band)[:, 1].max() == pytest.approx(shape.high.max())
    assert "N·m" in axes.get_ylabel()
    with pytest.raises(PlotError, match="1 points; needs two"):
        missing_torque(replace(shape, at=shape.at[:1]))


def test_candidates_are_bars_of_probability_and_groups_are_marked() -> None:
    d = diagnosis()
    figure = candidates(d)
    [axes] = figure.axes
    assert widths(axes) == [0.61, 0.36, 0.02, 0.0]
    assert labels(axes)[:2] == ["coulomb@table", "stribeck@table"]
    first, twin, other, failed = (bar.get_facecolor() for bar in axes.patches)
    assert first == twin != other
    assert np.asarray(failed)[3] == 0.0  # hollow: its refit failed
    assert "cross-validated 3.3 %" in words(figure)
    assert len(candidates(d, most=2).axes[0].patches) == 2
    with pytest.raises(PlotError, match="names none"):
        candidates(replace(d, candidates=[]))


def test_equations_are_sorted_and_the_failing_one_is_marked() -> None:
    fault = diagnosis().equation
    assert fault is not None
    [axes] = equations(fault).axes
    assert widths(axes) == [0.91, 0.05, 0.04]
    colours = [bar.get_facecolor() for bar in axes.patches]
    assert colours[0] != colours[1] == colours[2]


def test_experiments_stand_beside_the_distance_that_decides() -> None:
    best = diagnosis().next_experiment
    assert best is not None
    [axes] = experiments(best).axes
    assert labels(axes) == [
        best.name,
        "slow two-way ramps",
        "micro-reversals",
        "quick moves, both ways",
    ]
    assert widths(axes)[:3] == [41.0, 19.0, 7.5]
    assert np.asarray(axes.lines[0].get_xdata()) == pytest.approx([11.0, 11.0])


def test_a_planned_motion_is_that_of_its_words() -> None:
    best = diagnosis().next_experiment
    assert best is not None
    place, speed = planned_motion(best).axes
    arcsec = math.pi / 648000
    assert np.max(place.lines[0].get_ydata()) == pytest.approx(0.0066 / arcsec, rel=1e-3)
    assert np.max(np.abs(speed.lines[0].get_ydata())) == pytest.approx(0.84, rel=1e-3)  # mrad/s


def test_conditions_take_a_diagnosis_and_leave_lines_of_a_spectrum_out() -> None:
    d = diagnosis()
    line = replace(d.where[0], kind="order", condition="table order 7", excess=50.0)
    [axes] = conditions(replace(d, where=[*d.where, line])).axes
    assert "table order 7" not in labels(axes)


def test_a_sheet_holds_what_was_found_and_no_more() -> None:
    d = diagnosis()
    assert [axes.get_title(loc="left") for axes in diagnosed(d).axes] == [
        "What could explain it", "Where it fails", "Which equation", "What is missing",
    ]  # fmt: skip
    assert len(diagnosed(replace(d, candidates=[], shapes=[], equation=None)).axes) == 1
    with pytest.raises(PlotError, match="no law and no error to draw"):
        diagnosed(replace(d, candidates=[], shapes=[], equation=None, where=[]))


def test_a_ladder_without_a_known_floor_or_held_out_record_is_drawn_all_the_same() -> None:
    steps = [
        Step("nominal", 0.4, math.nan),
        Step("+ angle_dependent_friction@table", 0.1, math.nan),
    ]
    [axes] = ladder(steps, noise_floor=math.nan).axes
    assert [line.get_label() for line in axes.lines] == ["fitted records"]
    assert [t.get_text() for t in axes.get_xticklabels()][1].count("\n") >= 1
    assert len(ladder(example.ladder().steps, noise_floor=0.03).axes[0].lines) == 3


def test_two_directions_are_two_points_with_bars_and_no_line_between() -> None:
    [speed] = diagnosis().shapes
    way = replace(
        speed, coordinate="direction", coordinate_unit="", at=np.array([-1.0, 1.0]),
        value=np.array([-90.0, 110.0]), low=np.array([-95.0, 100.0]), high=np.array([-80.0, 120.0]),
    )  # fmt: skip
    [axes] = missing_torque(way).axes
    points, *_ = axes.lines
    assert points.get_linestyle() == "None"
    ends = [segment[:, 1].tolist() for segment in axes.collections[0].get_segments()]  # type: ignore[attr-defined]
    assert ends == [[-95.0, -80.0], [100.0, 120.0]]
