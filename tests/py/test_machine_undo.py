"""Steps of a machine file are taken back exactly; where that can't be, one sentence says why."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dualdrive import Machine, MachineError
from dualdrive_cli.main import main


def numbers(machine: Machine) -> dict[str, str]:
    """Every number to the last bit, and what holds them."""
    found = {p.path: p.value.hex() for p in machine.core.parameters()}
    kinds = {c: machine.core.kind(c) for c in machine.core.connections}
    options = {str(k): str(v) for k, v in machine.core.controller_options.items()}
    return found | kinds | options | {"effects": repr(machine.core.effects), "name": machine.name}


def reread(machine: Machine) -> Machine:
    return Machine.from_toml(machine.toml())


def step(machine: Machine, kind: str) -> None:
    """One change of each sort that a command makes."""
    if kind == "number":
        machine.set("table.J", 1.0 / 3.0 * 1e7)
        machine.set("meshes.gap", "22.7 arcsec")
    elif kind == "effect":
        machine.add("stribeck", "table", torque="2 kN*m")
        machine.set("table.b", 1.1e5)
    elif kind == "twice":
        machine.add("cogging", "motors", amplitude=0.1, order=8)
        machine.add("cogging", "motors", amplitude=0.2, order=6)
    elif kind == "formula":
        formula = {"c": {"value": 3.1, "unit": "N*m*s/rad"}}
        machine.add("expression", "table", formula="c * omega_m", parameters=formula)
    elif kind == "removed":
        machine.remove(machine.effects[0])
    elif kind == "choice":
        machine.set("meshes.kind", "compliant")
    elif kind == "name":
        machine.name, machine.title = "other", "another machine"
    else:
        machine.set("motors.J", machine.get("motors.J") * 1.07)
        machine.set("coulomb@table.torque", 1234.5678901234567)


KINDS = ["number", "effect", "twice", "formula", "removed", "choice", "name", "fit"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_step_is_taken_back_to_the_last_bit(kind: str) -> None:
    machine = Machine.load()
    before = numbers(machine)
    step(machine, kind)
    machine.note(f"step {kind}", "dualdrive ...")
    assert numbers(machine) != before
    again = reread(machine)
    assert again.undo() == f"step {kind}"
    assert numbers(again) == before
    assert again.history == machine.history[:-1]
    assert numbers(reread(again)) == before


def test_a_row_of_steps_is_taken_back_one_by_one() -> None:
    machine = reread(Machine.load())
    states = []
    for kind in ("number", "effect", "fit", "twice", "choice", "formula", "name"):
        states.append(numbers(machine))
        step(machine, kind)
        machine.note(kind)
        machine = reread(machine)
    for before in reversed(states):
        machine.undo()
        machine = reread(machine)
        assert numbers(machine) == before
    assert machine.history == ()
    with pytest.raises(MachineError, match="nothing to undo"):
        machine.undo()


def test_a_copy_knows_the_way_back_as_well() -> None:
    machine = Machine.load()
    before = numbers(machine)
    copy = machine.copy()
    copy.set("table.J", 1e6)
    later = copy.copy()
    later.note("lighter")
    later.undo()
    assert numbers(later) == before


def test_a_change_without_a_line_stands_in_the_way() -> None:
    machine = Machine.load()
    machine.add("stribeck", "table", torque=2e3)
    machine.note("added stribeck@table")
    by_hand = machine.toml().replace("schema = 1", "schema = 1", 1)
    edited = Machine.from_toml(by_hand)
    edited.set("table.J", 2e6)
    before = numbers(edited)
    with pytest.raises(MachineError, match=r"without a line in its history.*by hand"):
        edited.undo()
    assert numbers(edited) == before


@pytest.mark.parametrize(("line", "words"), [("", "by hand"), ('undo = "?"\n', "can't be read")])
def test_a_line_without_the_way_back_is_refused(line: str, words: str) -> None:
    text = Machine.load().toml() + f'\n[[history]]\nchange = "measured the play"\n{line}'
    with pytest.raises(MachineError, match=words) as refusal:
        Machine.from_toml(text).undo()
    assert "measured the play" in str(refusal.value)
    assert "\n" not in str(refusal.value)


# --- as a user types it ---------------------------------------------------------------------------


def run(line: str) -> Result:
    return CliRunner().invoke(main, shlex.split(line))


def test_history_and_undo_as_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("machine new --preset bench --set table.J=0.3 -o rig.toml").exit_code == 0
    assert run("add rig.toml coulomb@table --set torque=0.2 -o grown.toml").exit_code == 0
    shown = run("machine history grown.toml")
    assert shown.exit_code == 0, shown.output
    assert "added coulomb@table" in shown.output
    assert "made from bench" in shown.output
    assert "can't be undone" not in shown.output
    entries = json.loads(run("machine history grown.toml --json -").output)
    assert [e["change"] for e in entries][-1] == "added coulomb@table"

    done = run("machine undo grown.toml -o back.toml")
    assert done.exit_code == 0, done.output
    assert "added coulomb@table" in done.output
    assert numbers(Machine.load("back.toml")) == numbers(Machine.load("rig.toml"))
    assert "coulomb@table" in Machine.load("grown.toml").effects
    assert run("machine undo grown.toml").exit_code == 0
    assert "coulomb@table" not in Machine.load("grown.toml").effects
    assert run("machine undo grown.toml").exit_code == 0
    assert numbers(Machine.load("grown.toml")) == numbers(Machine.load("bench"))
    assert Machine.load("grown.toml").name == "bench"
    refused = run("machine undo grown.toml")
    assert refused.exit_code == 2
    assert "nothing to undo" in refused.stderr
    refused = run("machine undo back.toml -o grown.toml")
    assert "exists already" in refused.stderr
    assert "no history" in run("machine history bench").output


@pytest.mark.parametrize("verb", ["history", "undo"])
def test_help_shows_an_example(verb: str) -> None:
    assert f"Example: dualdrive machine {verb}" in run(f"machine {verb} --help").output
