"""Pictures hold the run's own numbers, say their units, and need neither window nor screen."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dualdrive.compare import Comparison, Condition, NoiseFloor, Quantity
from dualdrive.machine import Machine
from dualdrive.motion import parse_motion
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
    reversal_window,
    reversal_zoom,
    torque_speed,
    torques,
)
from dualdrive.plots.record import reversals
from dualdrive.plots.style import scale
from dualdrive.run import Run
from dualdrive.simulation import simulate
from dualdrive.traces import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
ARCSEC = np.pi / 648000


@cache
def swing() -> Run:
    """The 100 t table to 10 mrad and back."""
    motion = parse_motion("cycle:0.01;0,v=0.02,a=0.01,j=0.05,dwell=0.5,start=2")
    return simulate(Machine.load("heavy-table-100t"), motion)


@cache
def hunting() -> Run:
    """550 t without tension: the play never comes to rest."""
    machine = Machine.load("heavy-table-550t")
    machine.set("controller.T_ten", 0.0)
    return simulate(machine, parse_motion("move:0.02,v=0.03,a=0.01,j=0.05,start=2"), end=12.0)


@cache
def linear() -> Run:
    return simulate(Machine.load("linear-axis"))


def trace_of(run: Run, *channels: str) -> Trace:
    """The channels as a recorder would have them."""
    return Trace(run.t, {name: run[name] for name in channels})


@cache
def comparison() -> Comparison:
    """Two records; the model of the error is a quarter too small, and nothing else is wrong."""
    t = np.linspace(0.0, 10.0, 2001)
    error, current = 40 * ARCSEC * np.sin(2 * np.pi * t), 5.0 + np.cos(t)

    def quantity(record: str, name: str, kind: str, unit: str, x: Array, share: float) -> Quantity:
        noise, counted = NoiseFloor(0.02 * float(np.std(x)), "stated"), np.ones(len(t), dtype=bool)
        return Quantity(record, name, kind, unit, kind, True, t, x, share * x, counted, 0.0, noise)

    quantities = [
        quantity(record, *what)
        for record in ("first", "second")
        for what in (
            ("e", "following error", "rad", error, 0.75),
            ("I_1", "current", "A", current, 1.0),
        )
    ]
    where = [Condition("motion", "reversal", 2.5, 0.1, 0.6), Condition("time", "0 .. 1 s", 9, 1, 1)]
    return Comparison("bench", "closed_loop", quantities, where, {}, {}, [])


def drawn(axes: Axes, label: str) -> tuple[Array, Array]:
    """The data of the line with this label."""
    (found,) = [line for line in axes.lines if line.get_label() == label]
    x, y = found.get_data()
    return np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)


def vertices(path: Any) -> Array:
    return np.asarray(path.vertices, dtype=np.float64)


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


def test_torques_are_those_of_the_run() -> None:
    run = swing()
    (axes,) = torques(run).axes
    assert axes.get_ylabel() == "motor torque [N·m]"
    for n in (1, 2):
        t, torque = drawn(axes, f"motor {n}")
        np.testing.assert_array_equal(t, run.t)
        np.testing.assert_allclose(torque, run[f"T_{n}"], rtol=1e-15)
    held = drawn(axes, "±½ tension")[1]
    np.testing.assert_allclose(np.abs(held[-1]), 30.0, rtol=1e-3)  # T_ten 60 N m, filter settled


def test_the_torque_limit_is_drawn_where_it_is_near() -> None:
    machine = Machine.load("heavy-table-550t")
    machine.set("motors.T_max", 100.0)
    run = simulate(machine, parse_motion("move:0.04,v=0.05,a=0.03,j=0.06,start=2"), end=4.0)
    (axes,) = torques(run).axes
    assert drawn(axes, "limit ±100 N·m")[1].tolist() == [100.0, 100.0]
    labels = [line.get_label() for line in torques(swing()).axes[0].lines]
    assert not any(str(label).startswith("limit") for label in labels)  # 200 N m, 45 used


def test_flank_changes_are_marked_when_they_happen() -> None:
    run = hunting()
    (axes,) = torques(run).axes
    marks = sorted(
        float(vertices(path)[0, 0]) for rug in axes.collections for path in rug.get_paths()
    )
    happened = [
        e.t
        for e in run.events
        if e.element.startswith("mesh")
        and (e.from_ in ("front", "back")) != (e.to in ("front", "back"))
    ]
    assert len(happened) > 40
    np.testing.assert_allclose(marks, sorted(happened))


def test_following_error_is_in_arc_seconds() -> None:
    run = swing()
    (axes,) = following_error(run).axes
    assert axes.get_ylabel() == "following error [arcsec]"
    error = np.asarray(axes.lines[0].get_ydata())
    np.testing.assert_allclose(error * ARCSEC, run["theta_ref"] - run["theta_m"], atol=1e-12)
    recorded = following_error(trace_of(run, "theta_ref", "theta_m")).axes[0]
    np.testing.assert_allclose(np.asarray(recorded.lines[0].get_ydata()), error, atol=1e-6)


def test_a_linear_axis_is_drawn_in_its_own_units() -> None:
    figure = overview(linear())
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["table position [mm]", "following error [mm]", "motor force [N]"]


def test_deflection_leaves_the_band_where_the_strip_shows_a_flank() -> None:
    run = hunting()
    above, below = mesh_deflection(run).axes
    _, x = drawn(above, "mesh 1")
    np.testing.assert_allclose(1e-3 * x, run["mesh_1.deflection"], rtol=1e-12)
    ends = [np.asarray(line.get_data(), dtype=np.float64) for line in above.lines]
    edges = sorted({float(y[0]) for x, y in ends if len(x) == 2})
    np.testing.assert_allclose(edges, [-1.1, 1.1])
    shown = np.zeros(len(run.t))  # what the bars of mesh 1 cover, by flank
    sides = {"front flank": 1, "in the gap": 0, "back flank": -1}
    key: Any = below.get_legend()
    colours = {
        patch.get_facecolor(): sides[text.get_text()]
        for patch, text in zip(key.get_patches(), key.get_texts(), strict=True)
    }
    bars: Any
    for bars in below.collections[:3]:
        side = colours[tuple(bars.get_facecolor()[0])]
        for path in bars.get_paths():
            begin, end = vertices(path)[:, 0].min(), vertices(path)[:, 0].max()
            shown[(run.t >= begin - 1e-9) & (run.t < end - 1e-9)] = side
    np.testing.assert_array_equal(shown[:-1], run["mesh_1.flank"][:-1])
    touching = np.sign(x) * (np.abs(x) > 1.1)
    assert np.mean(shown[:-1] == touching[:-1]) > 0.99  # damping lets a flank part a little early


def test_reversal_is_where_the_command_turns_round() -> None:
    run = swing()
    low, high = reversal_window(run)
    speed = run["omega_ref"]
    turned = run.t[np.flatnonzero(speed < 0)[0]]
    assert low < turned < high
    inside = speed[(run.t >= low) & (run.t <= high)]
    assert inside.max() > 0.5 * speed.max()
    assert inside.min() < 0.5 * speed.min()
    with pytest.raises(PlotError, match="reversal 2: this record has 1; choose 1"):
        reversal_zoom(run, 2)


def test_reversals_bridge_a_rest_and_ignore_creeping() -> None:
    t = np.linspace(0.0, 10.0, 1001)
    speed = np.where(t < 4.0, 1.0, np.where(t < 6.0, 0.005, -2.0))
    ((begin, end),) = reversals(t, speed)
    assert (begin, end) == pytest.approx((3.99, 6.0))
    assert reversals(t, np.ones_like(t)) == []
    assert len(reversals(t, np.sin(2 * np.pi * t))) == 19  # inside ten whole periods


def test_time_of_a_zoom_counts_from_the_turn() -> None:
    run = hunting()
    figure = reversal_zoom(run, -1)
    assert figure.axes[-1].get_xlabel() == "time from the reversal [ms]"
    ms, _ = drawn(figure.axes[0], "motor 1")
    title = figure.axes[0].get_title(loc="left")
    at = float(title.removeprefix("Reversal at ").removesuffix(" s"))
    speed = np.interp(at, run.t, run["omega_m"])
    assert abs(speed) < 0.02 * np.abs(run["omega_m"][run.t > 8]).max()
    assert ms[0] < 0 < ms[-1]


def test_friction_is_what_the_torque_shows_at_steady_speed() -> None:
    """A record whose torque is inertia, Coulomb and viscous friction: 3 N m + 0.5 N m s/rad."""
    t = np.arange(0.0, 60.0, 1e-3)
    levels = np.array([4.0, 8.0, -4.0, -8.0])
    wanted = levels[(t // 15).astype(int)]
    speed = np.empty_like(t)
    now = 0.0
    for k, goal in enumerate(wanted):  # 2 rad/s² to the next level
        now += float(np.clip(goal - now, -2e-3, 2e-3))
        speed[k] = now
    change = np.gradient(speed, t)
    torque = 7.0 * change + 3.0 * np.sign(speed) + 0.5 * speed
    (axes,) = torque_speed(Trace(t, {"omega_m": speed, "T_1": torque})).axes
    (bars,) = axes.containers
    x, y = np.asarray(bars[0].get_data())
    np.testing.assert_allclose(x, [-8, -4, 4, 8], atol=1e-6)
    np.testing.assert_allclose(y, [-7, -5, 5, 7], atol=1e-6)


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
