"""What the command line tells a newcomer: verbs by task, hints, completion, sweeps in few words."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from commands import leaves
from dualdrive import Machine, parse_motion, simulate
from dualdrive.echo import once
from dualdrive.traces.log import Issue
from dualdrive_cli._traces import _once
from dualdrive_cli.main import TASKS, Verbs, main


def verbs() -> list[str]:
    assert isinstance(main, Verbs)
    return main.list_commands(main.make_context("dualdrive", [], resilient_parsing=True))


def test_the_help_shows_every_verb_once_under_its_task() -> None:
    assert sorted(name for names in TASKS.values() for name in names) == verbs()
    text = CliRunner().invoke(main, ["--help"]).output
    places = [text.index(f"{task}:") for task in TASKS]
    assert places == sorted(places)


def test_the_help_speaks_in_whole_sentences() -> None:
    text = CliRunner().invoke(main, ["--help"]).output
    listed = text.partition("Model a machine:")[2]
    assert "..." not in listed
    assert all(section.rstrip().endswith(".") for section in listed.split("\n\n"))


def test_every_verb_writes_its_figures_as_json() -> None:
    without = [
        leaf.name for leaf in leaves() if "json_to" not in {p.name for p in leaf.command.params}
    ]
    assert not without


@pytest.mark.parametrize(
    ("typed", "told"),
    [
        ("simulat", "simulat: no such verb; did you mean simulate?"),
        ("diagnoze", "did you mean diagnose?"),
        ("optimize", "did you mean optimise?"),
        ("zzz", "dualdrive --help lists all verbs"),
    ],
)
def test_a_mistyped_verb_gets_a_suggestion(typed: str, told: str) -> None:
    result = CliRunner().invoke(main, [typed])
    assert result.exit_code == 2
    assert told in result.stderr
    assert result.stderr.count("\n") == 1


# --- completion -----------------------------------------------------------------------------------


def completed(*words: str) -> list[str]:
    """What the shell is offered for the last word."""
    environment = {
        **os.environ,
        "_DUALDRIVE_COMPLETE": "bash_complete",
        "COMP_WORDS": " ".join(("dualdrive", *words)),
        "COMP_CWORD": str(len(words)),
    }
    command = [sys.executable, "-m", "dualdrive_cli"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.stderr == ""
    return [line.partition(",")[2] for line in done.stdout.splitlines()]


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (("sw",), ["sweep"]),
        (("simulate", "heavy-table-5"), ["heavy-table-550t"]),
        (("simulate", "bench", "--set", "meshes.g"), ["meshes.gap="]),
        (("simulate", "--set", "controller.equal"), ["controller.equaliser="]),
        (("machine", "new", "--preset", "linear"), ["linear-axis"]),
        (("fit", "bench", "a.csv", "--free", "table.J,meshes.ga"), ["table.J,meshes.gap"]),
        (("sweep", "bench", "--controller.K_v"), ["--controller.K_v"]),
        (("sweep", "--controller.K_v", "2:10:9", "--delt"), ["--delta"]),
    ],
)
def test_the_shell_completes_verbs_presets_and_keys(words: list[str], offered: list[str]) -> None:
    assert completed(*words) == offered


# --- in notebooks ---------------------------------------------------------------------------------


def test_a_run_draws_itself_and_a_machine_shows_itself() -> None:
    machine = Machine.load("bench")
    run = simulate(machine, parse_motion("move:0.1,v=1,a=20,end=0.2"))
    assert len(run.plot().axes) > 3
    machine.title = "a <b>old</b> one"
    shown = machine._repr_html_()
    assert "table.J" in shown
    assert "kg" in shown
    assert "a &lt;b&gt;old&lt;/b&gt; one" in shown


# --- few words ------------------------------------------------------------------------------------


def test_a_sweep_says_what_does_not_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All figures are the same in the digits shown, where the gap hardly changes."""
    monkeypatch.chdir(tmp_path)
    line = "sweep bench --meshes.gap 1mrad,1.0000000001mrad --motion move:0.1,v=1,a=20,end=0.3"
    done = CliRunner().invoke(main, line.split())
    assert done.exit_code == 0, done.output
    rows, _, steady = done.output.partition("do not change over the grid: ")
    assert "peak_error" in steady
    assert "mrad" in steady
    assert "peak_error" not in rows


def test_sentences_that_differ_in_numbers_alone_are_told_once() -> None:
    """Ten lines said that the angles of a rig come late, two for each part of its log."""
    names = [f"log[part={n}]" for n in range(1, 7)]
    late = [
        f"{name}: theta_c{k} lags theta_m by {30 + n}.{k} ms ({n} to 5e1 ms); --set time={n}ms"
        for n, name in enumerate(names)
        for k in (1, 2)
    ]
    others = ["a limit is off", "a limit is on", f"{names[1]}: it jitters"]
    told = once([*late, *others], names)
    assert len(told) == 2 + len(others)
    assert told[0] == (
        f"{late[0]}. The same, with numbers of their own, in {', '.join(names[1:4])} and 2 more"
    )
    assert "theta_c2" in told[1]
    assert told[2:] == others
    assert once([f"warning: {n}: 3 samples" for n in "ab"], "ab") == [
        "warning: a: 3 samples. The same, with numbers of their own, in b"
    ]


def test_warnings_of_a_kind_are_one_line() -> None:
    issues = {f"part {n}": Issue("gap", f"a pause of {n} s", (n,)) for n in range(1, 13)}
    assert _once("gap", issues) == (
        "part 1: gap: a pause of 1 s (row 1); gap in 11 more: part 2, part 3, part 4, ..."
    )
    assert _once("gap", {"one": Issue("gap", "a pause")}) == "one: gap: a pause"
