"""The diagnosis on records that allow no answer, and on a rig's whose answer is published.

On the demo's, whose answer is known: test_demo_story.py.
"""

from __future__ import annotations

import re
import time
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from dualdrive import Machine
from dualdrive.diagnose import Ladder, diagnose, improve
from dualdrive.replay import core_of
from dualdrive.traces import Trace, read
from measured import emps

DEMO = files("dualdrive.demo")
ROOT = Path(__file__).resolve().parents[2]


def demo() -> tuple[Machine, Trace]:
    return Machine.load(str(DEMO / "machine.toml")), read(str(DEMO / "fit.csv"))


def test_a_short_budget_says_what_it_cut() -> None:
    machine, trace = demo()
    cut = diagnose(machine, trace, budget=0.5, experiment=False, checks=False)
    assert (cut.verdict, cut.best, cut.command) == ("unfinished", None, "")
    assert cut.cut


def test_a_search_of_a_balance_that_was_cut_is_no_answer_either() -> None:
    """It said "something is missing that no effect explains" before any of them was tried."""
    machine = Machine.load(str(ROOT / "examples" / "emps.toml"))
    cut = diagnose(machine, emps(), mode="balance", budget=0.01, experiment=False, checks=False)
    assert (cut.verdict, cut.best, cut.command, cut.groups) == ("unfinished", None, "", [])
    assert cut.cut
    assert "no effect of the library" not in cut.paragraph
    assert "stopped before every law had its turn" in cut.paragraph


