"""The scorer on answers written by hand, and the runner on a diagnosis that knows nothing."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind import run, score
from tests.blind.generator import suite
from tests.blind.scoring import figures, match, text
from tests.blind.scoring.figures import Judged


def label(group: str, *hidden: tuple[str, str, str], **more: Any) -> dict[str, Any]:
    effects = [
        {"effect": e, "place": p, "equation": q, "parameters": {"phase": 3.0}} for e, p, q in hidden
    ]
    own = {"case": "case-0000", "group": group, "family": "bench", "mode": "closed_loop"}
    return {**own, "effects": effects, "floor": 0.02, "real": {}, "sheet": {}, **more}


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
    pair["with"] = [{"effect": "cogging", "place": "motors"}]
    case = Judged(label("single", FRICTION), {"verdict": "effect", "candidates": [pair]}, 1.0)
    assert not case.top(1)
    assert case.top(3)
    both = Judged(label("two", FRICTION, ("cogging", "motors", "drive")), case.answer, 1.0)
    assert both.top(1)


def test_shares_count_what_they_say() -> None:
    cases = [
        Judged(label("none"), answer("adequate"), 1.0),
        Judged(label("drifted"), answer("parameters"), 1.0),
        Judged(label("drifted"), answer("unknown"), 1.0),
        Judged(label("single", FRICTION), answer("effect", ("coulomb", "motors", 0.9)), 1.0),
        Judged(label("single", FRICTION), answer("effect", ("viscous", "table", 0.6)), 1.0),
        Judged(label("outside", ("chirp", "table", "table")), answer("unknown"), 1.0),
        Judged(label("single", FRICTION), {}, 1.0, failed="Traceback\nValueError: no"),
    ]
    made = figures.naming(cases)
    assert made["false alarms"]["hits"] == 1
    assert made["false alarms"]["of"] == 3
    assert made["top-1, effect and place"]["share"] == pytest.approx(1 / 3)
    assert made["unknown, recall"]["share"] == 1.0
    assert made["unknown, wrongly used"]["hits"] == 1
    assert made["unknown, wrongly used"]["of"] == 6
    assert made["failed"]["hits"] == 1
    assert figures.trust(cases)["Brier"] == pytest.approx((0.1**2 + 0.6**2) / 2)
    assert figures.confusion(cases)["coulomb"] == {"coulomb": 1, "viscous": 1, "(failed)": 1}
    assert len(figures.failures(cases)) == 3
    assert "ValueError: no" in text.page(figures.everything(cases))


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
    """Bench, ratio 10: a pinion 1 kg m^2 heavier than its sheet is a motor 0.01 heavier."""
    own = label("drifted", real={"motors.J": 0.5, "pinions.J": 3.0})
    own["sheet"] = {"motors.J": 0.4, "pinions.J": 2.0}
    assert match.real_numbers(own, {"motors.J": 0}) == pytest.approx({"motors.J": 0.51})
    assert match.real_numbers(own, {"pinions.J": 0}) == pytest.approx({"pinions.J": 13.0})
    both = {"motors.J": 0, "pinions.J": 0}
    assert match.real_numbers(own, both) == own["real"]


def test_held_out_error_is_over_the_known_floor() -> None:
    error = {"held_out_best": 0.022, "held_out_refitted": 0.06}
    cases = [Judged(label("single", FRICTION), answer("effect", error=error), 1.0)]
    made = figures.errors(cases)
    assert made["held-out error over floor"]["median"] == pytest.approx(1.1)
    assert made["gap closed"]["median"] == pytest.approx(0.95)


def test_equations_by_their_members() -> None:
    assert match.right_equation("motor_1", label("single", FRICTION))
    assert not match.right_equation("table", label("single", FRICTION))
    assert match.right_equation("mesh_2", label("single", ("wear", "table", "mesh")))


def test_a_suite_is_written_run_and_judged(tmp_path: Path) -> None:
    """Four cases; taken up again they are left alone; the answer never meets the label."""
    orders = [
        (0, "single", ("coulomb",)),
        (1, "none", ()),
        (2, "outside", ()),
        (3, "two", ("cogging", "viscous")),
    ]
    suite.generate(tmp_path / "suite", "dev", orders, share=0.3, tell=lambda _: None)
    cases = tmp_path / "suite" / "cases"
    assert sorted(f.name for f in (cases / "case-0000").iterdir()) == [
        *("case.json", "fast.csv", "machine.toml", "slow.csv")
    ]
    said = ["--cases", str(cases), "-o", str(tmp_path / "out"), "--jobs", "1"]
    assert run.main([*said, "--with", "tests.blind.stub:diagnose", "--shard", "1/2"]) == 0
    results = tmp_path / "out"
    before = {f.name: f.stat().st_mtime_ns for f in results.iterdir()}
    assert sorted(before) == ["case-0000.json", "case-0002.json"]
    assert run.main([*said, "--with", "tests.blind.stub:diagnose"]) == 0
    after = {f.name: f.stat().st_mtime_ns for f in results.iterdir()}
    assert len(after) == 4
    assert all(after[name] == time for name, time in before.items())
    known = json.loads((cases / "case-0000" / "case.json").read_text())
    assert set(known) == {"machine", "records", "settings"}
    judged = score.judged(tmp_path / "suite", [results])
    assert {c.group for c in judged} == {"single", "none", "outside", "two"}
    assert "4 cases" in text.page(figures.everything(judged))


def test_a_case_whose_process_dies_is_recorded(tmp_path: Path) -> None:
    (tmp_path / "case-0000").mkdir()
    (tmp_path / "case-0000" / "case.json").write_text("{}")
    task = run.Task(tmp_path / "case-0000", tmp_path / "r.json", 1.0, "os:abort")
    assert run.run([task], budget=60, jobs=1, tell=lambda _: None) == 0
    assert "failed" in json.loads((tmp_path / "r.json").read_text())
