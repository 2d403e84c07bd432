"""Machine files: what they say, what they refuse, and that they come back to the same bits."""

from __future__ import annotations

import copy
import math
import pickle
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dualdrive import FileError, Machine, MachineError
from dualdrive.machine import presets

ARCSEC = math.pi / 648000

#: a whole small machine: motors, gearboxes, pinions, meshes, table
SMALL = """
schema = 1
drive_train = "dual_servo"

[motors]
J = 1e-4
K_d = 0.3
C_e = 0.3
R = 2
L = 5e-3
T_rated = 1.5
T_max = "200%"

[gearboxes]
ratio = 10

[pinions]
J = 2e-4

[meshes]
ratio = 4
stiffness = 200
gap = 1e-3

[table]
J = 0.2
"""

CONTROLLER = """
[controller]
k_p = 0.5
"""


def values(machine: Machine) -> dict[str, float]:
    return {p.path: p.value for p in machine.parameters()}


def machine(text: str = "", *, base: str = SMALL) -> Machine:
    return Machine.from_toml(base + text, "rig.toml")


# --- what a file says -----------------------------------------------------------------------------


def test_numbers_are_si_or_carry_their_unit() -> None:
    text = SMALL.replace("gap = 1e-3", 'gap = "20 arcsec"').replace("J = 0.2", 'J = "0.2 kg*m^2"')
    m = machine(base=text)
    assert m.get("mesh_1.gap") == pytest.approx(20 * ARCSEC, rel=1e-14)
    assert m.get("table.J") == 0.2


def test_a_percentage_refers_to_the_rated_torque() -> None:
    m = machine('[controller]\nk_p = 0.5\nT_ten = "40 %"\n')
    assert m.get("motor_2.T_max") == pytest.approx(3.0)
    assert m.get("controller.T_ten") == pytest.approx(0.6)


def test_members_override_their_group_wherever_they_stand() -> None:
    text = SMALL.replace("[meshes]", "[mesh_2]\ngap = 3e-3\n\n[meshes]")
    m = machine(base=text)
    assert (m.get("mesh_1.gap"), m.get("mesh_2.gap")) == (1e-3, 3e-3)


@pytest.mark.parametrize(
    ("gap", "half_at_pinion"),
    [
        ('{ value = "8 arcsec", frame = "table", measure = "full" }', 4 * 4 * ARCSEC),
        ('{ value = "8 arcsec", frame = "table" }', 8 * 4 * ARCSEC),
        ('{ value = 0.02, frame = "motor" }', 0.02 / 10),
        ('{ value = "2 mrad", measure = "full" }', 1e-3),
        ('{ value = 0.06, frame = "ring_mm", measure = "full", pitch_radius = 0.05 }', 6e-4),
        ('{ value = "60 um", frame = "ring_mm", pitch_radius = "50 mm" }', 1.2e-3),
        ('{ value = "0.06", frame = "ring_mm", pitch_radius = "50 mm" }', 1.2e-3),
    ],
)
def test_play_in_any_frame_becomes_half_the_play_at_the_pinion(
    gap: str, half_at_pinion: float
) -> None:
    m = machine(base=SMALL.replace("gap = 1e-3", f"gap = {gap}"))
    assert m.get("meshes.gap") == pytest.approx(half_at_pinion, rel=1e-12)


def test_a_linear_axis_counts_its_table_side_in_metres_and_newtons() -> None:
    m = Machine.from_toml(
        'axis = "linear"\n'
        + SMALL.replace("J = 0.2", 'J = "250 kg"\nb = "3 kN*s/m"').replace(
            "gap = 1e-3", 'gap = { value = "10 um", frame = "table" }'
        )
    )
    units = {p.path: p.unit for p in m.parameters()}
    assert (units["table.J"], units["table.b"], units["mesh_1.ratio"]) == ("kg", "N*s/m", "rad/m")
    assert (units["motor_1.J"], units["mesh_1.stiffness"]) == ("kg*m^2", "N*m/rad")
    assert (m.get("table.J"), m.get("table.b")) == (250.0, 3000.0)
    assert m.get("mesh_1.gap") == pytest.approx(10e-6 * 4)
    m.add("coulomb@table", torque="20 N")
    assert m.parameter("coulomb@table.torque").unit == "N"
    with pytest.raises(MachineError, match=r"does not measure kg"):
        m.set("table.J", "3 kg*m^2")


