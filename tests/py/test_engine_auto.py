"""`engine = auto` where a law is not affine: two engines in turn, the same each time.

What it costs beside either engine alone: benchmarks/laws.py and benchmarks/effects.py.
"""

from __future__ import annotations

import numpy as np
import pytest

from core_machines import core_inputs, core_machine, set_all
from core_random import RandomMachine
from dualdrive import _core
from reference_model import bench, heavy_table, sine

LAWS = {
    "stribeck": ("table", {"torque": 0.1, "static_ratio": 1.3, "speed": 0.02}),
    "hertzian_stiffness": ("mesh_1", {"growth": 0.3, "overlap": 4e-3}),
    "torque_ripple": ("motor_1", {"amplitude": 0.02, "order": 6.0}),
}
AFFINE = {kind.name: kind.affine for kind in _core.effect_types()}
Switch = tuple[str, str, str]


def bench_with(law: str) -> _core.Machine:
    machine = core_machine(bench().control(omega_ci=2500.0))
    place, values = LAWS[law]
    set_all(machine, machine.add_effect(law, place), values)
    return machine


def seen(law: str, engine: str, rtol: float, **options: str) -> _core.Trajectory:
    raw = _core.simulate(bench_with(law), core_inputs(sine(0.3, 0.5)), end=3.0, rtol=rtol,
                         engine=engine, **options)  # type: ignore[arg-type]  # fmt: skip
    assert raw.status == "success"
    return raw


def off(raw: _core.Trajectory, truth: _core.Trajectory) -> float:
    """The worst angle's or speed's largest difference, over its own peak."""
    moving = [k for k, name in enumerate(truth.names) if name.startswith(("theta_m", "omega_"))]
    true = np.asarray(truth.values)[:, moving]
    worst = np.abs(np.asarray(raw.values)[:, moving] - true).max(axis=0)
    return float((worst / np.abs(true).max(axis=0)).max())


@pytest.mark.parametrize("law", LAWS)
def test_the_cheaper_engine_has_the_run_and_keeps_near_the_tolerance(law: str) -> None:
    """Where stability alone shortens its steps the explicit engine is better than was asked for."""
    truth = seen(law, "explicit", 1e-12)
    for rtol in (1e-6, 1e-9):
        auto, explicit = seen(law, "auto", rtol), seen(law, "explicit", rtol)
        bdf = seen(law, "cvode", rtol, method="bdf")
        assert auto.statistics["method"].startswith("exponential")
        assert auto.statistics["rhs"] < explicit.statistics["rhs"] / 3
        assert off(auto, truth) < off(bdf, truth)
        assert off(auto, truth) < 30 * rtol
        assert [e[1:] for e in auto.events] == [e[1:] for e in truth.events]


def test_an_engine_that_could_not_be_the_cheaper_is_not_tried() -> None:
    """A replay has a knot each millisecond: two steps of BDF, less than one of the explicit engine;
    and ticks each half millisecond leave the exponential one half a step."""
    t = np.linspace(0.0, 3.0, 3001)
    replay = {"theta_ref": _core.sampled(t, 0.02 * np.sin(np.pi * t), _core.Interpolation.cubic)}
    table = core_machine(heavy_table(100, dry_friction=False).control(T_ten=10.0))
    set_all(table, table.add_effect("unbalance", "table"), {"amplitude": 1e3})
    raw = _core.simulate(table, replay, end=3.0, rtol=1e-6, signals=["theta_m"], energy=False)
    assert "bdf" not in raw.statistics["method"]
    table.set("controller.speed_sample", 5e-4)
    raw = _core.simulate(table, replay, end=3.0, rtol=1e-6, signals=["theta_m"], energy=False)
    assert "exponential" not in raw.statistics["method"]


@pytest.mark.parametrize("law", LAWS)
def test_the_same_run_gives_the_same_bits(law: str) -> None:
    first, second = (seen(law, "auto", 1e-8) for _ in range(2))
    assert np.asarray(first.values).tobytes() == np.asarray(second.values).tobytes()
    assert first.events == second.events
    assert first.statistics == second.statistics


def switches(m: RandomMachine, engine: str, rtol: float) -> list[Switch] | None:
    """Who switched from what to what, sorted; None where the run ended early."""
    raw = _core.simulate(m.machine, m.inputs, end=1.0, initial=m.initial, rtol=rtol,
                         engine=engine, signals=["theta_m"], energy=False)  # fmt: skip
    if raw.status != "success":
        return None
    return sorted(event[1:] for event in raw.events)


@pytest.mark.long
def test_no_switch_is_missed_or_invented() -> None:
    """Wherever the explicit engine finds the same at two tolerances, so that there is an answer."""
    machines = count = 0
    for seed in range(100, 145):
        m = RandomMachine(seed)
        if all(AFFINE.get(e["effect"], False) for e in m.machine.effects):
            continue
        truth = switches(m, "explicit", 1e-11)
        if truth is None or truth != switches(m, "explicit", 1e-8):
            continue
        for engine in ("auto", "exponential"):
            assert switches(m, engine, 1e-9) == truth, "; ".join(m.notes)
        machines += 1
        count += len(truth)
    assert machines > 12
    assert count > 500
