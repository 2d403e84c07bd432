"""Ctrl-C in a diagnosis or an improvement ends it early, keeps what is known, says what was cut."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from dualdrive.diagnose import Diagnosis, diagnose, improve
from patience import PATIENCE
from recorded import demo, sheet
from terminal import Terminal

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.generator import machines
from tests.blind.shown import ordered
from tests.blind.shown.ordered import Order

BUDGET = 6.0 * PATIENCE  # no test below waits for it
long = pytest.mark.skipif("SHOWN" not in os.environ, reason="needs a core of its own: SHOWN=1")


@cache
def hidden() -> Order:
    """A machine of the blind generator that rubs where its sheet says nothing; one record."""
    return ordered.hiding("coulomb", "heavy", 0, 0.1, count=1)


class Watched:
    """Progress, with Ctrl-C pressed at the first line that holds these words."""

    def __init__(self, words: str) -> None:
        self.words, self.lines, self.after = words, list[str](), list[str]()

    def __call__(self, line: str) -> None:
        if self.pressed:
            self.after.append(line)
        self.lines.append(line)
        if self.words in line and not self.after and self.count(self.words) == 1:
            signal.raise_signal(signal.SIGINT)

    def count(self, words: str) -> int:
        return sum(words in line for line in self.lines)

    @property
    def pressed(self) -> bool:
        return self.count(self.words) > 0


@pytest.fixture(autouse=True)
def _ctrl_c_as_usual() -> Any:
    """Whatever the shell that runs these tests lets its children ignore."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def cut(found: Diagnosis) -> list[str]:
    """Everything that is said to be left undone."""
    return [*found.cut, *(c.note for c in found.candidates if "cut by" in c.note)]


def test_who_stops_a_balance_waits_for_no_comparison() -> None:
    """Its error is told, and neither pairs nor a comparison and its noise floor are begun."""
    watched = Watched("refitting")
    records = {"fit": demo("fit").between(0.0, 8.0)}
    found = diagnose(sheet(), records, mode="balance", experiment=False, progress=watched)
    assert watched.pressed
    assert found.verdict == "unfinished"
    assert found.before is None
    assert math.isfinite(found.error["refitted"])
    assert math.isnan(found.error["noise_floor"])
    assert not any(" + " in line for line in watched.after)


@pytest.mark.parametrize(
    "words",
    [
        pytest.param("as it stands", marks=long),
        pytest.param("refitting the data sheet", marks=long),
        pytest.param("score tests", marks=long),
        pytest.param("refitting with", marks=long),
    ],
)
def test_ctrl_c_ends_a_diagnosis_with_what_is_known(words: str) -> None:
    order, told = hidden(), Watched(words)
    found = diagnose(
        order.machine(), order.traces(), settings=order.settings(), budget=BUDGET, progress=told
    )
    assert told.pressed, told.lines
    assert not any("refitting with" in line for line in told.after[2:]), told.after
    assert found.error["nominal"] > 0
    assert found.refitted is not None
    assert cut(found), (found.verdict, found.paragraph)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize(
    "words",
    [
        pytest.param("score tests", marks=long),
        pytest.param("holding the machine", marks=long),
    ],
)
def test_ctrl_c_ends_an_improvement_with_the_steps_so_far(words: str) -> None:
    order, told = hidden(), Watched(words)
    try:
        ladder = improve(
            order.machine(), order.traces(), settings=order.settings(), budget=BUDGET, progress=told
        )
    except KeyboardInterrupt:
        pytest.fail("Ctrl-C lost every step")
    assert told.pressed, told.lines
    assert ladder.steps[0].label == "nominal"
    assert len(ladder.diagnoses) == 1, "another diagnosis began after Ctrl-C"
    assert "by hand" in ladder.stopped
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


# --- as a user does it ----------------------------------------------------------------------------


def handed_out(folder: Path) -> list[str]:
    """The user's files; arguments that name them."""
    order = hidden()
    (folder / "machine.toml").write_text(machines.text(order.sheet, "table"))
    for name, trace in order.traces().items():
        trace.to_csv(folder / f"{name}.csv")
    sets = [
        f"--set-for={name}:{path}={value!r}"
        for name, own in order.settings().items()
        for path, value in own.items()
    ]
    return ["machine.toml", *(f"{name}.csv" for name in order.traces()), *sets]


def interrupted(verb: str, words: str, folder: Path) -> tuple[Mapping[str, Any], str]:
    """Figures and output of a verb on which Ctrl-C was pressed at those words."""
    asked = [verb, *handed_out(folder), "--budget", f"{BUDGET:g}", "--json", "found.json"]
    terminal = Terminal(asked, folder)
    terminal.wait_for(words)
    terminal.ctrl_c()
    status, out = terminal.end()
    assert status == 130, terminal.screen
    assert "Traceback" not in terminal.screen
    assert "Ctrl-C again ends at once" in terminal.screen
    return json.loads((folder / "found.json").read_text()), out


@long
def test_ctrl_c_on_dualdrive_diagnose(tmp_path: Path) -> None:
    figures, out = interrupted("diagnose", "score tests", tmp_path)
    assert figures["error"]["nominal"] > 0
    assert figures["cut"]
    assert f"Skipped: {figures['cut'][0][:40]}" in out


@long
def test_ctrl_c_on_dualdrive_improve(tmp_path: Path) -> None:
    figures, out = interrupted("improve", "score tests", tmp_path)
    assert [step["label"] for step in figures["steps"][:2]] == ["nominal", "refitted"]
    assert "by hand" in figures["stopped"]
    assert f"stopped: {figures['stopped']}" in out
