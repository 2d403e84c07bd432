"""dualdrive play, and what compare and fit take for a torque balance, as a user types them."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from balance_stand_in import Recorded
from dualdrive import Machine
from dualdrive.traces import Trace
from dualdrive_cli.main import main
from test_play import COMPLIANCE, PLAY, driven

DEMO = Path(__file__).resolve().parents[2] / "python" / "dualdrive" / "demo"
MASS, VISCOUS, DRY, OFFSET = 95.0, 200.0, 20.0, -3.0


@pytest.fixture
def dualdrive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Result]:
    """Run a command line in a folder with the demo's machine and records."""
    monkeypatch.chdir(tmp_path)
    for name in ("machine.toml", "fit.csv", "held_out.csv"):
        shutil.copy(DEMO / name, tmp_path)

    def run(line: str) -> Result:
        return CliRunner().invoke(main, shlex.split(line))

    return run


def written(trace: Recorded, name: str) -> None:
    Trace(trace.t, trace.channels).to_csv(name)


def refused(result: Result) -> str:
    """What a refused command says, in one line of its own."""
    assert result.exit_code == 2, result.output
    return result.stderr.splitlines()[-1]


# --- play -----------------------------------------------------------------------------------------


def test_currents_alone_ask_for_the_machine(dualdrive: Callable[[str], Result]) -> None:
    said = refused(dualdrive("play fit.csv"))
    assert "fit: no channel T_1, only the current I_1; --machine machine.toml" in said


@pytest.mark.parametrize(
    ("line", "rows"),
    [
        ("compare", 2),
        ("fit", 2),
        ("compare --mode balance", 2),
        ("compare --mode balance", 30),
        ("play --machine", 2),
        ("play --machine", 30),
    ],
)
def test_a_record_of_few_samples_is_told_with_its_name(
    dualdrive: Callable[[str], Result], line: str, rows: int
) -> None:
    lines = Path("fit.csv").read_text().splitlines(keepends=True)[: 1 + rows]
    Path("few.csv").write_text("".join(lines))
    said = refused(dualdrive(f"{line} machine.toml few.csv"))
    assert said.startswith("dualdrive: few: ")
    assert "record longer" in said


def test_the_example_of_the_help_works(dualdrive: Callable[[str], Result]) -> None:
    text = " ".join(dualdrive("play --help").output.split())
    example = re.search(r"Example: dualdrive (.+)$", text)
    assert example
    done = dualdrive(example[1])
    assert done.exit_code == 0, done.output
    assert Path("play.png").read_bytes()[:4] == b"\x89PNG"
    # tension holds both drives of the demo on one flank
    assert done.output.count("only a lower bound") == 2


def test_a_known_play_is_printed_drawn_and_written(dualdrive: Callable[[str], Result]) -> None:
    written(driven(), "known.csv")
    done = dualdrive("play known.csv --drive 1 --plot known.png --json known.json")
    assert done.exit_code == 0, done.output
    (mesh,) = json.loads(Path("known.json").read_text())["meshes"]
    assert mesh["full"]["low"] < PLAY < mesh["full"]["high"]
    assert mesh["full"]["value"] == pytest.approx(PLAY, abs=0.02)
    assert mesh["loaded"]["value"] == pytest.approx(
        PLAY + 2 * COMPLIANCE * mesh["torque"], abs=0.02
    )
    assert re.search(r"full play +5[012]\.\d+ \[\S+ \.\. \S+\] deg", done.output)
    assert "written: known.png" in done.output
    again = dualdrive("play known.csv --plot known.png")
    assert (again.exit_code, again.stderr.count("\n")) == (1, 1)
    assert "known.png: exists already" in again.stderr


def test_ratios_are_given_or_taken_from_the_machine(dualdrive: Callable[[str], Result]) -> None:
    plain = driven()
    channels = {
        "theta_m": plain.channels["theta_m"] / 4,
        "theta_1": 10 * plain.channels["theta_c1"],
        "T_1": plain.channels["T_1"],
    }
    written(Recorded(plain.t, channels), "geared.csv")
    lines = (
        "play geared.csv --machine bench --json -",  # 10 and 4
        "play geared.csv --gear-ratio 10 --mesh-ratio 4 --json -",
    )
    for line in lines:
        (mesh,) = json.loads(dualdrive(line).stdout)["meshes"]
        assert mesh["full"]["value"] == pytest.approx(PLAY, abs=0.02)


