"""What the best name may be taken for is refitted in its stead before it gets the name."""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.blind.shown import ordered

from dualdrive import Machine
from dualdrive.diagnose import neighbours, whitening
from dualdrive.diagnose.candidates import akin, station
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.evidence import evidence
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.neighbours import with_neighbours
from dualdrive.diagnose.refit import Fitter, Start
from dualdrive.diagnose.settle import settle
from dualdrive.diagnose.survey import Survey, key_of
from dualdrive.diagnose.work import Clock, Work
from dualdrive.identify import Processing
from dualdrive.replay import core_of

AT_LEISURE = Work(Clock(math.inf))


def taken_for(order: ordered.Order, wrong: Hypothesis) -> Survey:
    """A survey of the torque balance in which the wrong law alone was refitted."""
    settings, process = order.settings(), Processing(decimate=20)  # a fifth of the usual samples
    c = TorqueBalance(core_of(order.machine()), order.traces(), settings, process)
    base = Fitter(evidence(c, whitening.plain(c.series))).nominal(c.start)
    assert base is not None
    fitter = Fitter(evidence(c, whitening.sized(c.series, base.left)))
    phases = [{f"{wrong.label}.phase": x} for x in (0.0, 3.0)]
    trial = fitter.tried(wrong, [Start(base.u, one) for one in phases], slopes=base.slopes)
    assert trial is not None
    refit = fitter(trial, base.slopes)
    plain = Survey(fitter.evidence, base, base, [refit], {key_of(base): 0.0}, 1.0, [])
    return settle(plain, AT_LEISURE)