def test_effects_and_formulas_come_with_the_file() -> None:
    m = machine(
        '[[effects]]\neffect = "coulomb"\nplace = "pinions"\ntorque = "0.2 N*m"\n'
        '[[effects]]\neffect = "expression"\nplace = "table"\nformula = "-c*omega_m"\n'
        'parameters = { c = "3 N*m*s/rad" }\n'
    )
    assert m.effects == ["coulomb@pinions", "expression@table"]
    assert m.get("coulomb@pinions.torque") == 0.2
    assert m.get("expression@table.c") == 3.0
    assert m.parameter("expression@table.c").unit == "N*m*s/rad"


def test_a_file_rests_on_another(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(SMALL + "[mesh_2]\ngap = 5e-3\n")
    child = tmp_path / "child.toml"
    child.write_text('schema = 1\nbase = "base.toml"\nname = "child"\n[meshes]\ngap = 2e-3\n')
    m = Machine.load(child)
    assert (m.name, m.get("meshes.gap")) == ("child", 2e-3)  # the later layer, both members
    assert values(Machine.from_toml(m.toml())) == values(m)
    assert "base" not in tomllib.loads(m.toml())


def test_an_effect_of_the_base_is_changed_not_doubled() -> None:
    m = Machine.from_toml(
        'schema = 1\nbase = "heavy-table-empty"\n'
        '[[effects]]\neffect = "coulomb"\nplace = "table"\ntorque = "5 kN*m"\n'
    )
    assert m.effects.count("coulomb@table") == 1
    assert m.get("coulomb@table.torque") == 5000.0
    assert values(Machine.from_toml(m.toml())) == values(m)


# --- there and back -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", presets())
def test_a_preset_comes_back_to_the_same_bits(name: str) -> None:
    m = Machine.load(name)
    again = Machine.from_toml(m.toml())
    assert values(again) == values(m)
    assert (again.name, again.title, again.axis) == (m.name, m.title, m.axis)
    assert again.core.effects == m.core.effects
    assert again.core.controller_options == m.core.controller_options
    assert again.toml() == m.toml()


@settings(max_examples=30, deadline=None)
@given(
    inertia=st.floats(1e-300, 1e300),
    gaps=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    friction=st.floats(0, 1e12),
)
def test_any_value_comes_back_to_the_same_bits(
    inertia: float, gaps: tuple[float, float], friction: float
) -> None:
    m = machine('[[effects]]\neffect = "coulomb"\nplace = "table"\n')
    m.set("table.J", inertia)
    m.set("mesh_1.gap", gaps[0])
    m.core.set("mesh_2.gap", gaps[1])  # behind the wrapper's back
    m.set("coulomb@table.torque", friction)
    assert values(Machine.from_toml(m.toml())) == values(m)
    assert values(pickle.loads(pickle.dumps(m))) == values(m)


def test_text_with_units_survives_a_ratio_that_changes_under_it() -> None:
    """The play was given at the table; it is the same piece of metal with another ratio."""
    m = machine(base=SMALL.replace("gap = 1e-3", 'gap = { value = 1e-3, frame = "table" }'))
    m.set("meshes.ratio", 8)
    assert m.get("meshes.gap") == 4e-3
    assert values(Machine.from_toml(m.toml())) == values(m)


def test_comments_stay_except_where_the_number_changed() -> None:
    m = Machine.load("heavy-table-empty")
    m.set("table.J", 4e6)
    lines = m.toml().splitlines()
    assert "ratio = 150" in lines
    assert next(line for line in lines if line.startswith("J = 0.045")).endswith("coupling")
    assert "J = 4000000.0" in lines  # "faceplate and ring alone" no longer holds


def test_history_is_kept_and_grows(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(SMALL + '[[history]]\ndate = 2026-03-01\nchange = "measured the play"\n')
    m = Machine.load(path)
    m.add("coulomb", "table", torque=1.0)
    m.note("added friction", "dualdrive add ...")
    m.save(tmp_path / "two.toml")
    history = Machine.load(tmp_path / "two.toml").history
    assert history[0] == {"date": "2026-03-01", "change": "measured the play"}
    assert history[1]["change"] == "added friction"
    assert history[1]["command"] == "dualdrive add ..."


def test_added_and_removed_effects_come_back() -> None:
    m = Machine.load("heavy-table-100t")
    assert m.add("cogging", "motors", amplitude="2 N*m", order=36) == "cogging@motors"
    assert m.add("expression@table", formula="-c*omega_m", parameters={"c": 7}) == (
        "expression@table"
    )
    m.remove("coulomb@table")
    m.set("expression@table.c", 8)
    again = Machine.from_toml(m.toml())
    assert again.effects == m.effects
    assert values(again) == values(m)
    m.remove("coulomb@pinions")
    for label in list(m.effects):
        m.remove(label)
    assert Machine.from_toml(m.toml()).effects == []


def test_a_copy_is_independent() -> None:
    m = machine()
    other, third = m.copy(), copy.deepcopy(m)
    other.set("table.J", 9.0)
    other.add("coulomb", "table")
    third.set("table.J", 8.0)
    assert (m.get("table.J"), m.effects) == (0.2, [])


def test_choices_can_be_set_and_are_kept() -> None:
    m = machine(CONTROLLER)
    m.set("meshes.gap", 3e-3)
    m.set("controller.equaliser", "slave")
    assert m.core.controller_options["equaliser"] == "slave"
    assert m.get("meshes.gap") == 3e-3
    m.set("mesh_2.kind", "compliant")
    assert (m.core.kind("mesh_1"), m.core.kind("mesh_2")) == ("gap", "compliant")
    m.set("meshes.kind", "gap")
    assert m.core.kind("mesh_2") == "gap"
    m.set("drives", 3)
    assert "mesh_3" in m.core.connections
    with pytest.raises(MachineError, match="choose one of both, slave, master"):
        m.set("controller.equaliser", "everyone")
    assert m.core.controller_options["equaliser"] == "slave"


@pytest.mark.parametrize("word", [True, "true"])
def test_a_body_can_be_locked_and_its_comment_goes(word: Any) -> None:
    text = Machine.load("bench").toml().replace("[table]", "[table]\nlocked = false # free to turn")
    m = Machine.from_toml(text)
    m.set("table.locked", word)
    [line] = [line for line in m.toml().splitlines() if line.startswith("locked")]
    assert line == "locked = true"


# --- what a file is refused for -------------------------------------------------------------------

CASES = tomllib.loads((Path(__file__).parent / "bad_machines.toml").read_text())["case"]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_a_bad_file_is_refused_in_one_line(tmp_path: Path, case: dict[str, str]) -> None:
    assert case["old"] in SMALL
    path = tmp_path / "rig.toml"
    path.write_text(SMALL.replace(case["old"], case["new"], 1))
    with pytest.raises(MachineError) as refused:
        Machine.load(path)
    message = str(refused.value)
    assert message.startswith(f"{path}: ")
    assert case["told"] in message
    assert "\n" not in message


def test_a_machine_that_rests_on_itself_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('schema = 1\nbase = "b.toml"\n')
    (tmp_path / "b.toml").write_text('schema = 1\nbase = "a.toml"\n')
    with pytest.raises(MachineError, match="rests on itself"):
        Machine.load(tmp_path / "a.toml")


def test_a_file_that_is_not_there_names_near_presets(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="did you mean heavy-table-100t"):
        Machine.load("heavy-table-101t")
    with pytest.raises(FileError, match="no such file"):
        Machine.load(tmp_path / "none.toml")
    with pytest.raises(FileError, match="cannot be read: Is a directory"):
        Machine.load(tmp_path)
    (tmp_path / "scope.bin").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(FileError, match="not a text file"):
        Machine.load(tmp_path / "scope.bin")


def test_a_bad_value_changes_nothing() -> None:
    m = machine()
    before = values(m)
    wrong: list[tuple[str, float | str]] = [("table.J", -1), ("meshes.gap", "1 kg"), ("no.J", 1)]
    for path, value in wrong:
        with pytest.raises(MachineError):
            m.set(path, value)
    with pytest.raises(MachineError):
        m.add("coulomb", "table", torque=-5)
    assert values(m) == before
    assert m.effects == []


def test_a_file_is_replaced_only_when_asked(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    m = machine()
    m.save(path)
    first = path.read_text()
    m.set("table.J", 7.0)
    with pytest.raises(FileError, match="exists already"):
        m.save(path)
    assert path.read_text() == first
    m.save(path, overwrite=True)
    assert Machine.load(path).get("table.J") == 7.0
    assert [p.name for p in tmp_path.iterdir()] == ["rig.toml"]