def test_every_drive_whose_torque_is_recorded_is_read(dualdrive: Callable[[str], Result]) -> None:
    first = driven()
    more = {
        name.replace("1", str(n)): values
        for n in (1, 3, 8)
        for name, values in first.channels.items()
    }
    written(Recorded(first.t, more), "many.csv")
    meshes = json.loads(dualdrive("play many.csv --json -").stdout)["meshes"]
    assert [mesh["drive"] for mesh in meshes] == [1, 3, 8]
    assert "mesh 8: 8 contacts" in dualdrive("play many.csv --drive 8").stdout
    assert "1<=x<=8" in refused(dualdrive("play many.csv --drive 9"))


def test_what_play_cannot_use_is_refused_in_one_line(dualdrive: Callable[[str], Result]) -> None:
    written(driven(), "known.csv")
    for line, words in (
        ("play known.csv --drive 2", "nor theta_2 to read the play from; map one"),
        ("play known.csv --load 100", "no 0.3 s of torque beyond 100"),
        ("play known.csv --part Test=1", "the mapping splits nothing"),
        ("play missing.csv", "missing.csv: there is no such file; check its name"),
    ):
        assert words in refused(dualdrive(line))


# --- compare and fit by torque balance ------------------------------------------------------------


def axis_record() -> None:
    """An axis that obeys M a + Fv v + Fc sign(v) = F + offset, in two tests, its angle smooth."""
    t = np.arange(0, 40, 1e-3)
    rates = 2 * np.pi * np.array([0.3, 0.7, 1.1])
    sizes = np.array([0.2, 0.08, 0.03])
    wave = np.outer(t, rates)
    position = np.sin(wave) @ sizes
    speed = np.cos(wave) @ (sizes * rates)
    acceleration = -np.sin(wave) @ (sizes * rates**2)
    force = MASS * acceleration + VISCOUS * speed + DRY * np.sign(speed) + OFFSET
    test = np.where(t < 20, 1.0, 2.0)
    Trace(t, {"theta_m": position, "T_1": force, "Test": test}).to_csv("axis.csv")
    Path("axis.map.toml").write_text('[split]\nby = ["Test"]\n')


def bare_axis() -> None:
    machine = Machine.load("linear-axis")
    machine.remove("coulomb@table")
    machine.set("table.J", 100.0)
    machine.save("bare.toml")


@pytest.mark.long
def test_a_split_record_is_fitted_without_naming_what(dualdrive: Callable[[str], Result]) -> None:
    axis_record()
    bare_axis()
    bare = json.loads(dualdrive("fit bare.toml axis.csv --cutoff 50 --json -").stdout)
    assert set(bare["parameters"]) == {"table.J", "table.b"}  # a ratio is counted, not fitted
    assert dualdrive("add bare.toml coulomb@table -o dry.toml").exit_code == 0
    done = dualdrive("fit dry.toml axis.csv --cutoff 50 --decimate 5 --json f.json -o fitted.toml")
    assert done.exit_code == 0, done.output
    found = json.loads(Path("f.json").read_text())
    assert found["force_error"]["refitted"] < 0.02 < 0.06 < bare["force_error"]["refitted"]
    true = {"table.J": MASS, "table.b": VISCOUS, "coulomb@table.torque": DRY}
    for path, value in true.items():
        assert found["parameters"][path]["value"] == pytest.approx(value, rel=0.01)
        assert Machine.load("fitted.toml").get(path) == pytest.approx(value, rel=0.01)
    units = [found["parameters"][path]["unit"] for path in true]
    assert units == ["kg", "N*s/m", "N"]
    assert len(found["offsets"]) == 2
    for offset in found["offsets"].values():
        assert (offset["unit"], offset["value"]) == ("N", pytest.approx(OFFSET, abs=0.3))
    assert "both sides decimated ×5 to 200 Hz" in found["processing"]


def test_a_part_is_taken_and_standstill_treated_as_told(dualdrive: Callable[[str], Result]) -> None:
    axis_record()
    line = "compare linear-axis axis.csv --part Test=2 --standstill keep --json -"
    content = json.loads(dualdrive(line).stdout)
    assert content["records"] == ["axis[Test=2]"]
    assert any("near standstill kept" in note for note in content["notes"])
    every = dualdrive("compare linear-axis axis.csv").output
    assert re.search(r"axis\[Test=1\] +\d", every)
    assert re.search(r"axis\[Test=2\] +\d", every)
    assert "Test is 1, 2" in refused(dualdrive("compare linear-axis axis.csv --part Test=3"))
    assert "parts differ in Test" in refused(dualdrive("compare linear-axis axis.csv --part A=3"))


def test_filters_are_refused_where_the_loop_is_simulated(
    dualdrive: Callable[[str], Result],
) -> None:
    for verb in ("compare", "fit"):
        words = refused(dualdrive(f"{verb} machine.toml fit.csv --cutoff 5"))
        assert "filters and standstill belong to the torque balance" in words
