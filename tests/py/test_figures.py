"""Figures of a run against closed forms, hand-written events and published amplitudes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dualdrive.figures import declared, figures
from dualdrive.machine import Machine
from dualdrive.motion import move, sine
from dualdrive.run import Event, Run
from dualdrive.simulation import simulate

ARCSEC = math.pi / 648000


@pytest.fixture(scope="module")
def finished() -> Run:
    """A short run of a machine with two motors and two meshes, whose arrays tests replace."""
    machine = Machine.load("heavy-table-empty")
    return simulate(machine, end=0.01, signals=["e", "T_1", "T_2"])


def altered(run: Run, t: Any, e: Any, T_1: Any = 0.0, T_2: Any = 0.0, **changes: Any) -> Run:
    columns = np.column_stack([np.broadcast_to(x, np.shape(t)) for x in (e, T_1, T_2)])
    empty = np.zeros((len(t), 0))
    return dataclasses.replace(
        run,
        t=np.array(t),
        values=columns,
        names=("e", "T_1", "T_2"),
        modes=np.zeros((len(t), len(run.elements)), np.int8),
        work=empty,
        **changes,
    )


def test_every_declared_figure_is_there_and_no_other(finished: Run) -> None:
    names = [figure.name for figure in declared(finished.machine)]
    assert list(figures(finished)) == names
    assert {"peak_error", "motor_2.torque_rms", "mesh_1.reversals", "events"} <= set(names)


def test_means_weigh_uneven_times_as_they_should(finished: Run) -> None:
    """A sine over whole periods has RMS A/√2, however its samples crowd."""
    t = 4.0 * np.linspace(0.0, 1.0, 40001) ** 3
    wave = np.sin(2 * math.pi * t)
    found = figures(altered(finished, t, 3e-4 * wave, 50.0 * wave, -7.0))
    assert found["rms_error"] == pytest.approx(3e-4 / math.sqrt(2), rel=1e-6)
    assert found["peak_error"] == pytest.approx(3e-4, rel=1e-6)
    assert found["motor_1.torque_rms"] == pytest.approx(50 / math.sqrt(2), rel=1e-6)
    assert found["motor_2.torque_rms"] == pytest.approx(7.0, rel=1e-12)


def test_the_largest_error_counts_on_either_side(finished: Run) -> None:
    found = figures(altered(finished, [0.0, 1.0, 2.0], [0.0, -5e-5, 2e-5]))
    assert found["peak_error"] == 5e-5


@pytest.mark.parametrize(
    ("end", "window"),
    [pytest.param(14.0, 2.0, id="long rest"), pytest.param(7.0, 1.0, id="half of a short rest")],
)
def test_standstill_is_the_end_of_the_rest(finished: Run, end: float, window: float) -> None:
    """Error 1 outside the window, and a swing of 2e-5 about 3e-5 inside it."""
    motion = move(0.02, v=0.03, a=0.01, j=0.05)  # shape alone; when it ends is what matters
    shift = 5.0 - motion.waveform.end()
    motion = move(0.02, v=0.03, a=0.01, j=0.05, start=shift)
    t = np.arange(0.0, end + 5e-4, 1e-3)
    e = np.where(t < end - window - 1e-6, 1.0, 3e-5 + 2e-5 * np.sin(40 * t))
    found = figures(altered(finished, t, e, motion=motion))
    assert found["standstill_amplitude"] == pytest.approx(4e-5, rel=1e-3)


def test_a_motion_without_rest_has_no_standstill(finished: Run) -> None:
    run = altered(finished, [0.0, 1.0], [0.0, 1e-5], motion=sine(1e-3, 1.0))
    assert math.isnan(figures(run)["standstill_amplitude"])


G, F, B, P = "gap", "front", "back", "front parting"


@pytest.mark.parametrize(
    ("path", "reversals", "contacts"),
    [
        pytest.param([G, F, G, F], 0, 3, id="bouncing on one flank"),
        pytest.param([G, F, G, B, G, F], 2, 5, id="through the gap"),
        pytest.param([F, B, F, B], 3, 0, id="gap 0"),
        pytest.param([F, P, G, B], 1, 2, id="parting carries nothing"),
        pytest.param([B, G], 0, 1, id="begun on the back flank"),
        pytest.param([G], 0, 0, id="never touched"),
    ],
)
def test_reversals_and_contacts(
    finished: Run, path: Sequence[str], reversals: int, contacts: int
) -> None:
    own = [Event(0.1 * k, "mesh_1", *pair) for k, pair in enumerate(pairwise(path))]
    other = Event(0.5, "friction of m", "stuck", "forward")
    found = figures(altered(finished, [0.0, 1.0], 0.0, events=(*own, other)))
    assert found["mesh_1.reversals"] == reversals
    assert found["mesh_2.reversals"] == 0
    assert found["contact_events"] == contacts
    assert found["events"] == len(own) + 1


def test_a_failed_run_has_no_figures(finished: Run) -> None:
    failed = altered(finished, [0.0, 1.0], 1e-5, status="chattering", message="why")
    assert all(math.isnan(value) for value in figures(failed).values())


def test_a_free_bounce_is_counted() -> None:
    """One drive and the table bounce in a gap with the period of oracle 1 in the physics notes.

    2π/ω_r + 4Δ/v_0 with ω_r² = K (1/J_n + i_m²/J_m): from mid-gap a flank is met after Δ/v_0 and
    then every half period.
    """
    machine = Machine.load("heavy-table-empty")
    for label in machine.effects:
        machine.remove(label)
    machine.core.set_controller(kind="none")
    for path in ("motors.C_e", "motors.b", "pinions.b", "table.b"):
        machine.set(path, 0.0)
    machine.set("mesh_2.stiffness", 1e-9)
    J_n, J_m, i_m, K, gap, v_0 = 1072.5, 3e6, 20.0, 2e7, 1.1e-3, 0.01
    period = 2 * math.pi / math.sqrt(K * (1 / J_n + i_m**2 / J_m)) + 4 * gap / v_0
    end = 4.0
    met = math.floor((end - gap / v_0) / (period / 2)) + 1
    run = simulate(machine, end=end, initial={"omega_c1": v_0})
    found = figures(run)
    assert met == 17
    assert found["mesh_1.reversals"] == met - 1
    assert "peak_error" not in found  # nothing is followed


@pytest.mark.parametrize(
    ("machine", "tension", "amplitude"),
    [
        pytest.param("heavy-table-550t", 0.0, 51.7, id="550 t hunts"),
        pytest.param("heavy-table-250t", 0.0, 35.0, id="250 t hunts"),
        pytest.param("heavy-table-550t", 60.0, 0.0, id="tension stops it"),
    ],
)
def test_hunting_has_the_amplitude_of_the_study(
    machine: str, tension: float, amplitude: float
) -> None:
    """Peak to peak in the last 2 s of 14 s; the study's friction was smooth, hence 1 %."""
    table = Machine.load(machine)
    table.set("controller.T_ten", tension)
    motion = move(0.02, v=0.03, a=0.01, j=0.05, start=2.0, end=14.0)
    run = simulate(table, motion, signals=["e", "T_1", "T_2"])
    found = figures(run)["standstill_amplitude"] / ARCSEC
    assert found == pytest.approx(amplitude, rel=0.01, abs=0.05)
