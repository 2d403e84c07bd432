"""Torques that are turned round or exchanged are told by power, and told in every verb."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dualdrive import Machine
from dualdrive.compare import check_records, compare
from dualdrive.diagnose import diagnose
from dualdrive.identify import fit, with_torques
from dualdrive.identify.passivity import torque_doubts, whose_is_open
from dualdrive.traces import Trace, read
from dualdrive_cli.main import main
from measured import EXAMPLES, emps, measured_file, rig
from simulated import nominal, record, with_changed

LORENZ = "lorenz_friction/lor_S1_5.txt"


@functools.cache
def twin() -> tuple[Machine, Trace]:
    """Two drives under tension, torques recorded, the controller not known."""
    machine = nominal()
    trace = with_torques(machine.core, record(machine))
    channels = {c: trace[c] for c in trace if not c.startswith("I_")}
    return machine, Trace(trace.t, channels, name="record")


def linear() -> tuple[Machine, Trace]:
    return Machine.load(EXAMPLES / "emps.toml"), emps()


def motor() -> tuple[Machine, Trace]:
    path = measured_file(LORENZ)
    return Machine.load(path.parent / "lorenz.toml"), read(path, path.parent / "lorenz.map.toml")


def flipped(trace: Trace, *channels: str) -> Trace:
    return with_changed(trace, **{c: -trace[c] for c in channels})


def exchanged(trace: Trace) -> Trace:
    return with_changed(trace, T_1=trace["T_2"], T_2=trace["T_1"])


@pytest.mark.parametrize("records", [linear, motor], ids=["linear axis", "motor"])
def test_one_flipped_torque_is_told_by_compare_fit_and_diagnose(records: object) -> None:
    """The motor's torque is friction that its machine file lacks: no nominal number is asked."""
    machine, trace = records()  # type: ignore[operator]
    assert torque_doubts(machine.core, trace) == []
    spoilt = flipped(trace, "T_1")
    for notes in (
        compare(machine, spoilt, "balance").notes,
        fit(machine, spoilt, mode="balance").table().splitlines(),
        diagnose(machine, spoilt, mode="balance").warnings,
    ):
        told = [line for line in notes if "pushes against the motion" in line]
        assert told, notes
        assert "sign = -1 in the mapping" in told[0]
        assert f"{trace.name}: T_1" in told[0]


@pytest.mark.parametrize("which", [("T_1",), ("T_2",), ("T_1", "T_2")])
def test_of_two_drives_the_flipped_one_is_named(which: tuple[str, ...]) -> None:
    machine, trace = twin()
    assert torque_doubts(machine.core, trace) == []
    [doubt] = torque_doubts(machine.core, flipped(trace, *which))
    assert (doubt.code, doubt.torques) == ("sign", which)
    assert doubt.work < 0.0 or len(which) < 2
    assert doubt.recorded < 0.1 < 0.9 < doubt.mended


def test_exchanged_torques_are_told_though_their_sum_is_the_same() -> None:
    machine, trace = twin()
    [doubt] = torque_doubts(machine.core, exchanged(trace))
    assert (doubt.code, doubt.torques) == ("swapped", ("T_1", "T_2"))
    assert "exchange T_1 and T_2 in the mapping" in doubt.message
    notes = compare(machine, exchanged(trace), "balance").notes
    assert any("look exchanged" in note for note in notes)


@pytest.mark.parametrize(
    ("tension", "angles", "why"),
    [
        (0.0, True, "a record under more tension may tell"),
        (28.0, False, "the drives' angles are not recorded"),
    ],
)
def test_where_nothing_tells_whose_a_torque_is_that_is_said(
    tension: float, angles: bool, why: str
) -> None:
    machine = nominal()
    machine.set("controller.T_ten", tension)
    trace = with_torques(machine.core, record(machine))
    kept = {c: trace[c] for c in trace if c[0] != "I" and (angles or c == "theta_m" or c[0] == "T")}
    plain = Trace(trace.t, kept, name="record")
    for one in (plain, exchanged(plain)):
        assert torque_doubts(machine.core, one) == []
        assert why in whose_is_open(machine.core, one)
        for lines in (
            compare(machine, one, "balance").notes,
            fit(machine, one, mode="balance").table().splitlines(),
        ):
            [told] = [line for line in lines if "is whose this record can't tell" in line]
            assert "hangs on the mapping" in told


def test_under_tension_the_record_tells_whose_each_torque_is() -> None:
    machine, trace = twin()
    assert whose_is_open(machine.core, trace) == whose_is_open(machine.core, exchanged(trace)) == ""
    assert whose_is_open(machine.core, flipped(trace, "T_1")) == "", "it has a warning of its own"
    assert whose_is_open(linear()[0].core, linear()[1]) == ""


def test_a_column_with_a_sign_of_its_own_that_was_exchanged() -> None:
    """The second drive of the rig is mounted mirrored: exchanged columns turn the whole sum."""
    machine = Machine.load(EXAMPLES / "dual_motor_rig.toml")
    for name, trace in rig("log10").items():
        assert torque_doubts(machine.core, trace) == [], name
        mixed = with_changed(trace, T_1=-trace["T_2"], T_2=-trace["T_1"])
        [doubt] = torque_doubts(machine.core, mixed)
        assert (doubt.code, doubt.torques) == ("sign", ("T_1", "T_2")), name
        assert "exchange them" in doubt.message


@pytest.mark.parametrize("run", ["A", "B"])
def test_a_robot_axis(run: str) -> None:
    machine = Machine.load(EXAMPLES / "kuka.toml")
    path = measured_file(f"kuka_kr300/derived_rec_{run}.csv")
    trace = read(path, EXAMPLES / "kuka_axis1.map.toml")
    assert torque_doubts(machine.core, trace) == []
    assert [d.code for d in torque_doubts(machine.core, flipped(trace, "T_1"))] == ["sign"]


@pytest.mark.long
def test_records_in_order_of_another_program_raise_no_doubt() -> None:
    folder = measured_file("independent_bench")
    machine = Machine.load(folder / "nominal.toml")
    for path in sorted(folder.glob("*/*.csv")):
        assert torque_doubts(machine.core, with_torques(machine.core, read(path))) == [], path


def test_a_drive_that_only_brakes_is_no_flipped_sign() -> None:
    """Drive 2 holds against drive 1, the same both ways: the sum is inertia and losses still."""
    machine, trace = twin()
    speed = np.gradient(trace["theta_m"], trace.t)
    drag = 0.3 * np.std(trace["T_1"]) * np.tanh(speed / (0.1 * np.max(np.abs(speed))))
    braked = with_changed(trace, T_1=trace["T_1"] + drag, T_2=trace["T_2"] - drag)
    assert torque_doubts(machine.core, braked) == []


def test_the_command_line_says_so(tmp_path: Path) -> None:
    machine, trace = twin()
    machine.save(tmp_path / "machine.toml")
    spoilt = flipped(trace, "T_2")
    spoilt.to_csv(tmp_path / "record.csv")
    for verb in ("compare", "fit"):
        line = [
            verb,
            str(tmp_path / "machine.toml"),
            str(tmp_path / "record.csv"),
            "--mode=balance",
        ]
        done = CliRunner().invoke(main, line)
        assert done.exit_code == 0, done.output
        flat = " ".join(done.output.split())
        assert "warning: record: T_2 (or I_2) pushes against the motion" in flat


def test_checks_have_the_same_sentence() -> None:
    machine, trace = twin()
    told = [w for w in check_records(machine, flipped(trace, "T_1"), "balance") if w.fatal]
    assert [w.code for w in told] == ["sign"]
