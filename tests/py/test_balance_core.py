"""The core's own laws in the torque balance: against the plain axis, and on a real rig."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from balance_stand_in import RigidAxis
from dualdrive import _core
from dualdrive.identify import Processing, Standstill, torque_balance
from measured import emps, rig


def axis(**effects: str) -> Any:
    machine = _core.Machine()
    machine.add_body("table")
    machine.add_motor("motor_1", "table", "direct")
    machine.set("table.J", 90.0)
    machine.set("table.b", 180.0)
    for effect, place in effects.items():
        machine.add_effect(effect, place)
    return machine


@pytest.mark.parametrize("treatment", ["mask", "bound", "keep"])
def test_the_core_agrees_with_the_plain_axis(treatment: str) -> None:
    free = ["table.J", "table.b", "coulomb@table.torque"]
    plain = RigidAxis(dict(zip(free, [90.0, 180.0, 0.0], strict=True)))
    machine = axis(coulomb="table")
    machine.set("coulomb@table.torque", 0.0)
    rest = Standstill(treatment)  # type: ignore[arg-type]
    one, other = (torque_balance(m, emps(), free=free, standstill=rest) for m in (machine, plain))
    for path in free:
        first, second = one.parameters[path], other.parameters[path]
        assert first.value == pytest.approx(second.value, rel=1e-6)
        assert first.low == pytest.approx(second.low, rel=1e-4)
    assert one.force_error == pytest.approx(other.force_error, rel=1e-6)
    assert one.samples["total"] == other.samples["m"]


def test_emps_from_18_percent_to_the_published_figures() -> None:
    """Without Coulomb friction, then with it; M. Gautier's and A. Janot's values within 0.5 %."""
    bare = torque_balance(axis(), emps(), free=["table.J", "table.b"], offsets=False)
    assert 0.16 < bare.force_error < 0.20
    fit = torque_balance(
        axis(coulomb="table"), emps(), free=["table.J", "table.b", "coulomb@table.torque"]
    )
    assert fit.force_error <= 0.042
    published = {"table.J": 95.109, "table.b": 203.50, "coulomb@table.torque": 20.39}
    for path, value in published.items():
        assert fit.parameters[path].value == pytest.approx(value, rel=5e-3)


def dual_rig() -> Any:
    """Two drives and a brake on one ring, ratio 1; a formula holds the brake, its scale unknown."""
    machine = _core.Machine()
    for body in ("pinion_1", "pinion_2", "table"):
        machine.add_body(body)
        machine.set(f"{body}.J", 0.01)
    for n in (1, 2):
        machine.connect(f"mesh_{n}", f"pinion_{n}", "table", kind="gap")
        machine.add_motor(f"motor_{n}", f"pinion_{n}", "direct")
    machine.set("meshes.gap", 0.5)
    machine.add_effect("coulomb", "table")
    machine.set("coulomb@table.torque", 1.0)
    machine.add_expression("table", "gain * brake_torque * sign(omega_m)", [("gain", "", 1.0)])
    return machine


FREE = [
    "table.J",
    "pinion_1.J",
    "pinion_2.J",
    "table.b",
    "coulomb@table.torque",
    "expression@table.gain",
]


def test_rig_by_test_and_tension_says_that_the_ring_inertia_is_unknown() -> None:
    """The rig's other, longer log: test_real_data_cli.py."""
    traces = rig("log12")
    fit = torque_balance(
        dual_rig(),
        traces,
        free=FREE,
        processing=Processing(cutoff=5.0, decimate=5),
        standstill=Standstill(share=0.02),
    )
    assert fit.error < 0.25 < fit.nominal_errors["total"].relative
    ring = fit.parameters["table.J"]
    assert ring.verdict == "not identified"
    assert 0.0 <= ring.low < 1e-4 < 1e-3 < ring.high
    assert ring.reason in fit.table()
    assert len(fit.offsets) == len(traces)


def test_the_mesh_leaves_no_trace_in_the_total() -> None:
    """Stiffness and gap act between the drives and the ring only."""
    machine = dual_rig()
    trace = next(iter(rig("log12").values()))
    processing = Processing(cutoff=5.0, decimate=5)
    first = torque_balance(machine, trace, free=["table.b"], processing=processing)
    machine.set("meshes.stiffness", 3e3)
    machine.set("meshes.gap", 0.1)
    second = torque_balance(machine, trace, free=["table.b"], processing=processing)
    (one,), (other,) = (f.residuals.values() for f in (first, second))
    np.testing.assert_allclose(one.residual, other.residual, atol=1e-6 * np.ptp(one.measured))