@pytest.mark.long
def test_another_order_of_the_same_law_is_tried_where_the_first_leaves_something(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    order = ordered.hiding("angle_dependent_friction", "bench", 1, 1.0, count=1)
    [hidden] = order.hidden["fast"]
    real = hidden.parameters["order"]
    label = "angle_dependent_friction@table"
    wrong = Hypothesis(((label.split("@")[0], "table"),), {f"{label}.order": real % 3 + 1.0})
    found = taken_for(order, wrong)
    assert found.best.hypothesis == wrong, "it does gain something"
    # other laws have a test of their own, below
    monkeypatch.setattr(neighbours, "tried_with", lambda *_, **__: [Hypothesis(wrong.effects)])
    better = with_neighbours(found, AT_LEISURE).best
    assert better.hypothesis.effects == wrong.effects
    assert better.hypothesis.fixed[f"{label}.order"] == real
    assert better.values()[f"{label}.torque"] == pytest.approx(
        hidden.parameters["torque"], rel=0.05
    )


@pytest.mark.skipif("SHOWN" not in os.environ, reason="a second such search: SHOWN=1")
def test_dry_friction_is_tried_where_friction_along_the_turn_leads() -> None:
    order = ordered.hiding("coulomb", "bench", 3, 0.5, count=1)
    [hidden] = order.hidden["fast"]
    effect, place = "angle_dependent_friction", hidden.place
    found = taken_for(order, Hypothesis(((effect, place),)))
    assert found.best.hypothesis.effects == ((effect, place),), "it does gain something"
    better = with_neighbours(found, AT_LEISURE).best
    assert better.hypothesis.effects == (("coulomb", place),)
    torque = better.values()[f"coulomb@{place}.torque"]
    assert torque == pytest.approx(hidden.parameters["torque"], rel=0.02)


def test_nothing_is_tried_beside_a_machine_that_lacks_nothing() -> None:
    told: list[str] = []
    base: Any = SimpleNamespace(hypothesis=Hypothesis())
    found: Any = SimpleNamespace(best=base, base=base)
    assert with_neighbours(found, Work(Clock(math.inf), told=told.append)) is found
    assert not told


def test_a_user_who_is_in_a_hurry_is_told_what_was_left_out() -> None:
    clock = Clock(1e9, lambda: True)
    best: Any = SimpleNamespace(hypothesis=Hypothesis((("cogging", "motors"),)))
    found: Any = SimpleNamespace(best=best, base=None)
    assert with_neighbours(found, Work(clock)) is found
    assert clock.cut == ["what else cogging@motors may be"]


def test_kinship_goes_both_ways() -> None:
    assert akin("shaft_compliance", "gearbox_backlash")
    assert akin("coulomb", "lugre")
    assert akin("lugre", "coulomb")
    assert not akin("cogging", "sensor_delay")


@pytest.mark.parametrize(
    ("place", "train"),
    [
        ("motors", "drives"),
        ("meshes", "drives"),
        ("pinion_2", "2"),
        ("gearbox_1", "1"),
        ("table", "table"),
        ("theta_1", "theta_1"),
    ],
)
def test_parts_of_one_drive_train_are_one_station(place: str, train: str) -> None:
    assert station(place) == train


def test_what_stays_of_a_pair_is_not_put_in_again_in_stead_of_the_other() -> None:
    """Friction along the turn is confused with a constant one, which is there."""
    core = core_of(ordered.drifted("bench", 0, 1.0).machine())
    grown = core.copy()
    grown.add_effect("coulomb", "table")
    c: Any = SimpleNamespace(channels=[], one_clock=False, core=core)
    seen = SimpleNamespace(confrontation=c)
    pair = (("coulomb", "table"), ("angle_dependent_friction", "table"))
    best: Any = SimpleNamespace(left=[], hypothesis=Hypothesis(pair), values=dict)
    found: Any = SimpleNamespace(evidence=seen, refits=[], best=best, twins={})
    stead = neighbours._Stead(best, 1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(neighbours, "excess", lambda *_: np.ones(1))
        several = neighbours._neighbours(found, stead, grown, np.zeros(1))
    labels = {h.label for h in several}
    assert "unbalance@table" in labels
    assert "coulomb@table" not in labels


def test_a_mesh_does_at_both_of_its_wheels_what_it_does_once_per_tooth() -> None:
    """A pinion that turns four times as often as the table has a quarter of its teeth."""
    core = core_of(ordered.drifted("bench", 0, 1.0).machine())
    label = "transmission_error@table"
    wrong = Hypothesis((("transmission_error", "table"),), {f"{label}.teeth": 88.0}, {label: 100})
    grown, _ = wrong.put_in(core)
    best: Any = SimpleNamespace(hypothesis=wrong, grown=grown, values=dict)
    stead = neighbours._Stead(best, 0)
    other = Hypothesis((("transmission_error", "pinions"),))
    assert neighbours._is_near(other, stead)
    assert not neighbours._is_near(Hypothesis((("wear", "pinion_1"),)), stead)
    found = neighbours._as_often(other, stead, core)
    assert found is not None
    teeth = 88.0 / core.get("mesh_1.ratio")
    assert found.fixed == {"transmission_error@pinions.teeth": teeth}
    assert found.looked_at == 100, "no cheaper than the one that was found"


def test_a_relative_that_ended_in_a_side_valley_is_tried_again() -> None:
    base, best, stray, near = (
        SimpleNamespace(hypothesis=Hypothesis(((effect, "table"),)))
        for effect in ("none", "wear", "eccentricity", "unbalance")
    )
    costs = {"none@table": 1000.0, "wear@table": 0.0, "eccentricity@table": 2e6}
    costs["unbalance@table"] = 30.0
    found: Any = SimpleNamespace(base=base, best=best, criterion=costs)
    assert not neighbours._is_found(found, stray)  # type: ignore[arg-type]
    assert neighbours._is_found(found, near)  # type: ignore[arg-type]


def test_a_law_at_each_part_of_a_group_is_tried_as_one_law_of_the_group(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It begins from the mean of their numbers; two different laws are two."""
    core = Machine.load("bench").core
    seen: Any = SimpleNamespace(confrontation=SimpleNamespace(core=core))
    found: Any = SimpleNamespace(evidence=seen)
    work = Work(Clock(60.0, lambda: False), 1, lambda _: None)
    asked: list[Any] = []
    monkeypatch.setattr(neighbours, "Fitter", lambda *_: None)
    monkeypatch.setattr(neighbours, "together", lambda *given: asked.append(given))

    def pair(second: str) -> Any:
        labels = ["cogging@motor_2", f"{second}@motor_1"]
        h = Hypothesis(
            (("cogging", "motor_2"), (second, "motor_1")),
            {f"{label}.order": 2.0 for label in labels},
            dict.fromkeys(labels, 100),
        )
        values = dict(zip((f"{label}.amplitude" for label in labels), (0.007, 0.006), strict=True))
        return SimpleNamespace(hypothesis=h, values=lambda: values, u=np.zeros(1), slopes=[])

    assert neighbours._in_one(found, pair("cogging"), work) == []  # nothing came of it here
    assert neighbours._in_one(found, pair("torque_ripple"), work) == []
    [(_, whole, [start], _)] = asked
    assert whole.label == "cogging@motors"
    assert whole.fixed == {"cogging@motors.order": 2.0}
    assert whole.looked_at == 100
    assert start.values == pytest.approx({"cogging@motors.amplitude": 0.0065})
