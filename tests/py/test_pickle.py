"""Machines, signals, motions, plans and records travel in pickles, to the last bit."""

from __future__ import annotations

import copy
import pickle
import threading
from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np
import pytest

from dualdrive import Machine, _core
from dualdrive.machine import presets
from dualdrive.motion import Motion, cycle, move, multisine, sampled, sine
from dualdrive.replay import named, play_all, records
from dualdrive.simulation import simulate
from dualdrive.sweeps import Outcome, Threads, lay_out
from dualdrive.sweeps.plan import Plan
from recorded import demo, sheet

T = TypeVar("T")

TIMES = np.linspace(-1.0, 9.0, 2003)
RAGGED = np.cumsum([0.1, 0.3, 0.05, 0.7, 0.2])


def travelled(value: T) -> T:
    found: T = pickle.loads(pickle.dumps(value))
    return found


def description(core: _core.Machine) -> dict[str, Any]:
    """All that can be asked of a machine."""
    names = [*core.connections, *core.motors]
    runs = core.bodies and core.controller_options["speed_samples"] == 0
    return {
        "name": core.name,
        "bodies": core.bodies,
        "kinds": [(name, core.kind(name)) for name in names],
        "controller": core.controller_options,
        "effects": core.effects,
        "parameters": [
            (p.path, p.unit, p.low, p.high, p.low_excluded, p.standard, p.typical, p.value, p.doc)
            for p in core.parameters()
        ],
        "states": core.states() if runs else [],
        "signals": core.signals() if runs else [],
    }


@pytest.mark.parametrize("name", presets())
def test_every_preset_arrives_as_it_left(name: str) -> None:
    machine = Machine.load(name)
    machine.note("as it is")
    again = travelled(machine)
    assert description(again.core) == description(machine.core)
    assert again.toml() == machine.toml()
    assert (again.title, again.axis, again.history) == (
        machine.title,
        machine.axis,
        machine.history,
    )
    again.core.set("table.J", 17.0)  # independent of what was packed
    assert machine.core.get("table.J") != 17.0


def odd_machine() -> _core.Machine:
    """Parts in no usual order, effects taken out again, numbers off their defaults."""
    m = _core.Machine()
    m.name = "odd"
    m.add_body("table", locked=True)
    m.set_controller("master_slave", "slave", "falling", "voltage", 3)
    m.add_body("motor_1")
    m.connect("mesh_1", "motor_1", "table", "compliant", "driver")
    m.add_effect("coulomb", "table")
    m.add_motor("motor_1")
    m.add_effect("coulomb", "table")
    m.add_expression("table", "a*theta_m + b", [("a", "N*m/rad", 2.0), ("b", "N*m", 0.0)])
    m.add_expression("table", "theta_m*1", [])
    m.add_body("motor_2")
    m.add_motor("motor_2", kind="direct")
    m.add_effect("coulomb", "table")
    m.remove_effect("coulomb@table")
    m.remove_effect("coulomb@table#2")
    m.add_effect("coulomb", "table")
    for path, value in (("motor_1.J", 0.1), ("expression@table.b", 7.0), ("controller.K_v", 0.3)):
        m.set(path, value)
    return m


def test_labels_that_count_past_removed_effects_are_kept() -> None:
    machine = odd_machine()
    labels = [effect["label"] for effect in machine.effects]
    assert "coulomb@table#3" in labels
    assert "coulomb@table#2" not in labels
    again = travelled(machine)
    assert description(again) == description(machine)
    assert again.add_effect("coulomb", "table") == machine.add_effect("coulomb", "table")


def test_a_controller_that_was_taken_out_or_never_was() -> None:
    machine = odd_machine()
    machine.set_controller("none", speed_samples=0)
    assert description(travelled(machine)) == description(machine)
    assert description(travelled(_core.Machine())) == description(_core.Machine())


def test_deepcopy_and_copy_agree() -> None:
    machine = odd_machine()
    assert description(copy.deepcopy(machine)) == description(machine)


