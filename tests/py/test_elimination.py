"""Effects taken out of a variant again: what is left is what would have been put in alone."""

from __future__ import annotations

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.elimination import Elimination
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import EFFORTS, Fitted
from dualdrive.diagnose.selection.forward import Forward, Means
from dualdrive.diagnose.selection.ranking import Ranking
from dualdrive.innovations import Point, Variant, first_noise, some
from dualdrive.innovations.greybox import Counter
from test_innovations import bench
from test_likelihood import SAMPLES, grey, likeliest


def blank(variant: Variant) -> Point:
    """Innovations that tell of no order."""
    own = grey(0.4)
    residuals = tuple(np.zeros_like(r.measured) for r in own.records)
    return Point(variant, own.start(variant), residuals, 0.0, 0.0)


def beside(library: Library, base: Variant, effect: tuple[str, str]) -> Variant:
    return next(v for v in library.variants(base, blank(base)) if v.effects[-1] == effect)


CHAIN = (("torque_ripple", "motors"), ("coulomb", "table"), ("eccentricity", "table"))


@pytest.mark.parametrize("out", CHAIN, ids="@".join)
def test_what_is_left_is_what_would_have_been_put_in_alone(out: tuple[str, str]) -> None:
    own = grey(0.4)
    library = Library(own.core, own)
    whole = expected = Variant(own.core)
    for effect in CHAIN:
        whole = beside(library, whole, effect)
        if effect != out:
            expected = beside(library, expected, effect)
    found = library.without(whole, out)
    assert found is not None
    assert found.key == expected.key
    assert [p.path for p in found.extra] == [p.path for p in expected.extra]
    assert found.fixed == expected.fixed
    assert found.looks == expected.looks
    assert {e["label"] for e in found.grown.effects} == {e["label"] for e in expected.grown.effects}


def test_a_late_command_of_one_kind_is_not_taken_for_the_other() -> None:
    """Of all drives, or of the slaves apart: two laws of one effect at one place."""
    own = grey(0.4)
    library = Library(own.core, own)
    whole = beside(library, Variant(own.core), ("coulomb", "table"))
    late = [
        v
        for v in library.variants(whole, blank(whole))
        if v.effects[-1] == ("transport_delay", "controller")
    ]
    assert len({v.key for v in late}) == len(late) == 2
    for v in late:
        alone = library.without(v, ("coulomb", "table"))
        assert alone is not None
        assert alone.fixed == v.fixed
        assert alone.extra[-1].path == v.extra[-1].path


def test_a_worn_range_pays_for_every_spot_where_it_was_sought() -> None:
    own = grey(0.4)
    worn = beside(Library(own.core, own), Variant(own.core), ("wear", "table"))
    assert worn.looks == 22.0


def test_an_elimination_that_is_stopped_ends() -> None:
    """With nothing refitted any more there is nothing to compare the leader with."""
    own = grey(0.4).on(grey(0.4).records)
    asked = 0

    def stop() -> bool:
        nonlocal asked
        asked += 1
        assert asked < 100, "it asks for ever"
        return True

    own.counter = Counter(stop)
    search = Means(own.core, own, EFFORTS["quick"], lambda _: None)
    whole = Variant(own.core)
    for effect in CHAIN[:2]:
        whole = beside(search.library, whole, effect)
    noise = first_noise(own.core, own.records, 0.1)
    base, leader = (Fitted(blank(v), noise, 1.0, 0.0, []) for v in (Variant(own.core), whole))
    on = Forward(search, own, [base, leader])
    assert on.backward.eliminated(leader, proven=1) is leader


@pytest.mark.long
def test_what_came_last_is_taken_out_where_it_has_not_proved_itself() -> None:
    own = grey(0.4).on(grey(0.4).records)
    search = Means(own.core, own, EFFORTS["quick"], lambda _: None)
    estimator = Estimator(own.core, own)
    pair = nothing = Variant(own.core)
    for effect in (("coulomb", "table"), ("torque_ripple", "motors")):
        pair = beside(search.library, pair, effect)
    fits = [estimator.from_far(own, v, own.start(v)) for v in (nothing, pair)]
    base, leader = (f for f in fits if f is not None)
    on = Forward(search, own, [base, leader])
    assert on.backward.eliminated(leader, proven=1) is leader
    assert on.backward.eliminated(leader).variant.label == "coulomb@table"


