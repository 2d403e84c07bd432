"""The scorer on answers written by hand, and the runner on a diagnosis that knows nothing."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind import run, score
from tests.blind.generator import cases, machines, motions, stored
from tests.blind.generator.records import Plan
from tests.blind.scoring import diagram, figures, match, text
from tests.blind.scoring.figures import Judged


def truth(group: str, *hidden: tuple[str, str, str], **more: Any) -> dict[str, Any]:
    effects = [
        {"effect": e, "place": p, "equation": q, "family": "friction", "parameters": {"phase": 3.0}}
        for e, p, q in hidden
    ]
    own: dict[str, Any] = {
        "case": "develop-00000",
        "group": group,
        "loop": "known",
        "effects": effects,
    }
    own |= {"floor": 0.02, "real": {}, "sheet": {}, "machine": {"gearboxes.ratio": 10.0}}
    own |= {"detectability": 500.0, "told": 40.0, "rival": "none"} if hidden else {}
    traits = {"colour": "pink", "drives": 2, "rate": 1000, "sampled": False}
    record = {"motion": "chirp", "hunts": False}
    return {**own, "traits": traits, "records": {"chirp_1": record}, **more}


def answer(verdict: str, *named: tuple[str, str, float], **more: Any) -> dict[str, Any]:
    candidates = [
        {"effect": e, "place": p, "probability": q, "parameters": {}} for e, p, q in named
    ]
    return {"verdict": verdict, "candidates": candidates, **more}


FRICTION = ("coulomb", "pinions", "drive")


def test_motor_and_pinion_are_one_body_and_the_ring_is_the_tables() -> None:
    assert match.same_place("coulomb", "motors", "pinions")
    assert match.same_place("eccentricity", "ring", "table")
    assert not match.same_place("coulomb", "motor_1", "motor_2")
    assert not match.same_place("coulomb", "motors", "table")
    assert not match.same_place("sensor_delay", "theta_1", "theta_m")


def test_a_pair_is_no_single_effect_but_holds_it() -> None:
    pair = {"effect": "coulomb", "place": "motors", "probability": 0.9}
    pair["label"] = "coulomb@motors + cogging@motors"
    case = Judged(truth("single", FRICTION), {"verdict": "effect", "candidates": [pair]}, 1.0)
    assert not case.top(1)
    assert case.top(3)
    both = Judged(truth("pair", FRICTION, ("cogging", "motors", "drive")), case.answer, 1.0)
    assert both.top(1)


def test_shares_count_what_they_say() -> None:
    unknown = truth("empty", loop="unknown")
    judged = [
        Judged(truth("empty"), answer("adequate"), 1.0),
        Judged(truth("drifted"), answer("parameters"), 1.0),
        Judged(unknown, answer("unknown"), 1.0),
        Judged(truth("single", FRICTION), answer("effect", ("coulomb", "motors", 0.9)), 1.0),
        Judged(truth("single", FRICTION), answer("effect", ("viscous", "table", 0.6)), 1.0),
        Judged(truth("single", FRICTION, told=3.0), answer("unfinished"), 1.0),
        Judged(truth("outside", ("chirp", "table", "table")), answer("unknown"), 1.0),
        Judged(truth("single", FRICTION), {}, 1.0, failed="Traceback\nValueError: no"),
    ]
    alarms, naming = figures.alarms(judged), figures.naming(judged)
    assert (alarms["false alarms"]["hits"], alarms["false alarms"]["of"]) == (1, 3)
    assert alarms["false alarms, loop unknown"]["share"] == 1.0
    assert alarms["false alarms, loop known"]["hits"] == 0
    assert naming["top-1 and place"]["share"] == pytest.approx(1 / 4)
    assert naming["top-1 where the record tells"]["of"] == 3
    assert naming["unknown, recall"]["share"] == 1.0
    assert (naming["unknown, wrongly used"]["hits"], naming["unknown, wrongly used"]["of"]) == (
        1,
        7,
    )
    assert naming["cut"]["hits"] == 1
    assert naming["failed"]["hits"] == 1
    assert figures.trust(judged)["Brier"] == pytest.approx((0.1**2 + 0.6**2) / 2)
    coulomb = {"coulomb": 1, "viscous": 1, "(unfinished)": 1, "(failed)": 1}
    assert figures.confusion(judged)["coulomb"] == coulomb
    assert figures.split(judged)["motion"]["chirp"]["hits"] == 4
    assert figures.split(judged)["family"]["friction"]["of"] == 4
    assert len(figures.failures(judged)) == 4
    assert "ValueError: no" in text.page(figures.everything(judged))


def test_wilson_interval() -> None:
    """0 of 300 leaves 1.3 % (Wilson 1927: z^2 / (n + z^2))."""
    row = figures.share([False] * 300)
    assert row["high"] == pytest.approx(1.96**2 / (300 + 1.96**2))


def test_intervals_of_angles_go_round() -> None:
    near_pi = {"low": math.pi - 0.2, "high": math.pi + 0.2}
    assert match.covered("phase", near_pi, -math.pi + 0.1)
    assert not match.covered("phase", near_pi, 0.0)
    assert not match.covered("torque", {"low": 1.0, "high": 2.0}, 2.1)


def test_motor_and_pinion_show_as_one_inertia() -> None:
    """Ratio 10: a pinion 1 kg m^2 heavier than its sheet is a motor 0.01 heavier."""
    own = truth("drifted", real={"motors.J": 0.5, "pinions.J": 3.0})
    own["sheet"] = {"motors.J": 0.4, "pinions.J": 2.0}
    assert match.real_numbers(own, {"motors.J": 0}) == pytest.approx({"motors.J": 0.51})
    assert match.real_numbers(own, {"pinions.J": 0}) == pytest.approx({"pinions.J": 13.0})
    both = {"motors.J": 0, "pinions.J": 0}
    assert match.real_numbers(own, both) == own["real"]


def test_held_out_error_is_over_the_known_floor() -> None:
    error = {"held_out_best": 0.022}
    judged = [Judged(truth("single", FRICTION), answer("effect", error=error), 1.0)]
    assert figures.errors(judged)["held-out error over floor"]["median"] == pytest.approx(1.1)


def test_equations_by_their_members() -> None:
    assert match.right_equation("motor_1", truth("single", FRICTION))
    assert not match.right_equation("table", truth("single", FRICTION))
    assert match.right_equation("mesh_2", truth("single", ("wear", "table", "mesh")))


def test_reliability_is_drawn(tmp_path: Path) -> None:
    rows = figures.reliability([(0.1, False), (0.15, True), (0.9, True), (1.0, True)])
    assert [row["from"] for row in rows] == [0.0, 0.8, 0.95]
    assert rows[0]["claimed"] == pytest.approx(0.125)
    assert rows[0]["share"] == 0.5
    diagram.draw(rows, tmp_path / "reliability.png")
    assert (tmp_path / "reliability.png").read_bytes()[:4] == b"\x89PNG"


def written(folder: Path, form: str = "csv") -> Path:
    """One case of a folder, a few samples long."""
    numbers = machines.draw(np.random.default_rng(1)) | {"controller.T_ten": 0.5}
    still = motions.Motion("moves", np.zeros((2, 4)), 1e-3, 2e-3)
    plan = Plan("moves_1", still, 1e-3, 0.0, 0.5)
    columns = {"t": np.arange(3) * 1e-3, "theta_m": np.array([0.0, 1e-3, 2e-3])}
    machine = machines.text(numbers, "case")
    label = truth("single", FRICTION)
    case = cases.Case("develop-00000", machine, (plan,), {"moves_1": columns}, form, label)
    stored.write(case, folder / "cases" / case.name)
    (folder / "truth").mkdir(parents=True, exist_ok=True)
    (folder / "truth" / f"{case.name}.json").write_text(json.dumps(label))
    return folder / "cases" / case.name


@pytest.mark.parametrize("form", cases.FORMS)
def test_a_record_is_read_as_it_was_meant(tmp_path: Path, form: str) -> None:
    from dualdrive.traces import read

    folder = written(tmp_path, form)
    known = json.loads((folder / "case.json").read_text())
    trace = read(str(folder / known["records"][0]))
    assert trace.t == pytest.approx([0.0, 1e-3, 2e-3])
    assert trace["theta_m"] == pytest.approx([0.0, 1e-3, 2e-3])
    assert "truth" not in " ".join(str(path) for path in folder.iterdir())


STUB = """
import json, sys
files, out = sys.argv[1:], sys.argv[sys.argv.index("--json") + 1]
assert "--set-for" in files and "moves_1.csv:controller.T_ten=0.5" in files, files
if "--dies" in files:
    sys.exit("no such machine")
