"""Records and machines at the edge of what a grey box takes: a table at rest, a law of nought."""

from __future__ import annotations

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine, _core
from dualdrive.diagnose import diagnose
from dualdrive.diagnose.simulated_errors import of_the_data_sheet, simulated_error
from dualdrive.innovations import Variant, first_noise, least_noise, maximum_likelihood
from dualdrive.traces import Trace
from test_innovations import REVERSALS, STEP, bench


def test_a_table_that_is_held_has_no_speed_to_creep_by() -> None:
    """Nought over nought ended a diagnosis: creep is counted by the speed that is commanded."""
    machine = Machine.load("bench")
    machine.add("coulomb", "table", torque=0.3)
    own = grey_box(machine, machine.core, 600, 1, motion=_core.constant(0.0))
    nothing = Variant(own.core)
    assert own.resting(nothing) == {}
    noise, floor = (f(own.core, own.records, 0.01) for f in (first_noise, least_noise))
    found = maximum_likelihood(own, nothing, own.start(nothing), noise, floor=floor, steps=2)
    assert found is not None
    assert np.isfinite(found[0].minus_two_log)


@pytest.mark.long
def test_a_record_that_no_error_is_told_of_names_nothing() -> None:
    """Of the table's speed alone a wrong law had been named with probability 1."""
    t = STEP * np.arange(2000, dtype=np.float64)
    run = _core.simulate(
        bench({"coulomb@table": {"torque": 0.3}}), {"theta_ref": REVERSALS},
        end=t[-1], times=list(t), signals=["omega_m"],
    )  # fmt: skip
    speed = run.values[:, 0] + 1e-4 * np.random.default_rng(1).standard_normal(len(t))
    trace = Trace(t, {"theta_ref": REVERSALS.value(t), "omega_m": speed}, name="speed")
    found = diagnose(Machine.load("bench"), trace, effort="quick", experiment=False)
    assert found.verdict == "unknown"
    assert found.paragraph.startswith("Whether anything is missing these records can't show.")
    assert "record the table's angle" in found.paragraph


@pytest.mark.parametrize(
    "law", [("coulomb", "table"), ("viscous", "table"), ("cogging", "motor_1")]
)
def test_a_law_of_nought_is_nought_in_the_data_sheets_machine(law: tuple[str, str]) -> None:
    """A fit begins with it at its usual size: of 300 N*m the sheet's error was 121, not 0.1."""
    machine = Machine.load("bench")
    machine.add(*law)
    own = grey_box(machine, bench(), 1500, 2)
    given = simulated_error(own.core, [r.record for r in own.records])
    assert of_the_data_sheet(own).error() == pytest.approx(given, rel=0.02)