@pytest.mark.long
def test_a_single_law_is_told_against_the_numbers_alone_at_their_best() -> None:
    """Nothing is missing; the numbers alone had been left far from what they can do."""
    own = grey(0.0).on(grey(0.0).records)
    search = Means(own.core, own, EFFORTS["quick"], lambda _: None)
    friction = beside(search.library, Variant(own.core), ("coulomb", "table"))
    sheet = search.estimator.of_the_data_sheet(own)
    found = search.estimator.likeliest(own, friction, own.start(friction), search.estimator.wide)
    assert sheet is not None
    assert found is not None
    on = Forward(search, own, [sheet, found])
    assert on.ranking.best is found
    assert not on.backward.eliminated(found).variant.effects
    assert not on.ranking.best.variant.effects


@pytest.mark.long
def test_what_few_samples_need_is_not_refitted_without_it_on_all() -> None:
    own = grey(0.4).on(grey(0.4).records)
    nothing, noise, _ = likeliest(0.4)
    friction, quiet, gains = likeliest(0.4, "coulomb@table")
    base, leader = Fitted(nothing, noise, 1.0, 0.0, []), Fitted(friction, quiet, 1.0, 0.0, gains)
    few = some(own, friction, gains, own.samples // 4)
    few.counter, own.counter = Counter(), Counter()
    library, estimator = Library(own.core, own), Estimator(own.core, own)
    ranking = Ranking(own.samples, [base, leader])
    backward = Elimination(estimator, library, own, ranking, lambda _: None, few)
    assert backward._from(leader, Variant(own.core)) is None
    assert few.counter.replays > own.counter.replays == 0


@pytest.mark.long
def test_scores_on_all_samples_are_of_laws_that_stretches_leave_a_hope() -> None:
    own = grey(0.4).on(grey(0.4).records)
    search = Means(own.core, own, EFFORTS["quick"], lambda _: None)
    point, noise, gains = likeliest(0.4)
    base = Fitted(point, noise, 1.0, 0.0, gains)
    found: list[dict[str, float]] = []
    for few in (None, some(own, point, gains, own.samples // 4)):
        on = Forward(search, own, [base], few)
        scored = {s.variant.key: s.gain for s in on.scores_beside(base)[0]}
        found.append({key: gain for key, gain in scored.items() if np.isfinite(gain)})
    every, hopeful = found
    assert set(hopeful) < set(every)
    on_all = pytest.approx(every["coulomb@table"], rel=1e-3)  # steps of differences are remembered
    assert hopeful["coulomb@table"] == on_all
    assert len(hopeful) < 0.8 * len(every)


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("second", "label"), [(0.0, "motor_1"), (0.05, "motors")])
def test_an_effect_stands_at_one_member_where_the_others_have_none_of_it(
    second: float, label: str, seed: int
) -> None:
    """Numbers that were sought under a noise as it was guessed ended on their bounds."""
    ripple = {"order": 6.0, "phase": 0.4}
    true = bench(
        {
            "torque_ripple@motor_1": {"amplitude": 0.06, **ripple},
            "torque_ripple@motor_2": {"amplitude": second, **ripple},
        }
    )
    own = grey_box(Machine.load("bench"), true, SAMPLES, seed)
    library, estimator = Library(own.core, own), Estimator(own.core, own)
    noise = first_noise(own.core, own.records, 0.1)
    nothing = Variant(own.core)
    base = estimator.likeliest(own, nothing, own.start(nothing), noise, guessed=True)
    assert base is not None
    every = library.variants(nothing, base.point)
    both = next(v for v in every if v.key == "torque_ripple@motors (order 6)")
    leader = estimator.likeliest(own, both, own.start(both), noise, guessed=True)
    assert leader is not None
    assert leader.inflation < 1.1
    ranking = Ranking(own.samples, [base, leader])
    found = Elimination(estimator, library, own, ranking, lambda _: None).narrowed(leader)
    assert found.variant.label == f"torque_ripple@{label}"
    sizes = own.machine(found.variant, found.point.theta)
    assert sizes.get("torque_ripple@motor_1.amplitude") == pytest.approx(0.06, rel=0.05)
    assert ranking.best is found
