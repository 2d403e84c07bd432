"""A commanded motion as a file: written, read, and taken by --motion."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from dualdrive.motion import Motion, MotionError, motion_csv, parse_motion, read_motion
from dualdrive.traces import Trace, read
from dualdrive_cli.main import main
from recorded import DEMO, demo

SLOW = "cycle:0.0066;0.0,v=0.00084,a=0.0042,j=0.021,start=1.0,repeats=2"


def kept(text: str, folder: Path, axis: str = "rotary") -> tuple[Motion, Motion]:
    """A motion, and what a file of it is read as."""
    planned = parse_motion(text, axis=axis)
    (folder / "plan.csv").write_text(motion_csv(planned, axis=axis), "utf-8")
    return planned, read_motion(folder / "plan.csv", axis=axis)


@pytest.mark.parametrize(
    ("text", "axis"), [(SLOW, "rotary"), ("move:20mm,v=50mm/s,a=1m/s^2,j=20m/s^3", "linear")]
)
def test_a_plan_comes_back_from_its_file(text: str, axis: str, tmp_path: Path) -> None:
    planned, read = kept(text, tmp_path, axis)
    assert read.end == pytest.approx(planned.end, abs=1e-3)
    t = np.arange(0.0, read.end - 1e-3, 0.37e-3)  # between the samples too
    way = np.ptp(planned.waveform.value(t))
    fastest = np.abs(planned.waveform.rate(t)).max()
    assert np.abs(read.waveform.value(t) - planned.waveform.value(t)).max() < 1e-6 * way
    assert np.abs(read.waveform.rate(t) - planned.waveform.rate(t)).max() < 1e-3 * fastest


def test_a_recording_moves_the_model_from_its_first_time_on(tmp_path: Path) -> None:
    lines = ["t [s],theta_ref [mrad],I_1 [A]", "5.0,0,1", "5.1,1,1", "5.2,4,1", "5.3,9,1"]
    (tmp_path / "recorded.csv").write_text("\n".join(lines), "utf-8")
    read = read_motion(tmp_path / "recorded.csv")
    assert read.end == pytest.approx(0.3)
    assert read.waveform.value(0.2) == pytest.approx(4e-3)


def test_a_file_without_a_command_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other.csv").write_text("t [s],I_1 [A]\n0,1\n0.1,2\n0.2,3\n", "utf-8")
    told = r"other.csv: no column theta_ref in it; it holds I_1; call the commanded angle theta_ref"
    with pytest.raises(MotionError, match=told):
        read_motion(tmp_path / "other.csv")


def test_simulate_takes_spokenand_file_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = "move:0.1,v=1,a=20,j=1000,end=0.4"
    kept(words, tmp_path)
    found = []
    for motion in (words, "plan.csv"):
        line = ["simulate", "bench", "--motion", motion, "--end", "0.39", "--json", "-"]
        done = CliRunner().invoke(main, line)
        assert done.exit_code == 0, done.output
        found.append(json.loads(done.stdout)["figures"])
    spoken, read = ({name: told["value"] for name, told in one.items()} for one in found)
    spoken.pop("standstill_amplitude")  # samples don't say that they go on standing still
    assert read == pytest.approx(spoken, rel=1e-6, abs=1e-9)
    done = CliRunner().invoke(main, ["simulate", "bench", "--motion", "plan.csv", "-o", "plan.csv"])
    assert done.exit_code == 2
    assert "plan.csv, which is read (--motion)" in done.output


def test_sweep_takes_a_file_and_completes_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    kept("move:0.1,v=1,a=20,j=1000,end=0.4", tmp_path)
    again = ["sweep", "-o", "swept.h5", "--resume"]
    line = [*again, "bench", "--motors.J", "0.01,0.02", "--motion", "plan.csv"]
    for _ in range(2):
        done = CliRunner().invoke(main, line)
        assert done.exit_code == 0, done.output
        assert "sampled: 401 points" in done.stdout
    alone = CliRunner().invoke(main, again)
    assert alone.exit_code == 2
    assert "swept.h5: its motion was sampled" in alone.stderr
    assert "give the whole command again with --resume" in alone.stderr


def compared(record: str, motion: str) -> Result:
    """The demo's machine beside a record of this folder, the loop driven by this motion."""
    line = ["compare", str(DEMO / "machine.toml"), record, "--motion", motion, "--json", "-"]
    return CliRunner().invoke(main, line)


@pytest.fixture
def silent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A record without its command, and the command in a file of its own."""
    monkeypatch.chdir(tmp_path)
    record = demo("fit").between(0.0, 4.0)
    record.without("theta_ref", "omega_ref").to_csv(tmp_path / "silent.csv")
    return commanded(record.t, record["theta_ref"])


def commanded(t: np.ndarray, angle: np.ndarray) -> Path:
    """A file of commanded angles, rad over s."""
    return Trace(t, {"theta_ref": angle}).to_csv(Path("command.csv"))


def error(done: Result) -> float:
    assert done.exit_code == 0, done.output
    return float(json.loads(done.stdout)["error"]["headline"])


def test_a_command_on_the_clock_of_its_record_drives_it(silent: Path) -> None:
    done = compared("silent.csv", "command.csv")
    assert done.stderr == ""
    later = read(silent.with_name("silent.csv"))
    replace(later, t=later.t + 50.0).to_csv("later.csv")
    command = read(silent)
    commanded(command.t + 50.0, command["theta_ref"])
    assert error(compared("later.csv", "command.csv")) == pytest.approx(error(done), rel=1e-3)


def test_a_command_on_another_clock_is_refused(silent: Path) -> None:
    command = read(silent)
    commanded(command.t + 100.0, command["theta_ref"])
    done = compared("silent.csv", "command.csv")
    assert done.exit_code == 2
    spans = "--motion command.csv: it runs from 100 to 104 s, silent from 0 to 4 s: no time in"
    assert spans in done.stderr
    assert "give it on the clock of the record" in done.stderr


def test_a_command_that_spans_half_its_record_says_so(silent: Path) -> None:
    command = read(silent).between(0.0, 2.0)
    commanded(command.t, command["theta_ref"])
    said = compared("silent.csv", "command.csv").stderr
    assert "command.csv: it runs from 0 to 2 s, silent from 0 to 4 s; beyond its ends" in said


def test_a_command_with_a_pause_says_that_it_is_interpolated(silent: Path) -> None:
    command = read(silent)
    kept = command.take((command.t < 2.0) | (command.t > 3.0))
    commanded(kept.t, kept["theta_ref"])
    told = "command.csv: gap: a new segment begins; longest pause 1.02 s (row 202); the command is"
    assert told in compared("silent.csv", "command.csv").stderr
    line = ["simulate", str(DEMO / "machine.toml"), "--motion", "command.csv", "--end", "0.1"]
    assert told in CliRunner().invoke(main, line).stderr


@pytest.mark.parametrize("motion", ["command.csv", "move:1mrad,v=0.03,a=0.01"])
def test_a_motion_in_the_place_of_a_recorded_command_says_so(silent: Path, motion: str) -> None:
    demo("fit").between(0.0, 4.0).to_csv("fit.csv")
    said = f"--motion {motion}: stands in for the theta_ref recorded in fit; leave it out"
    assert said in compared("fit.csv", motion).stderr
