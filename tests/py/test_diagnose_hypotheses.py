"""Hypotheses as lists of effects: parts of them, others in their stead, what was looked at."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dualdrive import Machine
from dualdrive.diagnose import stage
from dualdrive.diagnose.hypotheses import Hypothesis, distinct
from dualdrive.diagnose.settle import _once
from dualdrive.diagnose.stage import with_orders
from dualdrive.diagnose.work import first_of_each


def cogging(order: float, count: int) -> Hypothesis:
    label = "cogging@motors"
    return Hypothesis((("cogging", "motors"),), {f"{label}.order": order}, {label: count})


WORN = Hypothesis((("wear", "table"),), {}, {"wear@table": 75}, {"wear@table.centre": 0.3})


def test_a_part_keeps_what_is_its_own() -> None:
    both = cogging(42.0, 100) + WORN
    assert both.looked_at == 7500
    assert both.only([1]) == WORN
    assert both.only([0]) == cogging(42.0, 100)
    assert both.only([]) == Hypothesis()
    assert Hypothesis().looked_at == 1


def test_another_stands_where_the_first_one_stood_and_nothing_gets_cheaper() -> None:
    both = cogging(42.0, 100) + WORN
    other = Hypothesis((("torque_ripple", "motors"),))
    assert both.instead(0, other).label == "torque_ripple@motors + wear@table"
    assert both.instead(1, other).label == "cogging@motors + torque_ripple@motors"
    assert both.instead(1, other).looked_at == 100
    assert both.instead(0, other).begins == {"wear@table.centre": 0.3}


def test_what_was_refitted_twice_counts_once_at_its_best() -> None:
    several: list[Any] = [
        SimpleNamespace(hypothesis=cogging(12.0, 1), chi=9.0),
        SimpleNamespace(hypothesis=cogging(24.0, 1), chi=7.0),
        SimpleNamespace(hypothesis=cogging(12.0, 1), chi=5.0),
    ]
    assert [r.chi for r in _once(several)] == [5.0, 7.0]


def test_the_first_of_each_is_the_best_where_the_best_come_first() -> None:
    """Not the place of the worst: two orders of one law stood for the worse of them."""
    ordered = [("cogging", 500), ("unbalance", 400), ("cogging", 16), ("wear", 15)]
    kept = first_of_each(ordered, lambda one: one[0])
    assert kept == [("cogging", 500), ("unbalance", 400), ("wear", 15)]


@pytest.mark.parametrize("low", [False, True])
def test_orders_that_were_looked_for_are_paid_for(
    monkeypatch: pytest.MonkeyPatch, low: bool
) -> None:
    """A spectrum of the angle is one where all turn alike, and two where each has its current."""
    angle = np.linspace(0.0, 20.0, 50)  # rad of the motor
    seen: Any = SimpleNamespace(
        confrontation=SimpleNamespace(
            core=Machine.load("heavy-table-550t").core,
            series=[None],
            columns=lambda _: {"theta_1": angle, "theta_2": angle},
        )
    )
    orders = {"motor_1": 7, "motor_2": 9}
    monkeypatch.setattr(
        stage, "strongest_orders", lambda _e, _r, place, _c: [(orders[place], 99.0)]
    )
    several = [Hypothesis(((effect, "motors"),)) for effect in ("cogging", "torque_ripple")]
    found = with_orders(seen, np.zeros(1), several, low)
    paid = {(h.effects[0][0], next(iter(h.fixed.values()))): h.looked_at for h in found}
    assert paid["cogging", 7.0] == 100
    assert ("cogging", 9.0) not in paid
    assert paid["torque_ripple", 7.0] == paid["torque_ripple", 9.0] == 200
    lowest = {n for effect, n in paid if effect == "cogging" and n <= 4.0}
    assert lowest == ({1.0, 2.0, 3.0, 4.0} if low else set())
    if low:
        assert paid["cogging", 3.0] == 4


def test_hypotheses_that_begin_elsewhere_are_two() -> None:
    """Two harmonics of one load differ in nothing but where their refits begin."""
    load, path = (("cutting_torque", "table"),), "cutting_torque@table.frequency"
    several = [Hypothesis(load, begins={path: f}) for f in (13.0, 42.0, 13.0)]
    assert [h.begins[path] for h in distinct(several)] == [13.0, 42.0]


def test_a_number_that_a_refit_begins_from_is_free() -> None:
    core, label = Machine.load("heavy-table-550t").core, "cutting_torque@table"
    held = Hypothesis((("cutting_torque", "table"),))
    assert f"{label}.frequency" not in held.put_in(core)[1]
    free = Hypothesis(held.effects, begins={f"{label}.frequency": 13.0})
    assert f"{label}.frequency" in free.put_in(core)[1]


def test_a_ripple_of_the_torque_needs_a_whole_period() -> None:
    """Less is a factor of all torques, and as much off every inertia does the same."""
    angle = np.linspace(0.0, 2.0, 50)  # rad of the motor
    seen: Any = SimpleNamespace(
        confrontation=SimpleNamespace(
            core=Machine.load("heavy-table-550t").core,
            series=[None],
            columns=lambda _: {"theta_1": angle, "theta_2": angle},
        )
    )
    assert not stage.is_seen(seen, "torque_ripple", "motors", 3.0)
    assert stage.is_seen(seen, "torque_ripple", "motors", 4.0)
    assert stage.is_seen(seen, "cogging", "motors", 1.0), "that is no factor of the torque"
