"""docs/howto/tune.md and optimise.md do what they print; both verbs as a user types them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from dualdrive.linear import frequency_response
from dualdrive.machine import Machine
from dualdrive.tune import KNOWN, PROCEDURE
from howto import Page, typed

TUNE, OPTIMISE = Page("tune.md"), Page("optimise.md")


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def measured(name: str, drive: int, stiffness: float) -> None:
    """A measured speed loop: one of the model, written as an instrument would."""
    machine = Machine.load("heavy-table-550t")
    machine.set("mesh_2.stiffness", stiffness)
    found = frequency_response(
        machine, f"Omega_{drive}*", f"omega_c{drive}", modes=(1, 1), cut=["position", "equaliser"]
    )
    rows = zip(found.frequency_hz, found.magnitude_db, found.phase_deg, strict=True)
    lines = ["frequency [Hz],magnitude [dB],phase [deg]", *(",".join(map(str, r)) for r in rows)]
    Path(name).write_text("\n".join(lines) + "\n")


@pytest.mark.long
def test_tune_page(tmp_path: Path) -> None:
    for name, drive in (("master.csv", 1), ("slave.csv", 2)):
        measured(name, drive, 2e7)
    TUNE.run_commands()
    assert {f"step-{n}.png" for n in range(1, 9)} == {
        p.name for p in (tmp_path / "steps").iterdir()
    }
    tuned, same = (Machine.load(name) for name in ("tuned.toml", "same.toml"))
    for one, other in zip(tuned.parameters(), same.parameters(), strict=True):
        assert other.value == pytest.approx(one.value, rel=1e-12) or "omega_ci" in one.path
    assert "tuned by steps 1, 2, 3, 4, 5, 6, 7, 8" in tuned.history[-1]["change"]
    (table,) = TUNE.blocks("toml")
    Path("drives.toml").write_text(table)
    result = typed("tune heavy-table-550t --until 0 --parameters drives.toml")
    assert result.exit_code == 0, result.output
    TUNE.run_python()


@pytest.mark.long
def test_optimise_page() -> None:
    for line in OPTIMISE.lines():
        quick = "" if "--corner" in line else " --no-corners"
        result = typed(line + quick)
        assert result.exit_code == 0, f"{line}: {result.output}"
    assert json.loads(Path("front.json").read_text())["least_tension"]["value"] > 40
    OPTIMISE.run_python()


def test_every_number_and_step_is_on_the_page() -> None:
    for number in KNOWN:
        assert number in TUNE.text, number
    rules = TUNE.text.partition("## What the figures")[0]
    assert len(PROCEDURE) == len(re.findall(r"^\| [1-8] \| [a-z]", rules, re.M))


def test_drives_that_differ_end_with_code_1() -> None:
    line = "tune heavy-table-550t --set mesh_2.stiffness=14MN*m/rad -o never.toml --table never.txt"
    result = typed(f"{line} --json found.json")
    assert result.exit_code == 1
    assert re.search(r"step 3: the drives differ from .* Hz on, most at 3\.\d+ Hz", result.stderr)
    assert "mesh_2.stiffness at 70 % of mesh_1.stiffness" in result.stderr
    assert not Path("never.toml").exists()
    assert not Path("never.txt").exists()
    assert json.loads(Path("found.json").read_text())["status"] == "refused"


def test_measured_drives_that_differ() -> None:
    for name, drive in (("master.csv", 1), ("slave.csv", 2)):
        measured(name, drive, 1.4e7)
    result = typed("tune heavy-table-550t --until 3 --measured master.csv slave.csv")
    assert result.exit_code == 1
    assert "step 3: the drives differ" in result.stderr


def test_guided() -> None:
    answers = "n\nn\n"
    result = typed("tune heavy-table-550t --guided --until 4 -o kept.toml", answers=answers)
    assert result.exit_code == 0, result.output
    assert result.output.count("(2) Current and speed loop") == 1
    kept, found = Machine.load("kept.toml"), Machine.load("heavy-table-550t")
    assert [p.value for p in kept.parameters()] == [p.value for p in found.parameters()]
    stopped = typed("tune heavy-table-550t --guided -o none.toml", answers="y\n")
    assert stopped.exit_code == 130
    assert not Path("none.toml").exists()


@pytest.mark.parametrize("verb", ["tune", "optimise"])
def test_refusals_are_one_line(verb: str) -> None:
    result = typed(f"{verb} heavy-table-single-motor")
    assert result.exit_code in (1, 2)
    assert result.stderr.count("\n") == 1
    shown = typed(f"{verb} --help").output
    assert f"Example: dualdrive {verb}" in " ".join(shown.split())
