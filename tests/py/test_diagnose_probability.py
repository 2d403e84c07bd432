"""How probable a name is: by what it leaves and explains, and who stands beside the leader."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dualdrive.diagnose import judge, probability
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.probability import SURE, how_often_right, leaders


def named(*several: tuple[str, float]) -> list[tuple[SimpleNamespace, float]]:
    return [(SimpleNamespace(hypothesis=SimpleNamespace(label=n)), p) for n, p in several]


def test_a_leader_that_leaves_much_and_explains_little_is_hardly_ever_right() -> None:
    assert how_often_right(3.0, 0.1) < 0.1


def test_a_leader_is_the_likelier_the_less_it_leaves_and_the_more_it_explains() -> None:
    by_floor = [how_often_right(x, 0.0) for x in (1.0, 1.1, 1.2, 2.0)]
    by_share = [how_often_right(2.0, x) for x in (0.99, 0.8, 0.6, 0.2)]
    assert by_floor == sorted(by_floor, reverse=True)
    assert by_share == sorted(by_share, reverse=True)
    assert how_often_right(1.0, 0.2) == by_floor[0], "the better of both counts"


@pytest.mark.parametrize(
    ("several", "group"),
    [
        ([("a", 0.95), ("b", 0.05)], ("a",)),
        ([("a", 0.6), ("b", 0.35), ("c", 0.05)], ("a", "b")),
        ([("a", 0.4), ("b", 0.3), ("c", 0.1)], ("a", "b", "c")),
    ],
)
def test_names_count_until_together_they_are_sure(
    several: list[tuple[str, float]], group: tuple[str, ...]
) -> None:
    assert SURE == 0.9, "the cases are drawn up for it"
    assert leaders(named(*several)) == group  # type: ignore[arg-type]


def pair_of(first: str, second: str, *, brings: float, leaves: float = 1.0) -> tuple[Any, Any]:
    """A survey in which a pair gains 1000, its second effect that share of it; and the pair.

    leaves: residual over floor that the first leaves alone
    """
    parts = [tuple(x.split("@")) for x in (first, second)]
    none, alone, both = (
        SimpleNamespace(hypothesis=Hypothesis(tuple(parts[:k])), left=leaves)  # type: ignore[arg-type]
        for k in range(3)
    )
    costs = {
        "nothing": 1000.0,
        alone.hypothesis.label: 1000.0 * brings,
        both.hypothesis.label: 0.0,
    }
    return SimpleNamespace(base=none, refits=[alone, both], criterion=costs), both


@pytest.mark.parametrize(
    ("first", "second", "brings", "bent"),
    [
        ("hydrostatic_drag@table", "coulomb@motors", 0.01, True),
        ("hydrostatic_drag@table", "coulomb@motors", 0.2, False),
        ("hydrostatic_drag@table", "cogging@motors", 0.01, False),  # along another coordinate
    ],
)
def test_a_friction_that_only_bends_another_makes_no_name(
    first: str, second: str, brings: float, bent: bool
) -> None:
    found, pair = pair_of(first, second, brings=brings)
    assert judge._bent(found, pair) is bent
    assert not judge._bent(found, found.refits[0]), "a single law is never that"


@pytest.mark.parametrize(
    ("second", "brings", "leaves", "mended"),
    [
        ("time_varying_mesh_stiffness@pinions", 0.01, 1.05, True),
        ("time_varying_mesh_stiffness@pinions", 0.05, 1.05, False),  # brings something
        ("time_varying_mesh_stiffness@pinions", 0.01, 1.6, False),  # the first leaves something
        ("transmission_error@table", 0.01, 1.05, True),  # the same law once more
        ("cogging@motors", 0.01, 1.05, False),  # of another kind
    ],
)
def test_a_second_law_of_its_kind_that_brings_next_to_nothing_only_mends_the_first(
    monkeypatch: pytest.MonkeyPatch, second: str, brings: float, leaves: float, mended: bool
) -> None:
    monkeypatch.setattr(probability, "excess", lambda _, left: np.array([left]))
    found, pair = pair_of("transmission_error@pinions", second, brings=brings, leaves=leaves)
    assert probability._mended(found, pair) is mended


def test_two_laws_of_friction_are_for_the_judge() -> None:
    found, pair = pair_of("coulomb@table", "stribeck@table", brings=0.001)
    assert not probability._mended(found, pair)
