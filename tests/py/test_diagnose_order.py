"""What is refitted when: a leader far ahead gets its partners first, the hopeless wait."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from dualdrive import Machine
from dualdrive.diagnose import pairs, shortlist
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.shortlist import Shortlist
from dualdrive.diagnose.survey import key_of
from dualdrive.diagnose.work import Clock, Work


def of(label: str, cost: float) -> Any:
    effect, _, place = label.partition("@")
    return SimpleNamespace(hypothesis=Hypothesis(((effect, place),)), cost=cost)


@pytest.fixture
def listed(monkeypatch: pytest.MonkeyPatch) -> Shortlist:
    """With a machine that costs 1000 as it is; costs are given, not computed."""
    monkeypatch.setattr(shortlist, "profile", lambda _, refit: refit.cost)
    fitter: Any = SimpleNamespace(evidence=None)
    none: Any = SimpleNamespace(cost=1000.0)
    return Shortlist(fitter, none, none, Work(Clock(math.inf)))


def test_a_leader_is_far_ahead_where_all_other_laws_gain_little(listed: Shortlist) -> None:
    leader, other = of("current_limit@motors", 200.0), of("cogging@motors", 900.0)
    assert listed.far_ahead(leader, [leader, other])
    near = of("dead_time@motors", 600.0)
    assert not listed.far_ahead(leader, [leader, other, near])


def test_the_same_law_elsewhere_is_no_rival_of_a_leader(listed: Shortlist) -> None:
    leader, part = of("current_limit@motors", 200.0), of("current_limit@motor_1", 500.0)
    assert listed.far_ahead(leader, [leader, part])


def test_a_leader_that_gains_next_to_nothing_is_not_ahead(listed: Shortlist) -> None:
    assert not listed.far_ahead(of("cogging@motors", 990.0), [of("unbalance@table", 1000.0)])


def test_what_gains_half_as_much_may_be_the_first_of_a_pair_too() -> None:
    base = SimpleNamespace(hypothesis=Hypothesis())
    several = [
        of("coulomb@table", 0.0),
        of("stribeck@table", 10.0),  # contains the first
        of("cogging@motors", 400.0),
        of("viscous@motors", 600.0),
    ]
    criterion = {key_of(r): r.cost for r in several} | {key_of(base): 1000.0}  # type: ignore[arg-type]
    found: Any = SimpleNamespace(base=base, criterion=criterion)
    chosen = pairs._firsts(found, several)
    assert [r.hypothesis.label for r in chosen] == ["coulomb@table", "cogging@motors"]
    criterion["cogging@motors"] = 501.0
    assert [r.hypothesis.label for r in pairs._firsts(found, several)] == ["coulomb@table"]


@pytest.mark.parametrize(
    ("first", "second", "again"),
    [
        ("transmission_error@pinions", "transmission_error@pinion_2", True),
        ("transmission_error@pinions", "transmission_error@table", False),
        ("coulomb@table", "coulomb@motors", False),
        ("cogging@motor_1", "cogging@motors", True),
        ("cogging@motor_1", "cogging@motor_2", False),
        ("cogging@motors", "torque_ripple@motors", False),
    ],
)
def test_a_law_is_no_partner_of_itself_at_a_part_that_has_it(
    first: str, second: str, again: bool
) -> None:
    core = Machine.load("bench").core

    def put_in(label: str) -> Any:
        hypothesis = Hypothesis((tuple(label.split("@")),))  # type: ignore[arg-type]
        grown, _ = hypothesis.put_in(core)
        return SimpleNamespace(hypothesis=hypothesis, grown=grown, label=label)

    one, other = put_in(first), put_in(second)
    assert pairs._again(one, SimpleNamespace(signature=other, label=second)) is again  # type: ignore[arg-type]
