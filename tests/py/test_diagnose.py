"""The diagnosis on records whose answer is known, and on records that allow no answer.

That nothing is left once the effect is in: test_demo_story.py.
"""

from __future__ import annotations

import contextlib
import io
import json
import runpy
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine
from dualdrive.diagnose import Diagnosis, Ladder, diagnose, improve
from dualdrive.traces import Trace, read
from measured import emps

DEMO = files("dualdrive.demo")
ROOT = Path(__file__).resolve().parents[2]
TRUTH = tomllib.loads((Path(__file__).parent / "demo_truth.toml").read_text())


def demo() -> tuple[Machine, Trace]:
    return Machine.load(str(DEMO / "machine.toml")), read(str(DEMO / "fit.csv"))


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The names that examples/02_a_missing_effect.py leaves, and as `printed` what it prints.

    Run in this process: its diagnosis is the one that is looked at here.
    """
    folder, printed = tmp_path_factory.mktemp("example"), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        names = runpy.run_path(str(ROOT / "examples" / "02_a_missing_effect.py"))
    assert not list(folder.iterdir()), "an example leaves nothing behind"
    return {**names, "printed": printed.getvalue()}


@pytest.fixture(scope="module")
def found(example: dict[str, Any]) -> Diagnosis:
    diagnosis: Diagnosis = example["found"]
    return diagnosis


def test_the_example_says_what_is_missing(example: dict[str, Any]) -> None:
    assert "coulomb@table" in example["printed"]
    assert "nan" not in example["printed"].lower()


def test_the_hidden_friction_has_its_name(found: Diagnosis) -> None:
    assert found.candidates[0].label == "coulomb@table"
    assert found.verdict in ("effect", "ambiguous")
    assert found.equation is not None
    assert found.equation.name == "table"
    hidden = TRUTH["effect"]["torque"]
    torque = found.candidates[0].parameters["coulomb@table.torque"]
    assert torque.low <= 1.02 * hidden
    assert torque.high >= 0.98 * hidden


def test_the_error_falls_to_the_floor(found: Diagnosis) -> None:
    error = found.error
    assert error["nominal"] > 0.15
    assert error["refitted"] > 0.15
    assert error["best"] < 1.2 * error["noise_floor"]
    assert error["held_out_best"] < 0.5 * error["held_out_refitted"]


def test_it_says_so_in_words_and_gives_the_command(found: Diagnosis) -> None:
    assert "coulomb@table" in found.paragraph
    assert found.command.startswith("dualdrive add MACHINE coulomb@table --set torque=")


def test_the_figures_are_plain_json(found: Diagnosis) -> None:
    text = json.dumps(found.figures(), allow_nan=False)
    assert json.loads(text)["verdict"] == found.verdict


def test_a_short_budget_says_what_it_cut() -> None:
    machine, trace = demo()
    cut = diagnose(machine, trace, budget=0.5, experiment=False, checks=False)
    assert cut.cut
    assert cut.verdict != "effect"


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


@pytest.mark.parametrize("change", ["still", "short", "swapped", "flipped", "clipped", "foreign"])
def test_a_spoilt_record_gets_words_and_no_name(change: str) -> None:
    machine, trace = unfit(change)
    judged = diagnose(machine, trace, budget=8.0, experiment=False)  # whatever it cuts
    assert judged.warnings, change
    assert judged.verdict not in ("effect", "ambiguous")
    assert judged.best is None
    assert not judged.command


def test_options_are_refused_by_name() -> None:
    machine, trace = demo()
    with pytest.raises(ValueError, match="mode = 'guess'"):
        diagnose(machine, trace, mode="guess")
    with pytest.raises(ValueError, match="no trace slow"):
        diagnose(machine, {"fast": trace}, settings={"slow": {"controller.T_ten": 0.0}})


# --- data nobody here made -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def ladder() -> Ladder:
    """What comes of the axis of A. Janot et al. 2019, whose dry friction is left out."""
    machine = Machine.load(str(ROOT / "examples" / "emps.toml"))
    return improve(machine, emps(), mode="balance", budget=600.0)


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
