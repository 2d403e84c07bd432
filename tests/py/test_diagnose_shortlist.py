"""What is refitted though no score speaks for it: a shaft that gives, in a row with a mesh."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dualdrive.diagnose.guesses import Guesses
from dualdrive.diagnose.hypotheses import Hypothesis
from dualdrive.diagnose.refit import Start
from dualdrive.diagnose.shortlist import Shortlist, gives
from dualdrive.diagnose.work import Clock, Work

SHAFT = Hypothesis((("shaft_compliance", "gearboxes"),))
STIFFNESS = f"{SHAFT.label}.stiffness"
STARTS = (1e7, 3e6, 3e7, 1e8)  # N*m/rad: the one a score foretells, and the other probes


def score(**more: float) -> Any:
    """Of a shaft that is put in; more: other numbers that are put in with it."""
    signature = SimpleNamespace(
        hypothesis=SHAFT,
        strength="",
        grown=None,
        usual={STIFFNESS: STARTS[0], **more},
        settings=[{STIFFNESS: k} for k in STARTS],
    )
    gain = SimpleNamespace(gain=0.0, moved=np.zeros(1), strengths=np.array([1.0, 0.1, 0.1, 0.1]))
    return SimpleNamespace(signature=signature, gain=gain, label=SHAFT.label)


class Asked(Shortlist):
    """Tells from which stiffnesses it refitted; ends are what they are said to be."""

    ends: dict[float, float]
    begun: list[float]

    def _best_end(
        self, score: Any, several: Iterable[Iterable[Start]], slopes: Sequence[Any] = ()
    ) -> Any:
        found = []
        for starts in several:
            for start in starts:
                stiffness = start.values[STIFFNESS]
                self.begun.append(stiffness)
                found.append(SimpleNamespace(hypothesis=SHAFT, chi=self.ends[stiffness]))
        return min(found, key=lambda end: end.chi)


@pytest.fixture
def refitted() -> Any:
    def run(ends: dict[float, float], known: Sequence[Any] = ()) -> tuple[list[Any], list[float]]:
        base: Any = SimpleNamespace(chi=1000.0, u=np.zeros(1), slopes=[])
        work = Work(Clock(60.0, lambda: False), 1, lambda _: None)
        fitter: Any = None
        short = Asked(fitter, base, np.zeros(1), Guesses(), work)
        object.__setattr__(short, "ends", ends)
        object.__setattr__(short, "begun", [])
        return short._put_in([score()], known), short.begun

    return run


def test_a_shaft_that_gains_nothing_costs_one_refit(refitted: Any) -> None:
    [end], begun = refitted(dict.fromkeys(STARTS, 998.0))
    assert begun == [max(STARTS)]
    assert end.chi == 998.0


def test_a_shaft_that_gains_is_refitted_from_softer_ones_too(refitted: Any) -> None:
    """As on a table whose refit had softened the mesh: nearly rigid 227, three times softer 423."""
    [end], begun = refitted({1e7: 577.0, 3e6: 4000.0, 3e7: 740.0, 1e8: 773.0})
    assert begun == [max(STARTS), *STARTS]
    assert end.chi == 577.0


def test_a_shaft_that_was_refitted_is_not_begun_again(refitted: Any) -> None:
    assert refitted(dict.fromkeys(STARTS, 0.0), [SHAFT.effects]) == ([], [])


def test_play_in_a_gearbox_is_no_compliance_alone() -> None:
    assert gives(score())
    assert not gives(score(gap=1e-3))
