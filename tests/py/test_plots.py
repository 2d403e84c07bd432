"""Pictures say their units, are drawn without window or screen, and refuse what they can't draw."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from dualdrive import tune
from dualdrive.motion import move
from dualdrive.plots import (
    PlotError,
    Step,
    conditions,
    following_error,
    ladder,
    measured_vs_model,
    mesh_deflection,
    overview,
    residuals,
    reversal_zoom,
    torque_speed,
    torques,
    tuning_step,
)
from dualdrive.plots.style import scale
from dualdrive.plots.sweep_figures import sweep_figures
from dualdrive.sweeps import sweep
from dualdrive.tune.result import Assessment, Curve, Panel
from pictured import ARCSEC, comparison, hunting, linear, swing, trace_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


EVERY: dict[str, Callable[[], Figure]] = {
    "overview": lambda: overview(swing()),
    "overview of a hunting table": lambda: overview(hunting()),
    "overview of a linear axis": lambda: overview(linear()),
    "overview of a trace": lambda: overview(trace_of(swing(), "theta_m", "T_1", "T_2")),
    "torques": lambda: torques(hunting()),
    "torques of a trace": lambda: torques(trace_of(swing(), "I_1", "I_2")),
    "following error": lambda: following_error(swing()),
    "mesh deflection": lambda: mesh_deflection(hunting()),
    "reversal": lambda: reversal_zoom(swing()),
    "reversal of a hunting table": lambda: reversal_zoom(hunting(), -1),
    "torque over speed": lambda: torque_speed(swing()),
    "measured and model": lambda: measured_vs_model(comparison()),
    "residuals": lambda: residuals(comparison()),
    "conditions": lambda: conditions(comparison()),
    "ladder": lambda: ladder([Step("nominal", 0.4, 0.5), Step("refitted", 0.1, 0.2)]),
}


@pytest.fixture(params=list(EVERY))
def figure(request: pytest.FixtureRequest) -> Figure:
    return EVERY[request.param]()


def test_every_axis_says_what_and_in_which_unit(figure: Figure) -> None:
    names = r"(arcsec|mrad|deg|mm|um|µm|m?N·m|kN·m|N|A|s|ms|m?rad/s|mm/s|% of the signal|ratio|Hz)"
    unit = re.compile(rf".+ \[{names}(/√Hz)?\]")
    for axes in figure.axes:
        words = any(label.get_text()[:1].isalpha() for label in axes.get_yticklabels())
        bare = not axes.get_yticklabels() or not axes.yaxis.get_tick_params()["labelleft"]
        assert words or bare or unit.fullmatch(axes.get_ylabel()), axes.get_ylabel()
    lowest = [axes for axes in figure.axes if axes.get_xlabel()]
    for axes in lowest:
        named = not axes.get_xticks().size
        assert named or unit.fullmatch(axes.get_xlabel()), axes.get_xlabel()
    named_steps = figure.axes[-1].get_xticklabels()[0].get_text() == "nominal"
    assert lowest or named_steps


def test_nothing_drawn_is_nan(figure: Figure) -> None:
    lines = [line for axes in figure.axes for line in axes.lines]
    assert lines
    for line in lines:
        assert np.isfinite(np.asarray(line.get_data(), dtype=np.float64)).all(), line.get_label()


def test_it_can_be_saved_without_a_screen(figure: Figure) -> None:
    page = io.BytesIO()
    figure.savefig(page, format="png")
    assert len(page.getvalue()) > 10_000


def test_own_axes_are_drawn_in_and_kept() -> None:
    from matplotlib.figure import Figure

    page = Figure()
    left, right = page.subplots(1, 2)
    assert torques(swing(), axes=left) is page
    assert following_error(swing(), axes=right, window=(2.0, 3.0)) is page
    t = np.asarray(right.lines[0].get_xdata())
    assert (t.min(), t.max()) == pytest.approx((2.0, 3.0))
    with pytest.raises(PlotError, match="axes: 1 given; this picture has 2 panels"):
        mesh_deflection(swing(), axes=[left])


def test_what_cannot_be_drawn_is_refused_in_one_line() -> None:
    only_angle = trace_of(swing(), "theta_m")
    refusals: tuple[tuple[Callable[[Any], object], str], ...] = (
        (torques, "no motor torque T_1 and no current I_1"),
        (following_error, "theta_ref and theta_m are both needed"),
        (mesh_deflection, "no mesh with play"),
        (torque_speed, "no motor torque"),
    )
    for draw, rule in refusals:
        with pytest.raises(PlotError, match=rule) as caught:
            draw(only_angle)
        assert "\n" not in str(caught.value)
    with pytest.raises(PlotError, match=r"0 samples in 90 .. 99 s"):
        torques(swing(), window=(90.0, 99.0))


@pytest.mark.parametrize(
    ("unit", "value", "factor", "shown"),
    [
        ("rad", 20 * ARCSEC, ARCSEC, "arcsec"),
        ("rad", 0.02, 1e-3, "mrad"),
        ("rad", 1.0, np.pi / 180, "deg"),
        ("m", 1e-4, 1e-6, "µm"),
        ("m", 0.02, 1e-3, "mm"),
        ("N*m", 0.06, 1e-3, "mN·m"),
        ("N*m", 60.0, 1.0, "N·m"),
        ("N*m", 4e4, 1e3, "kN·m"),
        ("s", 0.1, 1e-3, "ms"),
        ("A", 5.0, 1.0, "A"),
        ("", 5.0, 1.0, ""),
    ],
)
def test_units_are_those_people_read(unit: str, value: float, factor: float, shown: str) -> None:
    found = scale(unit, [-value, 0.0])
    assert found.factor == pytest.approx(factor)
    assert found.unit == shown


def test_the_callers_own_style_is_left_alone() -> None:
    import matplotlib

    before = dict(matplotlib.rcParams)
    overview(swing())
    assert dict(matplotlib.rcParams) == before


def test_importing_the_pictures_loads_no_matplotlib() -> None:
    code = "import sys, dualdrive.plots; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_map_begins_where_its_axes_can(tmp_path: Path) -> None:
    path = tmp_path / "grid.h5"
    grid = {"meshes.gap": "0:4mrad:3", "table.J": "0.2,0.3"}
    motion = move(0.01, v=0.1, a=0.5, end=0.4)
    with sweep("bench", grid, motion=motion, output=path) as found:
        axes = sweep_figures(found, "peak_error").axes[0]
    assert axes.get_xlim()[0] == 0.0
    assert 0.0 < axes.get_ylim()[0] < 0.2


def test_marks_of_a_step_can_be_told_apart() -> None:
    x = np.linspace(0.0, 1.0, 5)
    curves = (Curve("all closed", x, x), Curve("one open", x, x**2))
    marks = ((0.4, "edge, all closed"), (0.6, "edge, one open"), (0.6, "edge, two"), (0.9, "set"))
    panel = Panel("growth", "gain", "1/s", curves, marks)
    none = Assessment(True, -1.0, 1.0, {}, {}, None)
    step = tune.Step(4, "gain", (), none, none, panels=(panel,))
    (axes,) = tuning_step(step).axes
    lines = {str(line.get_label()): line for line in axes.get_lines()}
    assert list(lines)[2:] == [
        "edge, all closed: 0.4",
        "edge, one open\nedge, two: 0.6",
        "set: 0.9",
    ]
    drawn = list(lines.values())
    assert [line.get_color() for line in drawn[2:4]] == [line.get_color() for line in drawn[:2]]
    assert len({line.get_linestyle() for line in drawn[2:]}) == 3
