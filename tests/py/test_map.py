"""The verb map: what is proposed for foreign recordings, why, and what is said of the rest."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from dualdrive.plots import mapping as picture
from dualdrive.traces import Proposal, TraceError, propose, read, read_mapping
from dualdrive_cli.main import main
from measured import measured_file

T = np.arange(2000) * 1e-3
ANGLE = 0.3 * np.sin(2 * np.pi * T) + 0.1 * np.sin(7 * T)
SPEED = 0.6 * np.pi * np.cos(2 * np.pi * T) + 0.7 * np.cos(7 * T)
PUSH = 0.02 * np.gradient(SPEED, T) + 0.3 * np.sign(SPEED)


def recording(path: Path, header: str, *columns: np.ndarray) -> Path:
    lines = [",".join(f"{x:.9g}" for x in row) for row in np.column_stack(columns)]
    path.write_text("\n".join([header, *lines] if header else lines) + "\n")
    return path


def channels(proposal: Proposal) -> dict[str, str]:
    return {g.column: g.channel for g in proposal.columns if g.channel}


def reason(proposal: Proposal, column: str) -> str:
    return next(g.reason for g in proposal.columns if g.column == column)


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["map", *map(str, arguments)])


# --- the verb -------------------------------------------------------------------------------------


def test_it_writes_a_mapping_that_reads_the_recording_and_draws_it(tmp_path: Path) -> None:
    path = recording(
        tmp_path / "scope.csv", "Zeit [s],Tisch_Lage [deg],Motor1_Moment [Nm],Gadget",
        T, np.degrees(ANGLE), PUSH, T % 0.5,
    )  # fmt: skip
    target, plot = tmp_path / "scope.map.toml", tmp_path / "scope.png"
    result = run(path, "-o", target, "--plot", plot)
    assert result.exit_code == 0, result.output
    text = target.read_text()
    assert "# Gadget: not mapped: its name says no angle" in text
    assert '# Motor1_Moment: says "motor", "moment", "1"' in text
    assert plot.stat().st_size > 10_000
    trace = read(path)  # finds the mapping beside it
    np.testing.assert_allclose(trace["theta_m"], ANGLE, atol=1e-8)
    np.testing.assert_allclose(trace["T_1"], PUSH, atol=1e-8)
    assert "2 of 3 columns mapped" in result.output


def test_nothing_is_written_unasked_nor_over_what_is_there(tmp_path: Path) -> None:
    path = recording(tmp_path / "log.csv", "t,theta_m", T, ANGLE)
    before = sorted(tmp_path.iterdir())
    result = run(path)
    assert result.exit_code == 0
    assert "nothing written" in result.output
    assert sorted(tmp_path.iterdir()) == before
    assert run(path, "-o", path).exit_code == 2
    assert path.read_text().startswith("t,theta_m")


def test_json_has_every_column_with_its_reason(tmp_path: Path) -> None:
    path = recording(tmp_path / "log.csv", "t,theta_m [rad],Moment", T, ANGLE, PUSH)
    told = json.loads(run(path, "--json", "-").output)
    assert [c["column"] for c in told["columns"]] == ["theta_m", "Moment"]
    assert told["mapping"]["columns"]["theta_m"]["channel"] == "theta_m"
    assert all(c["reason"] for c in told["columns"])


@pytest.mark.parametrize("drives", ["", "x", "1,2,3", "-1"])
def test_drives_are_one_number_or_two(tmp_path: Path, drives: str) -> None:
    path = recording(tmp_path / "log.csv", "t,theta_m", T, ANGLE)
    result = run(path, "--drives", drives)
    assert result.exit_code == 2
    assert "one number or two" in result.output


# --- drives and axes ------------------------------------------------------------------------------


def test_two_axes_are_taken_for_two_drives_with_a_word(tmp_path: Path) -> None:
    header = "t,axis1_motor_pos_rad,axis1_torque_Nm,axis2_motor_pos_rad,axis2_torque_Nm"
    path = recording(tmp_path / "two.csv", header, T, ANGLE, PUSH, ANGLE, PUSH)
    proposal = propose(path)
    assert channels(proposal)["axis2_torque_Nm"] == "T_2"
    assert any("Axes 1 and 2 are taken for the two drives" in note for note in proposal.notes)
    alone = propose(path, drives=[2])
    assert channels(alone) == {"axis2_motor_pos_rad": "theta_1", "axis2_torque_Nm": "T_1"}
    assert reason(alone, "axis1_torque_Nm") == "of axis 1, which is not taken"


def test_a_robot_is_not_two_drives() -> None:
    proposal = propose(measured_file("kuka_kr300/derived_rec_A.csv"))
    assert channels(proposal) == {
        "ax1_ref_pos_deg": "theta_ref",
        "ax1_motor_pos_deg": "theta_1",
        "ax1_motor_vel_dps": "omega_1",
        "ax1_motor_torque_Nm": "T_1",
        "ax1_load_pos_deg": "theta_m",
        "ax1_load_vel_dps": "omega_m",
    }
    assert any("a machine is one axis; axis 1 is taken" in note for note in proposal.notes)
    assert any("theta_1 turns 1 times as far as theta_m" in note for note in proposal.notes)
    assert len(proposal.unmapped) == 24
    third = propose(measured_file("kuka_kr300/derived_rec_A.csv"), drives=[3])
    assert channels(third)["ax3_motor_torque_Nm"] == "T_1"
    assert len(third.unmapped) == 24


def test_a_third_drive_and_a_setting_are_named_not_taken() -> None:
    proposal = propose(measured_file("dual_motor_rig/log8.csv"))
    assert channels(proposal)["FC2Torque"] == "T_2"
    assert reason(proposal, "FC3Torque") == "of drive 3, which is not taken"
    assert "as a setting does" in reason(proposal, "LoadTorque")
    assert "always 0" in reason(proposal, "SlaveDroop")
    assert "counted the other way" in reason(proposal, "FC1Position")
    assert any(note.startswith("Drives 1, 2, 3:") for note in proposal.notes)


def test_counts_and_their_sign_bit_are_told() -> None:
    proposal = propose(measured_file("dual_sts3215_backlash/motor_telemetry_nocomp2.csv"))
    assert channels(proposal)["pos (2)"] == "theta_2"
    assert "counts perhaps" in reason(proposal, "pos (1)")
    assert "sign_bit = 15" in reason(proposal, "speed (1)")
    assert reason(proposal, "pos (3)") == "of drive 3, which is not taken"


# --- by values ------------------------------------------------------------------------------------


def test_a_command_its_reading_and_the_force_are_found_by_their_values() -> None:
    proposal = propose(measured_file("emps/DATA_EMPS_PULSES.mat"))
    assert channels(proposal) == {"qg": "theta_ref", "qm": "theta_m", "vir": "T_1"}
    assert [guess.column for guess in proposal.unmapped] == ["pulses_N"]
    assert any("gtau = 35.1507" in note for note in proposal.notes)
    assert any("radius = '1 m'" in note for note in proposal.notes)


def test_a_file_without_a_header_and_a_clock_is_read() -> None:
    path = measured_file("lorenz_friction/lor_S1_5.txt")
    proposal = propose(path)
    assert channels(proposal) == {
        "column 1": "theta_m",
        "column 2": "omega_m",
        "column 3": "theta_ref",
        "column 4": "omega_ref",
        "column 5": "T_1",
    }  # as its authors' own mapping has it
    assert proposal.mapping.time.sample_time == "0.001 s"
    own = read(path, read_mapping(measured_file("lorenz_friction/lorenz.map.toml")))
    trace = proposal.trace()
    for name in ("theta_m", "omega_m", "theta_ref", "omega_ref", "T_1", "t"):
        mine, theirs = (one.t if name == "t" else one[name] for one in (trace, own))
        np.testing.assert_allclose(mine, theirs)


def test_noise_is_no_channel(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    noise = random.standard_normal((3, len(T)))
    proposal = propose(recording(tmp_path / "x.csv", "t,foo,bar,baz", T, *noise))
    assert channels(proposal) == {}
    assert all("neither its name nor its values" in g.reason for g in proposal.columns)
    assert any("No channel recognised" in note for note in proposal.notes)


def test_a_headless_angle_and_speed_give_the_sample_time(tmp_path: Path) -> None:
    path = recording(tmp_path / "bare.csv", "", PUSH, SPEED, ANGLE)
    proposal = propose(path)
    assert channels(proposal) == {"column 1": "T_1", "column 2": "omega_m", "column 3": "theta_m"}
    assert proposal.mapping.time.sample_time == "0.001 s"


def test_a_first_column_that_rises_evenly_is_the_clock(tmp_path: Path) -> None:
    late = T + 3e-4 * np.sin(900 * T)  # stamps of a bus, not quite even
    proposal = propose(recording(tmp_path / "bare.csv", "", late, ANGLE, SPEED, PUSH))
    assert channels(proposal) == {"column 2": "theta_m", "column 3": "omega_m", "column 4": "T_1"}
    assert proposal.mapping.time.column == "column 1"
    assert "column 1 rises evenly: the clock, s assumed from steps of 0.00" in " ".join(
        proposal.notes
    )
    np.testing.assert_allclose(proposal.trace().t, late, atol=1e-8)


def test_an_angle_that_rises_evenly_is_no_clock(tmp_path: Path) -> None:
    path = recording(tmp_path / "log.csv", "Motor1_Lage,Moment", T, PUSH)
    assert propose(path).mapping.time.sample_time == "1ms"


@pytest.mark.parametrize(
    ("header", "channel"),
    [
        ("Sollwert Tisch [rad]", "theta_ref"),
        ("Tisch Ist [arcsec]", "theta_m"),
        ("Geschw Soll [rad/s]", "omega_ref"),
        ("I_eff in A", "I_1"),
        ("n_ist (1/min)", "omega_1"),
        ("M_ist [N*m]", "T_1"),
        ("Phase [deg]", ""),
        ("Versorgung [V]", ""),
        ("Heizung in A", ""),
    ],
)
def test_where_no_word_says_it_the_unit_does(header: str, channel: str, tmp_path: Path) -> None:
    proposal = propose(recording(tmp_path / "log.csv", f"t,{header}", T, ANGLE))
    assert list(channels(proposal).values()) == ([channel] if channel else [])


def test_an_effective_current_is_read_as_one(tmp_path: Path) -> None:
    proposal = propose(recording(tmp_path / "log.csv", "t,I_eff in A", T, ANGLE))
    np.testing.assert_allclose(proposal.trace()["I_1"], np.sqrt(3) * ANGLE, atol=1e-8)
    assert '"eff"' in reason(proposal, "I_eff")


# --- reading afterwards ---------------------------------------------------------------------------


def test_columns_that_are_not_mapped_are_named_when_a_trace_is_read(tmp_path: Path) -> None:
    path = recording(tmp_path / "log.csv", "t,theta_m,Moment,pulses_N", T, ANGLE, PUSH, T)
    (told,) = read(path).log["unmapped"]
    assert told.message == "not mapped, kept under their own names: Moment, pulses_N"
    assert told.is_note
    read(path, strict=True)
    (tmp_path / "log.map.toml").write_text('[file]\nignore = ["Moment", "pulses_N"]\n')
    assert not read(path).log["unmapped"]


def test_the_picture_has_a_panel_for_each_kind_and_every_column_left_out(tmp_path: Path) -> None:
    header = "t,theta_ref,theta_m,omega_m,T_1,foo"
    path = recording(tmp_path / "log.csv", header, T, ANGLE, ANGLE, SPEED, PUSH, T)
    figure = picture(propose(path))
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert [label.split(" [")[0] for label in labels if label] == ["angle", "speed", "torque"]
    drawn = [line.get_label() for axes in figure.axes for line in axes.get_lines()]
    assert {"theta_ref", "theta_m", "omega_m", "T_1"} <= set(drawn)
    assert "foo" in [axes.get_title(loc="left") for axes in figure.axes]


def test_the_table_has_an_axis_beside_the_motors_and_columns_their_own_unit(tmp_path: Path) -> None:
    header = "t,theta_ref,theta_m,theta_1,theta_2,M_ist [%],oil [degC],foo [furlong]"
    motor, share = 3000 * ANGLE, 80 * ANGLE / np.max(np.abs(ANGLE))
    columns = (T, ANGLE, ANGLE, motor, motor, share, 30 + T, T**2)
    figure = picture(propose(recording(tmp_path / "log.csv", header, *columns)))
    shown = {axes.get_ylabel().split(" [")[0]: axes for axes in figure.axes}
    assert {"table angle", "motor angle"} <= set(shown)
    assert len(shown["table angle"].get_lines()) == len(shown["motor angle"].get_lines()) == 2
    small = {axes.get_title(loc="left"): axes for axes in figure.axes}
    for title, values in {"M_ist [%]": share, "oil [degC]": 30 + T, "foo [furlong]": T**2}.items():
        drawn = np.asarray(small[title].get_lines()[0].get_ydata(), float)
        np.testing.assert_allclose(drawn, values, atol=1e-6)


def test_columns_that_nobody_recognises_are_drawn_and_written_too(tmp_path: Path) -> None:
    path = recording(tmp_path / "log.csv", "t,foo,bar", T, np.sin(40 * T), T % 0.3)
    target, plot = tmp_path / "log.map.toml", tmp_path / "log.png"
    result = run(path, "-o", target, "--plot", plot)
    assert result.exit_code == 0, result.output
    assert target.exists()
    titles = [axes.get_title(loc="left") for axes in picture(propose(path)).axes]
    assert [title for title in titles if title] == ["foo", "bar"]
    with pytest.raises(TraceError, match="dualdrive map proposes one"):
        read(path)
