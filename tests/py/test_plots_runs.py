"""Pictures of a run hold its own numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dualdrive.machine import Machine
from dualdrive.motion import parse_motion
from dualdrive.plots import (
    PlotError,
    following_error,
    mesh_deflection,
    overview,
    reversal_window,
    reversal_zoom,
    torque_speed,
    torques,
)
from dualdrive.plots.record import reversals
from dualdrive.simulation import simulate
from dualdrive.traces import Trace
from pictured import ARCSEC, drawn, hunting, linear, swing, trace_of, vertices


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
