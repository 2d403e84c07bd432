"""What a torque of any course could still explain, on machines of the independent generator."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.generator import outside
from tests.blind.shown import ordered, records
from tests.blind.shown.ordered import Order
from tests.blind.shown.quiet import confronted, refitted

from dualdrive.diagnose import courses, free_torque
from dualdrive.diagnose.courses import Kind
from dualdrive.diagnose.free_torque import RARER_THAN, Course, courses_left
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.judge import AS_STRONG, Judgement, _with_course
from dualdrive.diagnose.loop import ClosedLoop
from dualdrive.diagnose.refit import Refit
from dualdrive.diagnose.result import Verdict


def with_outside(name: str, seed: int, share: float) -> Order:
    """A heavy table with a cause that no library has; share: of a strong one."""
    order = ordered.drifted("heavy", seed, 1.0)
    plans = order.plans[:1]
    hidden = outside.draw(name, records.setting(order.real, plans), seed, share)
    return Order(
        name, order.sheet, order.real, plans, order.recorder, {p.name: (hidden,) for p in plans}
    )


def courses_of(order: Order) -> list[Course]:
    return courses_left(*refitted(confronted(order)))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_nothing_is_seen_where_nothing_is_missing(seed: int) -> None:
    order = ordered.drifted("heavy", seed, 1.05)
    assert not courses_of(Order(**{**vars(order), "plans": order.plans[:1]}))


@pytest.mark.parametrize(
    ("name", "kind", "place"),
    [
        ("second_mass", "acceleration", "table"),
        ("gain_drift", "readings", "I_1"),
        ("cubic_damper", "speed", "table"),
    ],
)
def test_a_cause_that_no_library_has_is_seen_where_it_is(name: str, kind: str, place: str) -> None:
    found = courses_of(with_outside(name, 4, 0.3))
    strong = [(x.kind, x.place) for x in found if x.gain > AS_STRONG * found[0].gain]
    assert (kind, place) in strong


def test_a_pulse_tells_what_any_course_does() -> None:
    """The column of a sine at the table beside the same sine simulated: flanks stay closed."""
    order = ordered.drifted("bench", 0, 1.0)
    c = confronted(Order(**{**vars(order), "plans": order.plans[:1]}))
    _, base = refitted(c)
    height, turned = 0.02 * c.sizes()["torque"], 2.0 * np.pi * 6.0
    core = base.machine
    formula = f"{height!r} * sin({turned!r} * t)"
    core.add_expression("table", formula)
    there = c.left(core, base.u)
    assert there is not None
    columns = _columns(c, base, "table", turned / (2.0 * np.pi))
    for k, s in enumerate(c.series):
        moving, simulated = ~s.still, there[k] - base.left[k]
        foretold = height * columns[k][:, 0]
        off = np.linalg.norm((simulated - foretold)[moving]) / np.linalg.norm(simulated[moving])
        assert off < (0.15 if s.kind != "following error" else 0.3), s.name


def _columns(c: ClosedLoop, base: Refit, place: str, frequency: float) -> list[Any]:
    """Of a tone, per series: as `courses_left` makes them."""
    motions = {s.record: courses.motion_of(c, base, s.record) for s in c.series}
    answers = courses.answers_at(c, base, place, motions)
    assert answers is not None
    torques = {name: np.stack(courses._tone(frequency, m), axis=1) for name, m in motions.items()}
    return answers.to(torques, motions)


@pytest.mark.parametrize("begin", [0.0, -1000.0, 0.3, 1e6])
def test_the_middle_answer_does_not_care_when_a_record_begins(begin: float) -> None:
    """Pulses every 0.4 s of time itself; the machine moves in the second half of the record."""
    every, step, knots = 1e-3, 0.01, 40
    t = begin + every * np.arange(6000, dtype=np.float64)
    since = np.mod(t - knots // 2 * step, knots * step)
    change = np.exp(-since / 0.05)
    speed = np.where(np.arange(6000) < 3000, 0.0, 1.0)
    change[:3000] = 7.0  # sticks: of no account
    motion = courses.Motion(every, t, t, speed, t, {}, {})
    answer, early = courses._middle(motion, change, knots, step)
    assert len(answer) == pytest.approx(knots * step / every, abs=1)
    assert early == 2 * step / every
    assert answer[early + 51] == pytest.approx(np.exp(-1.0), abs=0.05)
    assert np.argmax(answer[early - 3 :]) in (2, 3, 4), "the pulse is where it is said to be"


def judgement(verdict: Verdict, *effects: tuple[str, str]) -> Judgement:
    leader = SimpleNamespace(hypothesis=Hypothesis(effects))
    ranked: Any = [(leader, 0.95)] if effects else []
    return Judgement(verdict, ranked, 0.0, (), 0.9, (2.0, 1.0), 500.0)


def with_course(judged: Judgement, kind: Kind, place: str, chance: float) -> Judgement:
    found: Any = SimpleNamespace(base=None)
    rare = chance < RARER_THAN
    told = [Course(kind, place, 90.0, 8, chance)] if rare else []
    return _with_course(found, judged, lambda _: told)


@pytest.mark.parametrize("verdict", ["adequate", "parameters"])
def test_what_no_law_explains_is_unknown_where_nothing_has_a_name(verdict: Verdict) -> None:
    found = with_course(judgement(verdict), "readings", "I_1", RARER_THAN - 0.1)
    assert found.verdict == "unknown"
    assert found.course is not None
    assert with_course(judgement(verdict), "readings", "I_1", RARER_THAN + 0.1).verdict == verdict


def test_a_name_that_is_not_all_stays_one() -> None:
    named = judgement("effect", ("coulomb", "table"))
    found = with_course(named, "time", "motor_1", -9.0)
    assert (found.verdict, found.why) == ("effect", "")
    assert found.course is not None
    assert with_course(named, "time", "motor_1", -1.0).course is None


def test_a_friction_that_leaves_a_torque_over_the_same_speed_is_not_the_law() -> None:
    found = with_course(judgement("effect", ("hydrostatic_drag", "table")), "speed", "table", -9.0)
    assert (found.verdict, found.why) == ("unknown", "shape")
    elsewhere = judgement("effect", ("hydrostatic_drag", "motor_2"))
    assert with_course(elsewhere, "speed", "table", -9.0).verdict == "effect"
    no_friction = judgement("effect", ("unbalance", "table"))
    assert with_course(no_friction, "speed", "table", -9.0).verdict == "effect"
    two = judgement("effect", ("hydrostatic_drag", "table"), ("cogging", "motors"))
    assert with_course(two, "speed", "table", -9.0).verdict == "effect"


def test_chances_are_those_of_noise() -> None:
    """Log10 of the tail of chi-squared, and the single number that is as rare."""
    assert free_torque._log_chance(30.0, 4) == pytest.approx(np.log10(chi2.sf(30.0, 4)))
    sums = [free_torque._log_chance(x, 4) for x in (1.3e3, 1.45e3, 1.5e3, 1.7e3, 1e5)]
    assert sums == sorted(sums, reverse=True), "beyond the smallest number, too"
    assert np.all(np.isfinite(sums))