def signals() -> Iterator[_core.Waveform]:
    yield _core.constant(2.0)
    yield _core.step(1.0, 0.3)
    yield _core.ramp(0.1, 0.2, 4.0) + _core.ramp(0.3)
    yield _core.shift(_core.Waveform([], [[1.0, 2.0, 3.0]]), 0.37)
    yield _core.sine(1.0, 0.7, 0.1, 0.5, 0.2) * 0.3
    yield _core.odd_multisine(1.0, 0.3, 5, seed=3, from_zero=True)
    yield _core.shift(_core.multisine([1.0, 0.2], [0.5, 3.0], [0.0, 1.0], -0.5), 0.7)
    yield _core.sampled(RAGGED, RAGGED**2, _core.Interpolation.hold)
    yield _core.shift(_core.sampled(TIMES, np.sin(TIMES)), 0.1)
    yield _core.sum([_core.jerk_limited_move(1.0, 0.5, 0.2, 0.3), _core.constant(-1.0)])
    yield _core.sum([])


def test_signals_arrive_with_the_same_bits() -> None:
    for signal in signals():
        same_bits(signal, travelled(signal))


def same_bits(signal: _core.Waveform, again: _core.Waveform) -> None:
    for what in ("value", "rate", "acceleration"):
        before, after = (getattr(w, what)(TIMES) for w in (signal, again))
        assert before.tobytes() == after.tobytes(), what
    assert signal.breaks().tobytes() == again.breaks().tobytes()
    assert signal.knots().tobytes() == again.knots().tobytes()
    assert signal.end() == again.end()


def test_motions() -> None:
    for motion in (
        move(0.02, v=0.03, a=0.01, j=0.05),
        cycle([0.1, 0.0], v=0.03, a=0.01),
        sine(1e-3, f=2.0),
        multisine(1e-4, f=0.5, seed=2),
        sampled(RAGGED, RAGGED),
        Motion(_core.ramp(0.1), 3.0, "my own", "mine", {}),
    ):
        again = travelled(motion)
        assert again == motion
        assert (again.end, again.text) == (motion.end, motion.text)
        same_bits(motion.waveform, again.waveform)


def test_a_run_of_what_arrived_is_the_same_run() -> None:
    machine, motion = Machine.load("heavy-table-100t"), move(0.01, v=0.03, a=0.01, end=3.0)
    here, there = (simulate(m, w) for m, w in ((machine, motion), travelled((machine, motion))))
    assert here.values.tobytes() == there.values.tobytes()
    assert here.events == there.events
    assert travelled(here).values.tobytes() == here.values.tobytes()


def computed(plan: Plan) -> list[Outcome]:
    batches = Threads(1).outcomes(plan, range(3), threading.Event())
    return sorted((outcome for batch in batches for outcome in batch), key=lambda one: one.run)


def test_a_plan_computes_the_same_runs() -> None:
    machine = Machine.load("heavy-table-100t")
    motion = move(0.01, v=0.03, a=0.01, j=0.05, start=1.0, end=4.0)
    grid = lay_out(machine, {"delta": "0:1e-3:3"})
    plan = Plan(machine, motion, grid, 0.0, 4.0, 1e-3, 1e-9, "auto", keep=("e",))
    for here, there in zip(computed(plan), computed(travelled(plan)), strict=True):
        assert here.status == there.status == "success"
        assert {**here.figures, "speed": 0} == {**there.figures, "speed": 0}
        assert here.signals is not None
        assert there.signals is not None
        assert here.signals["e"].tobytes() == there.signals["e"].tobytes()


def test_a_record_plays_the_same() -> None:
    machine = sheet()
    (record,) = records(machine, named(demo("fit")))
    (here,) = play_all(machine.core, [record], ["table.J"])
    (there,) = play_all(*travelled((machine.core, [record], ["table.J"])))
    for name in record.names:
        assert here.simulated[name].tobytes() == there.simulated[name].tobytes()
        assert here.slopes[name].tobytes() == there.slopes[name].tobytes()
    assert travelled(here).residual("e").tobytes() == here.residual("e").tobytes()
