"""A commanded motion as a file: written, read, and taken by --motion."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dualdrive.motion import Motion, MotionError, motion_csv, parse_motion, read_motion
from dualdrive_cli.main import main

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
    with pytest.raises(MotionError, match=r"other.csv: no column theta_ref in it; it holds I_1"):
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