@pytest.mark.long
def test_no_search_reads_a_clock_unless_it_is_told_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer on which every look at the clock takes an hour finds the very same."""
    machine, trace = clean_axis()
    asked = {"mode": "balance", "experiment": False, "checks": False, "tolerance": 1.0}
    usual = diagnose(machine, trace, **asked)  # type: ignore[arg-type]
    hours = iter(range(0, 10**9, 3600))
    monkeypatch.setattr(time, "monotonic", lambda: float(next(hours)))
    slow = diagnose(machine, trace, **asked)  # type: ignore[arg-type]
    known, found = ({**d.figures(), "seconds": None} for d in (usual, slow))
    assert found == known
    assert usual.verdict != "unfinished"


def clean_axis() -> tuple[Machine, Trace]:
    """A stretch of the linear axis: the search has a law to find."""
    machine = Machine.load(str(ROOT / "examples" / "emps.toml"))
    return machine, emps().between(0.0, 4.0)


# --- records that allow no answer ----------------------------------------------------------------


def unfit(change: str) -> tuple[Machine, Trace]:
    machine, trace = demo()
    if change == "still":
        flat = {name: np.full(len(trace), float(trace[name][0])) for name in trace}
        return machine, Trace(trace.t, flat)
    if change == "short":
        return machine, trace.between(0.0, 0.3)
    if change == "swapped":
        return machine, trace.with_channel("I_1", trace["theta_1"]).with_channel(
            "theta_1", trace["I_1"]
        )
    if change == "flipped":
        return machine, trace.with_channel("I_1", -trace["I_1"]).with_channel("I_2", -trace["I_2"])
    if change == "clipped":
        half = 0.3 * float(np.max(np.abs(trace["I_1"])))
        return machine, trace.with_channel("I_1", np.clip(trace["I_1"], -half, half))
    assert change == "foreign"
    return machine, trace.with_channel("theta_1", 0.37 * trace["theta_1"]).with_channel(
        "theta_2", 0.37 * trace["theta_2"]
    )


def test_what_the_loop_says_stands_where_the_records_allow_no_balance() -> None:
    """Another controller than the recorded one, and too short a motion: it ended with an error."""
    machine, trace = demo()
    machine.set("controller.k_p", 0.7 * core_of(machine).get("controller.k_p"))
    own = trace.between(0.0, 4.0)
    with pytest.raises(ValueError, match="no motion between standstills that outlasts"):
        diagnose(machine, own, mode="balance", experiment=False)
    told: list[str] = []
    found = diagnose(machine, own, effort="quick", experiment=False, progress=told.append)
    assert told[-1] == "the torque balance"
    counts = [int(m[1]) for m in (re.search(r", (\d+) replays", line) for line in told) if m]
    assert counts == sorted(set(counts))
    steps = np.diff(counts)
    assert np.all(steps >= 20)
    assert counts[-1] <= found.effort["replays"]
    assert (found.verdict, found.mode) == ("unknown", "closed_loop")


@pytest.mark.parametrize("change", ["still", "short", "swapped", "flipped", "foreign"])
def test_a_spoilt_record_gets_words_and_no_name(change: str) -> None:
    machine, trace = unfit(change)
    judged = diagnose(machine, trace, budget=8.0, experiment=False)  # whatever it cuts
    assert judged.warnings, change
    assert judged.verdict not in ("effect", "ambiguous")
    assert judged.best is None
    assert not judged.command


@pytest.mark.long
def test_a_clipped_channel_is_told_and_counts_for_little() -> None:
    """What the other channels show is still named: 12 kN*m of dry friction."""
    machine, trace = unfit("clipped")
    judged = diagnose(machine, trace, effort="quick", experiment=False)
    assert any("I_1 stands at" in warning for warning in judged.warnings)
    assert judged.verdict == "effect"
    assert judged.best is not None
    assert judged.best.label == "coulomb@table"
    assert judged.best.parameters["coulomb@table.torque"].value == pytest.approx(12000.0, rel=0.01)


def test_options_are_refused_by_name() -> None:
    machine, trace = demo()
    with pytest.raises(ValueError, match="mode = 'guess'"):
        diagnose(machine, trace, mode="guess")
    with pytest.raises(ValueError, match="no trace slow"):
        diagnose(machine, {"fast": trace}, settings={"slow": {"controller.T_ten": 0.0}})


# --- data nobody here made -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def climbed() -> tuple[Ladder, list[str]]:
    """What comes of the axis of A. Janot et al. 2019 without its dry friction; what was told."""
    machine = Machine.load(str(ROOT / "examples" / "emps.toml"))
    told: list[str] = []
    fitted, unseen = emps().between(0.0, 7.0), {"later": emps().between(7.0, 14.0)}
    return improve(machine, fitted, unseen, mode="balance", progress=told.append), told


@pytest.fixture
def ladder(climbed: tuple[Ladder, list[str]]) -> Ladder:
    return climbed[0]


def test_a_search_of_a_balance_tells_what_is_best_so_far(
    climbed: tuple[Ladder, list[str]],
) -> None:
    """Before it ends: the law that is named in the end, and how little it leaves."""
    found, told = climbed
    first = told[: next(k for k, line in enumerate(told) if "held out" in line)]
    leaders = [line.partition("; best so far ")[2] for line in first if "best so far" in line]
    label, left = leaders[-1].split(", ")
    assert label == found.steps[2].label.removeprefix("+ ")
    fallen = found.steps[2].fitted / found.steps[1].fitted
    assert float(left.split()[0]) == pytest.approx(100.0 * fallen, rel=0.3)


def test_emps_is_named_without_being_told(ladder: Ladder) -> None:
    """Fc 20.39 N is what the rigid model without dry friction lacks."""
    assert ladder.steps[2].label == "+ coulomb@table"
    assert ladder.steps[1].held_out > 0.15
    assert ladder.steps[2].held_out < 0.06
    assert ladder.steps[2].machine.core.get("coulomb@table.torque") == pytest.approx(20.39, rel=0.1)


def test_a_friction_along_a_short_way_yields_to_the_plain_one(ladder: Ladder) -> None:
    """A quarter of a metre of travel: a law of the position is a constant and a slope there."""
    found = ladder.diagnoses[0]
    assert found.candidates[0].label == "coulomb@table"
    assert "angle_dependent_friction@table" in found.paragraph, "it can not be excluded"
