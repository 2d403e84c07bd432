"""Stretches of records: where they lie, and that a replay of them is that of the whole record."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import numpy as np
import pytest

from bench_record import grey_box
from dualdrive import Machine, _core
from dualdrive.innovations import GreyBox, Variant, first_noise, some
from dualdrive.innovations.prediction import predicted
from dualdrive.innovations.stretches import chosen, d_optimal, spread
from test_innovations import bench

SAMPLES = 3000
#: a filter has nearly forgotten where it began
SETTLED = 300
SAMPLED = {"controller.position_sample": 4e-3, "controller.speed_sample": 1e-3}


@functools.cache
def grey(sampled: bool) -> GreyBox:
    machine = Machine.load("bench")
    true = bench({})
    for path, value in SAMPLED.items() if sampled else ():
        machine.set(path, value)
        true.set(path, value)
    return grey_box(machine, true, SAMPLES, seed=1)


@pytest.mark.parametrize("samples", [(3000,), (9000, 100, 700), (20000, 20000)])
@pytest.mark.parametrize("most", [500, 2000, 8000])
def test_stretches_lie_within_their_records_and_apart(samples: tuple[int, ...], most: int) -> None:
    random = np.random.default_rng(7)
    found = chosen([random.normal(size=(n, 3)) for n in samples], most, [7] * len(samples))
    for n, own in zip(samples, found, strict=True):
        assert own, "no record is left out"
        assert own[0][0] >= 0
        assert own[-1][0] + own[-1][1] <= n
        assert all(first % 7 == 0 for first, _ in own), "they begin as the ticks repeat"
        assert all(b[0] >= a[0] + a[1] for a, b in itertools.pairwise(own))
    kept = sum(count for own in found for _, count in own)
    assert kept <= most + 500 * len(samples), "and none is given up for another"


def test_where_it_fails_nowhere_half_of_them_lie_where_a_record_tells_most() -> None:
    """A table turns for a second of thirty; a constant, which every sample tells, outweighs it."""
    quiet = [np.ones((20000, 2)), np.ones((10000, 2))]
    constant, moving = np.full(60000, 100.0), np.zeros(60000)
    moving[2 * (20000 + 8600) : 2 * (20000 + 9400)] = 0.1
    found = chosen(quiet, 8000, columns=[constant, moving], precision=np.full(2, 1e-6))
    assert {(8500, 500), (9000, 500)} <= set(found[1])
    assert sum(map(len, found)) == 8000 // 500


def test_what_is_taken_together_tells_most() -> None:
    """Two that tell of one number, and one that tells less, but of another."""
    known = np.eye(2)
    told = [np.diag([9.0, 0.0]), np.diag([8.0, 0.0]), np.diag([0.0, 3.0])]
    assert d_optimal(known, told, 2) == [0, 2]


def test_half_of_the_stretches_lie_where_a_machine_fails() -> None:
    """A chirp meets the loop's resonance for a second; what that tells must not be missed."""
    quiet, loud = np.ones((20000, 2)), np.ones((10000, 2))
    loud[8600:9400] = 5.0
    found = chosen([quiet, loud], 8000)
    assert {(8500, 500), (9000, 500)} <= set(found[1])
    evenly = spread([20000, 10000], 4000)
    for own, blocks in zip(found, evenly, strict=True):
        assert {(500 * b, 500) for b in blocks} <= set(own)
    assert sum(map(len, found)) == 8000 // 500


@pytest.mark.parametrize("sampled", [False, True], ids=["continuous", "sampled loops"])
def test_a_stretch_is_replayed_as_in_the_whole_record(sampled: bool) -> None:
    own = grey(sampled)
    nothing = Variant(own.core)
    theta = own.start(nothing)
    noise = first_noise(own.core, own.records, 0.1)
    gains = own.steady(own.machine(nothing, theta), noise)
    assert gains is not None
    [whole] = own.points([nothing], [theta], gains)
    few = some(own, whole, gains, 2000)
    [record] = few.records
    [cut] = few.points([nothing], [theta], gains)
    starts = [*record.sampled.starts, len(record.measured)]
    assert len(starts) > 3
    period = gains[0].phases
    [which] = chosen(whole.residuals, 2000, [period])
    for (first, count), row in zip(which, starts, strict=False):
        np.testing.assert_array_equal(record.measured[row], own.records[0].measured[first])
        late = slice(row + SETTLED, row + count)
        there = slice(first + SETTLED, first + count)
        np.testing.assert_allclose(
            cut.residuals[0][late], whole.residuals[0][there], rtol=0.0, atol=0.25
        )


def test_few_samples_are_all_kept() -> None:
    own = grey(False)
    nothing = Variant(own.core)
    theta = own.start(nothing)
    gains = own.gains(nothing, theta, first_noise(own.core, own.records, 0.1))
    [point] = own.points([nothing], [theta], gains)
    assert some(own, point, gains, SAMPLES) is own


@pytest.mark.parametrize(
    ("which", "words"),
    [
        ([], "no stretches"),
        ([(0, 1)], "no stretch of 1 samples from sample 0"),
        ([(SAMPLES - 10, 11)], f"in {SAMPLES}"),
        ([(SAMPLES + 5, 2)], f"from sample {SAMPLES + 5}"),
    ],
)
def test_stretches_that_are_none_are_told(which: list[tuple[int, int]], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        grey(False).records[0].sampled.stretches(which)


def test_what_the_likelihood_is_conditioned_on_does_not_count() -> None:
    own = grey(False)
    nothing = Variant(own.core)
    theta = own.start(nothing)
    gains = own.gains(nothing, theta, first_noise(own.core, own.records, 0.1))
    core, record = own.machine(nothing, theta), own.records[0]

    def replay(given: int) -> Any:
        return predicted(core, own.constants(theta), record, gains[0], given=given)

    every, late = replay(0), replay(40)
    assert not np.any(late["residuals"][:40])
    np.testing.assert_array_equal(late["residuals"][40:], every["residuals"][40:])
    steady = gains[0].log_det()
    assert every["log_det"] - late["log_det"] == pytest.approx(40 * steady, rel=0.2)
    assert isinstance(gains[0], _core.KalmanGains)
