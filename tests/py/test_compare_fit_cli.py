"""The verbs compare and fit, as a user types them."""

from __future__ import annotations

import csv
import json
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dualdrive import Machine
from dualdrive.compare import compare
from dualdrive_cli.main import main
from recorded import DEMO, demo, maker, sheet


@pytest.fixture
def dualdrive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Result]:
    """Run a command line in a folder that holds the demo's machine and records."""
    monkeypatch.chdir(tmp_path)
    for name in ("machine.toml", "fit.csv", "held_out.csv"):
        shutil.copy(DEMO / name, tmp_path)

    def run(line: str) -> Result:
        return CliRunner().invoke(main, shlex.split(line))

    return run


def refused(result: Result, code: int, words: str) -> None:
    assert result.exit_code == code, result.output
    assert words in result.stderr, result.stderr


@pytest.mark.parametrize("verb", ["compare", "fit"])
def test_help_has_an_example_that_works(verb: str, dualdrive: Callable[[str], Result]) -> None:
    shown = " ".join(dualdrive(f"{verb} --help").output.split())
    example = shown.partition("Example: dualdrive ")[2]
    assert example.startswith(verb)
    if verb == "fit":
        dualdrive("add machine.toml coulomb@table -o grown.toml --overwrite")
        Path("grown.toml").replace("machine.toml")
    done = dualdrive(example)
    assert done.exit_code == 0, done.output


def test_compare_prints_and_writes_what_the_library_finds(
    dualdrive: Callable[[str], Result],
) -> None:
    found = compare(sheet(), demo("fit"))
    done = dualdrive("compare machine.toml fit.csv --json figures.json -o channels.csv")
    assert done.exit_code == 0, done.output
    assert f"{found.error['headline']:.2%}" in done.stdout
    figures = json.loads(Path("figures.json").read_text())
    assert figures["error"]["headline"] == pytest.approx(found.error["headline"], rel=1e-6)
    with Path("channels.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(demo("fit"))
    assert float(rows[900]["I_1 simulated [A]"]) == pytest.approx(
        found["I_1"].simulated[900], rel=1e-6
    )


def test_a_torque_balance_that_nobody_asked_for_says_so_and_why(
    dualdrive: Callable[[str], Result],
) -> None:
    demo("fit").without("theta_ref").to_csv("silent.csv")
    said = " ".join(dualdrive("compare machine.toml silent.csv").stdout.split())
    assert "torque balance, for silent has no theta_ref to simulate the loop with: total is" in said
    assert "T_1, T_2: I_1, I_2 times the motor's torque constant" in said
    asked = " ".join(dualdrive("compare machine.toml fit.csv --mode balance").stdout.split())
    assert "no theta_ref" not in asked
    assert "total is the sum of all bodies' equations of motion" in asked


def test_json_alone_goes_to_standard_output(dualdrive: Callable[[str], Result]) -> None:
    done = dualdrive("compare machine.toml fit.csv held_out.csv --json -")
    assert json.loads(done.stdout)["records"] == ["fit", "held_out"]


def test_settings_reach_the_machine(dualdrive: Callable[[str], Result]) -> None:
    plain = json.loads(dualdrive("compare machine.toml fit.csv --json -").stdout)
    other = json.loads(dualdrive("compare machine.toml fit.csv --set table.J=6e6 --json -").stdout)
    assert other["error"]["headline"] != pytest.approx(plain["error"]["headline"], rel=1e-2)


def test_fit_writes_machine_figures_and_held_out_error(
    dualdrive: Callable[[str], Result],
) -> None:
    dualdrive("add machine.toml coulomb@table -o grown.toml")
    done = dualdrive(
        "fit grown.toml fit.csv --held-out held_out.csv --free table.J,motors.J "
        "--free coulomb@table.torque --tolerance table.J=20% -o fitted.toml --json figures.json"
    )
    assert done.exit_code == 0, done.output
    figures = json.loads(Path("figures.json").read_text())
    torque = figures["parameters"]["coulomb@table.torque"]
    assert torque["value"] == pytest.approx(maker.truth()["effect"]["torque"], rel=0.03)
    assert figures["parameters"]["table.J"]["tolerance"] == pytest.approx(0.2)
    assert figures["error"]["held_out"] < 0.5 * figures["error"]["nominal"]
    assert f"held out: {figures['error']['held_out']:.2%} on held_out" in done.stdout
    assert Machine.load("fitted.toml").get("coulomb@table.torque") == torque["value"]
    refused(dualdrive("fit grown.toml fit.csv -o fitted.toml"), 1, "exists already")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("compare machine.toml", "TRACE"),
        ("compare machine.toml absent.csv", "absent.csv"),
        ("compare absent.toml fit.csv", "absent.toml"),
        ("compare machine.toml fit.csv fit.csv", "fit.csv is named twice; name"),
        ("compare machine.toml fit.csv --mode open", "closed_loop"),
        ("fit machine.toml fit.csv --free table.mass", "table.mass"),
        ("fit machine.toml fit.csv --free meshes.ratio", "counted or set"),
        ("fit machine.toml fit.csv --free ''", "'dualdrive machine show machine.toml' lists"),
        ("fit machine.toml fit.csv --free ' ,'", "--free names nothing"),
        ("fit machine.toml fit.csv --tolerance 0.1 --tolerance table.J=0.1", "not both"),
        ("fit machine.toml fit.csv --free table.J --tolerance table.J=x", "table.J"),
    ],
)
def test_nonsense_is_refused_before_anything_is_computed(
    line: str, words: str, dualdrive: Callable[[str], Result]
) -> None:
    refused(dualdrive(line), 2, words)


