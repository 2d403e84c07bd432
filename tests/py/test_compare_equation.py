"""Which equation fails: a known fault is put into a simulated machine and must be found there."""

from __future__ import annotations

import functools
from collections.abc import Callable

import pytest

from dualdrive import Machine
from dualdrive.compare import EquationAtFault, equation_at_fault
from recorded import demo, sheet
from simulated import drifted, nominal, record


@functools.cache
def found(name: str) -> EquationAtFault | None:
    machine = nominal()
    FAULTS[name](machine)
    return equation_at_fault(drifted(), record(machine))


FAULTS: dict[str, Callable[[Machine], object]] = {
    "none": lambda m: None,
    "motor_1": lambda m: m.add("coulomb", "motor_1", torque=4.0),
    "motor_2": lambda m: m.add("cogging", "motor_2", amplitude=4.0, order=8),
    "motors": lambda m: m.add("coulomb", "motors", torque=4.0),
    "mesh_1": lambda m: m.add("eccentricity", "pinion_1", amplitude=5e-4),
}


@pytest.mark.parametrize("name", [n for n in FAULTS if n != "none"])
def test_the_equation_with_the_fault_is_named(name: str) -> None:
    fault = found(name)
    assert fault is not None
    assert fault.name == name, fault
    assert fault.probability > 0.9
    assert 0.6 < fault.shares[name] <= 1.0


def test_drifted_numbers_alone_are_no_fault() -> None:
    assert found("none") is None


@pytest.mark.parametrize("name", ["fit", "held_out"])
def test_the_demo_lacks_something_at_the_table(name: str) -> None:
    """Its records come from the independent reference model with dry friction of 12 kN m there."""
    fault = equation_at_fault(sheet(), demo(name))
    assert fault is not None
    assert (fault.name, fault.probability > 0.95) == ("table", True)
    assert equation_at_fault(sheet(torque=12000.0), demo(name)) is None


def test_without_motor_angles_the_sum_alone_can_be_told() -> None:
    trace = demo("fit").without("theta_1", "theta_2")
    fault = equation_at_fault(sheet(), trace)
    assert fault == EquationAtFault("total", 1.0, {"total": 1.0})
