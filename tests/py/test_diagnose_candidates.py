"""What is tried, and where: every effect at every part that could have it, causes apart."""

from __future__ import annotations

from typing import Any

from dualdrive import Machine
from dualdrive.diagnose.candidates import candidates, members, possible
from dualdrive.diagnose.hypotheses import Hypothesis

LATE = "transport_delay@controller"


def late(core: Any) -> list[Hypothesis]:
    return [h for h in candidates(core) if h.effects[0][0] == "transport_delay"]


def test_a_late_command_is_tried_for_all_drives_and_for_the_slaves_apart() -> None:
    """Numbers that are causes of their own: the other one is held where it is."""
    several = late(Machine.load("bench").core)
    held = [{f"{LATE}.delta_t": 0.0}, {f"{LATE}.delta_c": 0.0}]
    assert [dict(h.fixed) for h in several] == held
    for h, free in zip(several, ("delta_c", "delta_t"), strict=True):
        _, paths = h.put_in(Machine.load("bench").core)
        assert paths == [f"{LATE}.{free}"]
        assert h.looked_at == 2


def test_a_lag_that_the_machine_file_sets_is_a_setting_and_no_cause() -> None:
    core = Machine.load("bench").core.copy()
    core.set("controller.delta_t", 2e-3)
    assert [dict(h.fixed) for h in late(core)] == [{f"{LATE}.delta_t": 2e-3}]


def test_what_a_machine_has_already_is_not_tried_there_again() -> None:
    machine = Machine.load("bench")
    machine.add("coulomb", "table", torque=0.1)
    assert possible(machine.core, "coulomb", "table") is None
    assert possible(machine.core, "coulomb", "motors") is not None
    machine.add("coulomb", "motor_1", torque=0.01)
    assert possible(machine.core, "coulomb", "motors") is None, "a group that includes it"


def test_a_joint_that_gives_already_is_not_made_to_give_again() -> None:
    core = Machine.load("bench").core.copy()
    assert possible(core, "shaft_compliance", "gearboxes") is not None
    core.add_effect("shaft_compliance", "gearboxes")
    assert possible(core, "shaft_compliance", "gearboxes") is None
    assert possible(core, "gearbox_backlash", "gearboxes") is not None, "it may have play, too"


def test_there_is_no_part_like_that() -> None:
    assert possible(Machine.load("bench").core, "coulomb", "motor_7") is None


def test_single_parts_of_a_group() -> None:
    core = Machine.load("bench").core
    places = [h.effects[0][1] for h in members(core, Hypothesis((("cogging", "motors"),)))]
    assert places == ["motor_1", "motor_2"]
    assert members(core, Hypothesis((("unbalance", "table"),))) == []


def test_a_balance_tries_nothing_that_it_can_not_show() -> None:
    core = Machine.load("bench").core
    tried = {h.effects[0][0] for h in candidates(core, balance=True)}
    assert tried.isdisjoint({"gearbox_backlash", "current_limit", "thermal_drift"})
    assert "coulomb" in tried


def test_a_balance_takes_back_what_each_sensor_did() -> None:
    core = Machine.load("bench").core
    tried = {h.effects[0] for h in candidates(core, ["T_1"], balance=True)}
    for place in ("table", "motors", "motor_1", "motor_2", "T_1"):
        assert ("sensor_delay", place) in tried
    assert ("encoder_eccentricity", "motor_2") in tried
