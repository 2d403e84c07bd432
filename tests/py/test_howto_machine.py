"""docs/howto/machine-files.md: every file, command and line of Python in it works as printed."""

from __future__ import annotations

import math
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from dualdrive import Machine
from dualdrive.machine_file.trains import TRAINS
from dualdrive_cli.main import main

HOWTO = Path(__file__).resolve().parents[2] / "docs" / "howto" / "machine-files.md"
TEXT = HOWTO.read_text()


def blocks(language: str) -> list[str]:
    fenced = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
    return [text for spoken, text in fenced if spoken == language]


def test_every_file_is_a_machine() -> None:
    whole, two_gaps, formula, curve = (Machine.from_toml(text, "rig") for text in blocks("toml"))
    assert whole.get("motor_1.J") == pytest.approx(0.28e-4)
    assert whole.get("motors.T_max") == pytest.approx(3.81)
    assert whole.get("motors.omega_max") == pytest.approx(100 * math.pi)
    assert whole.get("meshes.gap") == pytest.approx(math.radians(7.6 / 60) * 4 / 2)
    assert whole.get("controller.T_ten") == pytest.approx(0.094 * 1.27)
    assert two_gaps.core.kind("gearbox_2") == "gap"
    assert two_gaps.get("table.J") == 4.95e6
    assert formula.effects[-1] == "expression@table"
    assert curve.get("spline@table.value_1") == pytest.approx(5e-3)
    assert curve.core.effects[-1]["axes"] == [("angle", 0.0, pytest.approx(2 * math.pi), 4, True)]


def test_every_command_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [line for block in blocks("") for line in block.splitlines()]
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("dualdrive ")]
    assert len(commands) == 9
    for words in commands:
        done = CliRunner().invoke(main, words)
        assert done.exit_code == 0, (words, done.output)
    assert Machine.load("rig3.toml").effects[-2:] == ["cogging@motors", "expression@table"]
    assert Machine.load("rig2-again.toml").effects == Machine.load("rig2.toml").effects
    assert Machine.load("rig4.toml").effects[-1] == "spline@table"


def test_the_python_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (code,) = blocks("python")
    seen: dict[str, object] = {}
    exec(compile(code, str(HOWTO), "exec"), seen)
    assert seen["run"].ok  # type: ignore[attr-defined]


def test_the_errors_are_those_printed() -> None:
    (whole, *_) = blocks("toml")
    gap = 'gap = { value = "7.6 arcmin", frame = "table", measure = "full" }'
    spoilt = [
        whole.replace(gap, "gap = '5 kg'"),
        whole.replace(gap, "gapp = 0.001"),
        whole.replace("J = 0.2\n", ""),
    ]
    printed = [line for line in TEXT.splitlines() if line.startswith("rig.toml: ")]
    assert len(printed) == len(spoilt)
    for text, line in zip(spoilt, printed, strict=True):
        with pytest.raises(ValueError, match=f"^{re.escape(line)}$"):
            Machine.from_toml(text, "rig.toml")


def test_every_drive_train_is_told() -> None:
    table = TEXT[TEXT.index("## Drive trains") : TEXT.index("## Effects")]
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) - {"drive_train"} == set(TRAINS)
