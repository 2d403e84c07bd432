"""Figure 3: the diagram is the machine's, and is another one when the machine is."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from dualdrive import Machine
from dualdrive.machine import presets
from dualdrive.paper import reproduce
from dualdrive.paper.structure import Diagram, structure


def diagram(**changes: float | str) -> Diagram:
    machine = Machine.load("heavy-table-100t")
    for path, value in changes.items():
        machine.set(path.replace("__", "."), value)
    return structure(machine)


def corrected(shown: Diagram) -> set[str]:
    """Which speed loops the equaliser acts on."""
    return {a.target for a in shown.arrows if a.source == "equaliser"}


def test_the_preset_s_diagram() -> None:
    shown = diagram()
    assert corrected(shown) == {"speed sum 1", "speed sum 2"}
    assert shown["speed 1"].text.startswith("speed PI 1\nk_p 2e5\nT_N 100 ms")
    assert shown["mesh 2"].text == "backlash\n± 1.1 mrad\nK_t 2e7"
    assert "feed-forward" in shown
    assert "slave lag 2" not in shown
    signs = {a.source: a.sign for a in shown.arrows if a.target == "equaliser"}
    assert signs == {"motor 1": "+", "motor 2": "−", "tension": "−"}  # e_T = T_1 - T_2 - T_ten


@pytest.mark.parametrize(("choice", "drives"), [("slave", {2}), ("master", {1}), ("both", {1, 2})])
def test_the_equaliser_acts_on_the_drives_it_is_set_to(choice: str, drives: set[int]) -> None:
    shown = diagram(controller__equaliser=choice)
    assert corrected(shown) == {f"speed sum {n}" for n in drives}


@pytest.mark.parametrize(
    ("changes", "block", "text"),
    [
        ({"controller__T_N": 0.0}, "speed 2", "speed P 2\nk_p 2e5\n± 200 N·m"),
        ({"controller__K_i": 3.0}, "position", "position PI\nK_v 5/s\nK_i 3/s²"),
        ({"controller__delta_t": 0.05}, "slave lag 2", "slave lag δt\n50 ms"),
        ({"controller__current": "voltage"}, "current 1", "no current loop 1"),
        ({"meshes__kind": "compliant"}, "mesh 1", "compliant mesh"),
        ({"controller__speed_sample": 1e-3}, "speed 1", "every 1 ms"),
        ({"motors__filter_pole": 90.0}, "filter 2", "set-point low-pass\n90 Hz"),
    ],
)
def test_a_change_of_the_model_changes_its_block(
    changes: Mapping[str, float | str], block: str, text: str
) -> None:
    assert text in diagram(**changes)[block].text
    assert block not in diagram() or text not in diagram()[block].text


def test_play_ahead_of_the_pinion_is_a_block_of_its_own() -> None:
    shown = structure(Machine.load("heavy-table-dual-servo"))
    assert shown["gearbox 1"].text == "i 150\nbacklash\n± 0.435 mrad\nK_t 4e7"
    assert "gearbox 1" not in diagram()


def test_what_is_switched_off_is_not_drawn() -> None:
    assert "tension" not in diagram(controller__tension="off")
    assert "feed-forward" not in diagram(controller__f_v=0.0)
    single = structure(Machine.load("heavy-table-single-motor"))
    assert "equaliser" not in single
    assert "motor 2" not in single


@pytest.mark.parametrize("name", presets())
def test_every_preset_has_a_diagram_whose_arrows_meet_blocks(name: str) -> None:
    shown = structure(Machine.load(name))
    names = [block.name for block in shown.blocks]
    assert len(set(names)) == len(names)
    for arrow in shown.arrows:
        assert arrow.source in names
        assert arrow.target in names
    dot = shown.dot()
    assert dot.count(" -> ") == len(shown.arrows)
    assert dot.startswith("digraph")


def test_a_machine_without_controller_has_its_inputs() -> None:
    machine = Machine.load("bench")
    machine.set("controller.kind", "none")
    shown = structure(machine)
    assert "position" not in shown
    assert shown["input 1"].text == "U_1"


def test_the_exhibit_says_what_each_change_does() -> None:
    rows = {str(what): str(change) for what, change in reproduce("fig3").tables[0].rows}
    assert rows["equaliser on the slave alone"] == "− equaliser → speed sum 1"
    assert all(text != "nothing" for text in rows.values())


def test_what_acts_back_and_what_limits_is_drawn() -> None:
    shown = diagram()
    ways = {(a.source, a.target): a.text for a in shown.arrows}
    assert ways["mesh 1", "pinion 1"] == "− T_c1"
    assert ways["mesh 2", "table"] == "i_m 20, torque i_m T_c2"
    assert ways["motor 1", "current 1"] == "EMF C_e ω_1"
    assert "± U_max 400 V" in shown["current 1"].text
    assert "K_t 2e7" in shown["mesh 1"].text


@pytest.mark.parametrize(
    ("sensor", "sources"),
    [("table", {"table"}), ("motor", {"motor 1"}), ("both", {"table", "motor 1"})],
)
def test_the_position_loop_is_closed_where_the_machine_closes_it(
    sensor: str, sources: set[str]
) -> None:
    shown = diagram(controller__position_sensor=sensor)
    assert {a.source for a in shown.arrows if a.target == "e" and a.sign == "−"} == sources