def test_names_are_printed_as_they_are(dualdrive: Callable[[str], Result]) -> None:
    """No brackets of a record's or a machine's name are a style, no colons a picture."""
    Path("fit.csv").rename("[red]x:car:[bold].csv")
    done = dualdrive("compare machine.toml '[red]x:car:[bold].csv'")
    assert done.exit_code == 0, done.output
    assert "[red]x:car:[bold]: constants granted" in done.stdout
    named = Path("machine.toml").read_text().replace('title = "', 'title = "[/] [red]:car: ')
    Path("machine.toml").write_text(named)
    assert "demo-table: [/] [red]:car: Heavy" in dualdrive("machine show machine.toml").stdout


@pytest.mark.parametrize("verb", ["fit", "improve", "report"])
def test_a_record_is_no_test_of_what_was_fitted_to_it(
    verb: str, dualdrive: Callable[[str], Result]
) -> None:
    here = f"{verb} machine.toml fit.csv"
    refused(dualdrive(f"{here} --held-out ./fit.csv"), 2, "--held-out fit.csv: is fitted too")
    demo("fit").to_csv("copy.csv")
    copied = "--held-out copy: holds the samples of fit, which is fitted; a test needs a record of"
    refused(dualdrive(f"{here} --held-out copy.csv"), 2, copied)


def test_records_of_one_name_are_told_apart_on_both_sides(
    dualdrive: Callable[[str], Result],
) -> None:
    Path("other").mkdir()
    Path("held_out.csv").rename("other/fit.csv")
    line = "fit machine.toml fit.csv --held-out other/fit.csv --free table.J --json -"
    assert "held_out" in json.loads(dualdrive(line).stdout)["error"]
    stray = dualdrive(f"{line} --set-for third.csv:table.J=5e6")
    refused(stray, 2, "there are fit.csv, other/fit.csv")


def test_a_machine_that_does_not_simulate_fails_with_one_line(
    dualdrive: Callable[[str], Result],
) -> None:
    done = dualdrive("compare machine.toml fit.csv --set controller.k_p=1e12 --start rest")
    refused(done, 1, "fit: ")
    assert done.stderr.count("\n") == 1


def test_a_repair_of_a_recording_is_told(tmp_path: Path) -> None:
    lines = (DEMO / "fit.csv").read_text().splitlines()
    lines[501] = ",".join([*lines[501].split(",")[:-1], "nan"])
    damaged = tmp_path / "damaged.csv"
    damaged.write_text("\n".join(lines) + "\n")
    command = ["compare", str(DEMO / "machine.toml"), str(damaged)]
    done = subprocess.run(
        [sys.executable, "-m", "dualdrive_cli", *command], capture_output=True, text=True
    )
    assert done.returncode == 0
    assert "damaged: missing: I_2: rows left out (row 502)" in done.stderr
