"""The verbs bode and cycles, as a user types them."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dualdrive_cli.main import main


@pytest.fixture
def dualdrive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Result]:
    """Run a command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda line: CliRunner().invoke(main, shlex.split(line))


@pytest.mark.parametrize("verb", ["bode", "cycles"])
def test_the_example_of_the_help_works(verb: str, dualdrive: Callable[[str], Result]) -> None:
    command = import_module(f"dualdrive_cli.{verb}").command
    result = dualdrive(command.epilog.removeprefix("Example: dualdrive "))
    assert result.exit_code == 0, result.output
    assert list(Path().glob("*.png"))


def test_margins_and_poles_are_told(dualdrive: Callable[[str], Result]) -> None:
    loop = dualdrive("bode heavy-table-250t --open-loop position")
    assert "gain margin 17.4 dB at 4.13 Hz" in loop.output
    poles = json.loads(dualdrive("bode bench --poles --json -").output)
    assert len(poles) == 9
    assert len(poles["(1, -1)"]["A"]) == 8
    unstable = dualdrive("bode heavy-table-550t --open-loop position --set controller.K_v=17")
    assert "closed loop unstable: it has no margins" in unstable.output


def test_drives_that_differ_are_named(dualdrive: Callable[[str], Result]) -> None:
    line = "bode heavy-table-250t --drives --set motor_2.J=0.06 --plot drives.png"
    result = dualdrive(line)
    assert "the drives differ from 15 Hz on" in result.output
    assert Path("drives.png").exists()


def test_a_cycle_and_what_was_foretold(dualdrive: Callable[[str], Result]) -> None:
    hunting = dualdrive("cycles heavy-table-250t --set controller.T_ten=0 --json -")
    found = json.loads(hunting.output)
    assert found["orbit"]["frequency_hz"] == pytest.approx(1.245, abs=1e-3)
    assert found["predicted"][0]["trusted"] is False
    assert "coulomb@table" in found["predicted"][0]["note"]


def test_a_map_and_a_branch_are_drawn(dualdrive: Callable[[str], Result]) -> None:
    line = "cycles heavy-table-550t --controller.T_ten 0,40 --settle 20s --plot map.png"
    result = dualdrive(line)
    assert result.exit_code == 0, result.output
    assert result.output.count("attracts") == 1
    assert result.output.count("comes to rest") == 1
    play = "--set coulomb@table.torque=0 --set coulomb@pinions.torque=0 --set controller.T_ten=0"
    follow = f"cycles heavy-table-550t {play} --branch controller.K_v=6 --points 3"
    assert "ends: " in dualdrive(f"{follow} --plot branch.png").output
    assert {"map.png", "branch.png"} <= {path.name for path in Path().iterdir()}


@pytest.mark.parametrize(
    ("line", "message", "code"),
    [
        ("bode bench --open-loop speed", "no block 'speed'", 2),
        ("bode bench --drives --poles", "give one", 2),
        ("bode bench --frequencies 5:1:3", "needs 0 < start < stop", 2),
        ("bode bench --open-loop position --simulate 1", "leave --open-loop and --cut out", 2),
        ("bode bench --measured none.csv", "none.csv: cannot be read", 2),
        ("cycles heavy-table-550t", "try a larger --kick (kick=), or --guess", 1),
        ("cycles linear-axis", "shooting needs a machine without delays and sampled loops", 2),
        ("cycles heavy-table-550t --branch K_v", "is not PARAMETER=STOP", 2),
    ],
)
def test_refusals_are_one_line(
    line: str, message: str, code: int, dualdrive: Callable[[str], Result]
) -> None:
    result = dualdrive(line)
    assert result.exit_code == code
    assert result.stderr.count("\n") == 1
    assert message in result.stderr
