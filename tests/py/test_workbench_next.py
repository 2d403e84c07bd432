"""The next experiment in the page: its motion as a file, and the command shown beside it."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from diagnosed import diagnosis
from dualdrive.demo import sheet
from dualdrive.motion import parse_motion, read_motion
from dualdrive.workbench import keep, views
from dualdrive.workbench.project import Project
from dualdrive_cli.main import main
from recorded import DEMO
from workbench_page import Seen, chromium, needs_chromium
from workbench_server import Running, running, wait_for

pytestmark = needs_chromium


def stored(project: Path) -> None:
    """A project whose last diagnosis is one that can't tell two laws of friction apart."""
    with running(project, DEMO / "machine.toml", DEMO / "fit.csv") as server:
        wait_for(lambda: compared(server))
    found = Project(project)
    job = found.jobs[max(int(path.name) for path in (project / "jobs").iterdir()) + 1]
    job.folder.mkdir()
    d = diagnosis("not refitted")
    keep.save(d, job.folder, "diagnosis")
    view = json.dumps(views.diagnosis(d, sheet()), allow_nan=False)
    (job.folder / "view.json").write_text(view, "utf-8")
    with found.change("diagnosis") as now:
        now["diagnosis"] = {"job": job.number, "step": now["steps"][-1]["id"], "effort": "quick"}


def compared(server: Running) -> bool:
    return [step["status"] for step in server.state["steps"]] == ["ready"]


def test_the_motion_is_saved_and_the_command_beside_it_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored(tmp_path / "project")
    with running(tmp_path / "project") as server, chromium() as browser:
        seen = Seen(browser, server.address)
        seen.wait("#part-next", "tells coulomb@table from stribeck@table")
        assert "An effect is missing from the model" in seen.text("#sentence")
        assert "At creep what depends on speed falls away." in seen.text("#part-next")
        assert "The clock jitters by 3 % of a sample." in seen.text("#finding")
        weak = seen.page.locator("#more-candidates").text_content() or ""
        assert "gain expected 3" in weak
        seen.saved("#save-next", tmp_path / "next-experiment.csv")
        seen.saved("[id='save-machine.toml']", tmp_path / "machine.toml")
        words = seen.text("#part-next pre")
        command = shlex.split(seen.text("#try-next"))
        assert seen.faults() == []
        assert seen.complaints == []
        seen.page.close()
    planned = parse_motion(words)
    read = read_motion(tmp_path / "next-experiment.csv")
    t = np.linspace(0.0, read.end, 20_000)
    assert np.abs(read.waveform.value(t) - planned.waveform.value(t)).max() < 1e-9
    monkeypatch.chdir(tmp_path)
    assert command[:2] == ["dualdrive", "simulate"]
    assert "controller.T_ten=0" in command
    done = CliRunner().invoke(main, command[1:])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "expected.png").stat().st_size > 10_000