candidate = {"effect": "coulomb", "place": "motors", "probability": 0.4, "parameters": {}}
json.dump({"verdict": "effect", "candidates": [candidate]}, open(out, "w"))
"""


def test_a_folder_is_run_taken_up_again_and_scored(tmp_path: Path) -> None:
    written(tmp_path)
    (tmp_path / "stub.py").write_text(STUB)
    said = [str(tmp_path), "--jobs", "1", "--with", f"{sys.executable} {tmp_path / 'stub.py'}"]
    assert run.main([*said, "-o", str(tmp_path / "dead"), "--", "--dies"]) == 0
    assert score.judged(tmp_path, tmp_path / "dead")[0].failed == "exit 1: no such machine"
    assert run.main(said) == 0
    result = tmp_path / "results" / "develop-00000.json"
    before = result.stat().st_mtime_ns
    assert run.main(said) == 0
    assert result.stat().st_mtime_ns == before
    judged = score.judged(tmp_path, tmp_path / "results")
    assert [case.top(1) for case in judged] == [True]
    page = tmp_path / "figures.json"
    assert score.main([str(tmp_path), "--json", str(page), "--plot", str(tmp_path / "r.png")]) == 0
    assert json.loads(page.read_text())["naming"]["top-1"]["hits"] == 1
