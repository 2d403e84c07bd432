"""The verbs diagnose, improve and report, as a user types them.

What they show is tested on a diagnosis made up for it; what they find is tested elsewhere, and by
the demo. With SHOWN=1 one test goes all the way, too.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import dualdrive.diagnose
from diagnosed import diagnosis, ladder
from dualdrive import Machine
from dualdrive.identify import FitError
from dualdrive.traces import read
from dualdrive_cli.main import main
from recorded import DEMO, sheet

Asked = dict[str, Any]
SUFFIX = {"report": "html"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Hold the demo's machine and records."""
    monkeypatch.chdir(tmp_path)
    for name in ("machine.toml", "fit.csv", "held_out.csv"):
        shutil.copy(DEMO / name, tmp_path)
    return tmp_path


@pytest.fixture
def asked(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Asked:
    """What the library was asked for; it answers with what was made up."""
    heard: Asked = {}

    def diagnose(machine: Any, traces: Any, **options: Any) -> Any:
        heard.update(options, machine=machine, traces=traces)
        options["progress"]("[bold]trying coulomb@table")
        return diagnosis()

    def improve(machine: Any, traces: Any, held_out: Any = None, **options: Any) -> Any:
        heard.update(options, machine=machine, traces=traces, held_out=held_out)
        return ladder()

    monkeypatch.setattr(dualdrive.diagnose, "diagnose", diagnose)
    monkeypatch.setattr(dualdrive.diagnose, "improve", improve)
    return heard


def run(line: str) -> Result:
    return CliRunner().invoke(main, shlex.split(line))


def refused(result: Result, code: int, words: str) -> None:
    assert result.exit_code == code, result.output
    assert words in result.stderr, result.stderr


@pytest.mark.parametrize("verb", ["diagnose", "improve", "report"])
def test_help_has_an_example_that_works(verb: str, asked: Asked) -> None:
    shown = " ".join(run(f"{verb} --help").output.split())
    example = shown.partition("Example: dualdrive ")[2]
    assert example.startswith(verb)
    done = run(example)
    assert done.exit_code == 0, done.output
    output = Path(shlex.split(example)[-1])
    assert output.exists()
    assert str(output) in done.stdout


def test_a_diagnosis_is_shown_whole(asked: Asked) -> None:
    done = run("diagnose machine.toml fit.csv")
    assert done.exit_code == 0, done.output
    for words in (
        "ambiguous: coulomb@table",
        "closes 96 % of the gap",
        "warning: the clock jitters",
        "22.00%",
        "2.01 kN·m [1.95 .. 2.07 kN·m]",
        "explains: share of the error that an arbitrary torque could remove",
        "can't be told apart here: coulomb@table, stribeck@table",
        "the equation that fails: table (99% sure)",
        "slow two-way ramps, no tension, to tell coulomb@table from stribeck@table",
        "--motion 'cycle:",
        "Skipped: pairs of effects",
        "table.J 5.02e+06 kg·m²",
    ):
        assert words in done.stdout, words
    assert list(asked["traces"]) == ["fit"]


def test_figures_are_those_of_the_library(asked: Asked) -> None:
    done = run("diagnose machine.toml fit.csv --json -")
    assert json.loads(done.stdout)["verdict"] == "ambiguous"
    done = run("improve machine.toml fit.csv --json figures.json")
    assert done.exit_code == 0, done.output
    figures = json.loads(Path("figures.json").read_text())
    assert [step["held_out"] for step in figures["steps"]] == [0.43, 0.24, 0.033]


def test_settings_of_single_traces_are_told_apart_and_read_with_units(asked: Asked) -> None:
    line = "diagnose machine.toml fit.csv held_out.csv --set table.J=6e6"
    done = run(
        f"{line} --set-for held_out.csv:controller.T_ten=50% --set-for fit:meshes.gap=20arcsec"
    )
    assert done.exit_code == 0, done.output
    # 50 % of the rated 100 N·m; the frame of a gap is that of the mesh's own declaration
    assert asked["settings"]["held_out"] == {"controller.T_ten": pytest.approx(50.0)}
    machine = Machine.load("machine.toml")
    machine.set("meshes.gap", "20arcsec")
    assert asked["settings"]["fit"] == {"meshes.gap": machine.get("meshes.gap")}
    assert asked["machine"].get("table.J") == 6e6
    assert asked["machine"].get("controller.T_ten") == 28.0
    wrong = "diagnose machine.toml fit.csv --set-for"
    refused(run(f"{wrong} other.csv:table.J=1"), 2, "no trace other.csv; there are fit")
    refused(run(f"{wrong} controller.T_ten=0"), 2, "is not TRACE:KEY=VALUE")
    refused(run(f"{wrong} fit.csv:table.j=1"), 2, "table.J")


def test_options_reach_the_library(asked: Asked) -> None:
    done = run("diagnose machine.toml fit.csv --budget 7 --mode balance --start rest")
    assert done.exit_code == 0, done.output
    assert asked["budget"] == 7
    assert (asked["mode"], asked["start"], asked["motion"]) == ("balance", "rest", None)
    done = run("improve machine.toml fit.csv --held-out held_out.csv --ambiguous --most 2")
    assert done.exit_code == 0, done.output
    assert list(asked["held_out"]) == ["held_out"]
    assert asked["ambiguous"]
    assert asked["most"] == 2
    refused(run("diagnose machine.toml fit.csv --budget 0"), 2, "--budget")


def test_a_tolerance_of_no_number_says_so(folder: Path) -> None:
    done = run("diagnose machine.toml fit.csv --tolerance table.mass=0.1 --mode closed_loop")
    refused(done, 2, "tolerance: parameter table.mass: unknown, did you mean table.J")


def test_the_machine_file_has_what_was_found_and_says_how(asked: Asked) -> None:
    done = run("diagnose machine.toml fit.csv -o better.toml --plot found.svg")
    assert done.exit_code == 0, done.output
    better = Machine.load("better.toml")
    assert "coulomb@table" in better.effects
    assert better.history[-1]["change"] == "added coulomb@table, fitted to fit"
    assert Path("found.svg").read_text().count("coulomb@table") >= 1
    refused(run("diagnose machine.toml fit.csv -o better.toml"), 1, "exists already")


def test_where_nothing_is_named_the_refitted_machine_is_written(
    asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = replace(diagnosis(), verdict="parameters", improved=None)
    monkeypatch.setattr(dualdrive.diagnose, "diagnose", lambda *_, **__: plain)
    done = run("diagnose machine.toml fit.csv -o refitted.toml")
    assert done.exit_code == 0, done.output
    assert "coulomb@table" not in Machine.load("refitted.toml").effects
    assert "refitted.toml: fitted to fit" in done.stdout


@pytest.mark.parametrize("verb", ["diagnose", "improve"])
def test_a_machine_of_a_cut_search_says_that_it_is_unfinished(
    verb: str, asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut = replace(diagnosis(), verdict="unfinished", improved=None, refitted=sheet())
    monkeypatch.setattr(dualdrive.diagnose, "diagnose", lambda *_, **__: cut)
    climbed = replace(ladder(), diagnoses=[cut])
    monkeypatch.setattr(dualdrive.diagnose, "improve", lambda *_, **__: climbed)
    assert run(f"{verb} machine.toml fit.csv -o cut.toml").exit_code == 1
    change = "fitted to fit; unfinished: the search was stopped before every law had its turn"
    assert Machine.load("cut.toml").history[-1]["change"] == change


def test_every_effect_that_was_added_is_a_step_that_can_be_taken_back(
    asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    grown = Machine.load("machine.toml")
    for label, numbers in (("coulomb@table", {"torque": 9e3}), ("cogging@motors", {})):
        grown.add(label, **numbers)
        grown.note(f"added {label}, fitted to fit")
    one = ladder()
    found = replace(one, steps=[*one.steps, replace(one.steps[-1], machine=grown)])
    monkeypatch.setattr(dualdrive.diagnose, "improve", lambda *_, **__: found)
    done = run("improve machine.toml fit.csv -o better.toml")
    assert done.exit_code == 0, done.output
    better = Machine.load("better.toml")
    assert [e["change"].split(",")[0] for e in better.history] == [
        "added coulomb@table", "added cogging@motors",
    ]  # fmt: skip
    assert all(e["command"].startswith("dualdrive") for e in better.history)
    better.undo()
    assert better.effects[-1] == "coulomb@table"
    better.undo()
    before = Machine.load("machine.toml")
    assert (better.effects, better.parameters()) == (before.effects, before.parameters())


def test_a_ladder_tells_every_step_and_why_it_stopped(asked: Asked) -> None:
    done = run("improve machine.toml fit.csv --held-out held_out.csv --plot ladder.png")
    assert done.exit_code == 0, done.output
    for words in ("+ coulomb@table", "3.30%", "2.90%", "stopped: nothing is left", "ladder.png"):
        assert words in done.stdout, words


def test_records_that_can_not_be_judged_end_in_one_line(
    asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    blank = replace(diagnosis(), verdict="unknown", error={}, refitted=None)
    none = replace(ladder(), steps=[], diagnoses=[blank], stopped="the records can not be judged")
    monkeypatch.setattr(dualdrive.diagnose, "improve", lambda *_, **__: none)
    monkeypatch.setattr(dualdrive.diagnose, "diagnose", lambda *_, **__: blank)
    why = "demo-table: the records can't be judged: the clock"
    refused(run("diagnose machine.toml fit.csv"), 2, why)
    refused(run("improve machine.toml fit.csv"), 2, why)
    refused(run("report machine.toml fit.csv --no-ladder -o bare.html"), 2, why)
    done = run("report machine.toml fit.csv -o page.html --json page.json")
    refused(done, 2, why)
    assert "written: page.html" in done.stdout
    assert "The clock" in Path("page.html").read_text()
    assert json.loads(Path("page.json").read_text())["warnings"]

    def fails(*_: Any, **__: Any) -> None:
        raise FitError("the simulation fails at the starting point")

    monkeypatch.setattr(dualdrive.diagnose, "diagnose", fails)
    refused(run("diagnose machine.toml fit.csv"), 1, "demo-table: the simulation fails")


def test_a_record_of_few_samples_is_told_and_no_table_is_empty(folder: Path) -> None:
    lines = Path("fit.csv").read_text().splitlines(keepends=True)[:3]
    Path("few.csv").write_text("".join(lines))
    done = run("diagnose machine.toml few.csv")
    assert "warning: few: 2 samples are too few to tell" in done.stdout
    assert "RMS residual" not in done.stdout


def test_an_answer_with_nothing_to_draw_is_told_all_the_same(folder: Path) -> None:
    lines = Path("fit.csv").read_text().splitlines(keepends=True)[:3]
    Path("few.csv").write_text("".join(lines))
    done = run("diagnose machine.toml few.csv --json few.json --plot few.png")
    refused(done, 2, "demo-table: the records can't be judged: few: 2 samples are too few")
    assert "The records can't be judged" in done.stdout
    assert "few.png was not drawn: " in done.stderr
    assert json.loads(Path("few.json").read_text())["verdict"] == "unknown"
    assert not Path("few.png").exists()


def test_the_best_that_has_no_name_stands_beside_the_errors(
    asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    nameless = replace(diagnosis(), verdict="unknown", improved=None)
    monkeypatch.setattr(dualdrive.diagnose, "diagnose", lambda *_, **__: nameless)
    done = run("diagnose machine.toml fit.csv")
    assert done.exit_code == 0, done.output
    assert re.search(r"with coulomb@table, not named +│ +3\.10% │ +3\.30%", done.stdout)
    assert re.search(r"noise floor, refitted +│ +2\.90%", done.stdout)


def test_a_report_holds_the_command_and_the_hashes(asked: Asked) -> None:
    done = run("report machine.toml fit.csv --held-out held_out.csv -o page.html --json page.json")
    assert done.exit_code == 0, done.output
    text = Path("page.html").read_text()
    assert text.startswith("<!DOCTYPE html>")
    for words in ("fit.csv", "held_out.csv", "How the error fell", "coulomb@table"):
        assert words in text, words
    assert json.loads(Path("page.json").read_text())["stopped"]
    bare = run("report machine.toml fit.csv --no-ladder -o bare.html")
    assert bare.exit_code == 0, bare.output
    assert "How the error fell" not in Path("bare.html").read_text()


# --- answers of the library itself ----------------------------------------------------------------


@pytest.mark.parametrize("verb", ["diagnose", "improve", "report"])
def test_a_search_that_was_cut_is_no_answer_to_a_script(verb: str, folder: Path) -> None:
    done = run(f"{verb} machine.toml fit.csv --budget 0.01 -o out.{SUFFIX.get(verb, 'toml')}")
    refused(done, 1, "unfinished: --budget cut the search; a longer one, or none, ends it")
    assert "Traceback" not in done.output


def test_trust_keeps_a_record_of_a_closed_loop(folder: Path) -> None:
    """Both currents have the wrong sign in one of two records."""
    trace = read("fit.csv")
    wrong = trace.with_channel("I_1", -trace["I_1"]).with_channel("I_2", -trace["I_2"])
    wrong.to_csv("wrong.csv")
    line = "diagnose machine.toml fit.csv wrong.csv --budget 0.01 --mode closed_loop --json -"
    left_out, kept = (run(f"{line} {trust}") for trust in ("", "--trust wrong"))
    assert json.loads(left_out.stdout)["records"] == ["fit"]
    assert json.loads(kept.stdout)["records"] == ["fit", "wrong"]
    assert "--trust wrong overrules" in " ".join(json.loads(left_out.stdout)["warnings"])
    refused(run(f"{line} --trust other"), 2, "trust: no trace other; there are fit, wrong")


# --- all the way ----------------------------------------------------------------------------------


@pytest.mark.skipif("SHOWN" not in os.environ, reason="the demo goes all the way, too: SHOWN=1")
def test_the_demos_missing_effect_is_found(folder: Path) -> None:
    done = run("diagnose machine.toml fit.csv --budget 60 --json -")
    assert done.exit_code == 0, done.output
    figures = json.loads(done.stdout)
    names = [f"{c['effect']}@{c['place']}" for c in figures["candidates"]]
    assert "coulomb@table" in names[:3]
    assert figures["equation"]["name"] == "table"
