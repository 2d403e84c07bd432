"""How probable a name is: by what it leaves and explains, and who stands beside the leader."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

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
