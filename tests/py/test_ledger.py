"""The exact engine's ledger of work: closed through hundreds of switches, the same at any times."""

from __future__ import annotations

import numpy as np
import pytest

import reference_model as reference
from core_machines import Array, core_inputs, core_machine
from dualdrive import Machine, _core, simulate
from dualdrive.motion import move


@pytest.fixture(scope="module")
def machine() -> Machine:
    return Machine.load("heavy-table-550t")


def largest(work: Array) -> float:
    return float(np.abs(work).max())


def test_energy_closes_to_rounding_through_543_contacts() -> None:
    machine, inputs = (
        core_machine(reference.speed_study("H")),
        core_inputs(reference.sine(0.02, 0.5)),
    )
    run = _core.simulate(machine, inputs, end=10.0, engine="exact")
    assert run.status == "success"
    assert len(run.events) == 543
    assert run.statistics["energy_error"] < 1e-12


def test_the_ledger_is_the_same_at_uneven_times(machine: Machine) -> None:
    """Parts of steps, before and after a switch within one, add up to whole ones."""
    motion = move(0.01, v=0.03, a=0.01, j=0.05, start=0.2, end=3.0)
    even = simulate(machine, motion, output_step=1e-2, engine="exact")
    inside = np.sort(np.random.default_rng(7).uniform(0.0, 3.0, 400))
    times = np.unique(np.concatenate([even.t, inside]))
    uneven = simulate(machine, motion, times=times, engine="exact")
    assert len(even.events) > 5
    common = np.isin(times, even.t)
    size = largest(np.asarray(even.work))
    np.testing.assert_allclose(
        np.asarray(uneven.work)[common], np.asarray(even.work), rtol=0, atol=1e-10 * size
    )
    assert uneven.statistics["energy_error"] < 1e-10


def test_the_ledger_is_that_of_another_engine(machine: Machine) -> None:
    """CVODES integrates the powers as they are, without any of the matrices."""
    motion = move(0.01, v=0.03, a=0.01, j=0.05, start=0.2, end=3.0)
    runs = [
        simulate(machine, motion, load=500.0, engine=engine, rtol=1e-12)
        for engine in ("exact", "cvode")
    ]
    exact, stepped = (np.asarray(run.work) for run in runs)
    assert (np.abs(stepped).max(axis=0) > 0).sum() >= 4, "too few paths to show anything"
    np.testing.assert_allclose(exact, stepped, rtol=0, atol=1e-6 * largest(stepped))
