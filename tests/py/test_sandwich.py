"""What colour gains: a law's own inflation, and leaders that owe their gain to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from bench_record import grey_box
from dualdrive import Machine
from dualdrive.diagnose.screening import Library
from dualdrive.diagnose.selection.estimation import Estimator
from dualdrive.diagnose.selection.fitted import EFFORTS, Fitted
from dualdrive.diagnose.selection.forward import Means
from dualdrive.diagnose.selection.ranking import Ranking
from dualdrive.diagnose.selection.sandwich import forget_what_colour_gains, score_inflation
from dualdrive.innovations import GreyBox, Variant, slopes
from test_innovations import bench

Array = NDArray[np.float64]

SAMPLES, MEMORY = 20000, 0.95


def coloured(rows: int, channels: int, memory: float, seed: int = 7) -> Array:
    """An autoregression of variance 1."""
    white = np.random.default_rng(seed).normal(size=(rows, channels))
    return np.ascontiguousarray(lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], white, axis=0))


@pytest.mark.parametrize("memory", [0.0, MEMORY])
@pytest.mark.parametrize("frequency", [0.0, 0.03, 0.3])
def test_a_law_counts_residuals_by_their_spectrum_where_it_acts(
    memory: float, frequency: float
) -> None:
    """(1 - a^2) / |1 - a exp(i w)|^2 of an autoregression, as far as 32 batches tell on average."""
    t = np.arange(SAMPLES, dtype=np.float64)
    wave = np.stack([np.cos(frequency * t), np.sin(frequency * t)]) if frequency else t[None] / 1e4
    columns = wave - wave.mean(axis=1, keepdims=True)
    found = list[float]()
    for seed in range(20):
        residuals = [coloured(n, 1, memory, seed) for n in (3000, SAMPLES - 3000)]
        found.append(score_inflation(columns, residuals))
    spectrum = (1.0 - memory**2) / abs(1.0 - memory * np.exp(1j * frequency)) ** 2
    assert np.mean(found) == pytest.approx(spectrum, rel=0.2)
    assert np.std(found) < 0.5 * spectrum


@pytest.fixture(scope="module")
def grey() -> GreyBox:
    return grey_box(Machine.load("bench"), bench({}), SAMPLES, seed=4)


@pytest.fixture(scope="module")
def alone(grey: GreyBox) -> Fitted:
    """The machine, numbers and noise as they are."""
    estimator, nothing = Estimator(grey.core, grey), Variant(grey.core)
    theta = grey.start(nothing)
    found = estimator.likeliest(grey, nothing, theta, estimator.wide, roughly=True)
    assert found is not None
    return found


def with_law(grey: GreyBox, alone: Fitted, label: str, memory: float) -> Fitted:
    """A law beside it, and residuals of variance 1 with a memory in place of its own."""
    library = Library(grey.core, grey)
    law = next(v for v in library.variants(alone.variant, alone.point) if label == v.label)
    theta = np.r_[alone.point.theta, np.full(len(law.extra), 1e-3)]
    [there] = grey.likelihoods(law, [(theta, alone.noise)])
    assert there is not None
    [r] = there[0].residuals
    point = replace(there[0], residuals=(coloured(len(r), r.shape[1], memory),))
    return replace(alone, point=point, gains=there[1])


@pytest.mark.parametrize(("memory", "believed"), [(0.0, True), (MEMORY, False)])
def test_a_leader_that_gains_by_colour_alone_is_forgotten(
    grey: GreyBox, alone: Fitted, memory: float, believed: bool
) -> None:
    law = with_law(grey, alone, "viscous@motors", memory)
    assert stands(grey, alone, law) is believed


def test_colour_along_what_other_numbers_do_is_no_colour_of_a_law(
    grey: GreyBox, alone: Fitted
) -> None:
    """What a current's zero does, up and down eight times, beside dry friction that slides."""
    law = with_law(grey, alone, "coulomb@table", 0.0)
    k = len(grey.nominal) + list(grey.offsets).index("I_1")
    [column] = slopes(grey, law.point, [k], law.gains)
    [r] = law.point.residuals
    turns = np.where(np.arange(len(r)) * 8 // len(r) % 2, 1.0, -1.0)[:, None]
    moved = r + 0.3 * turns * column.reshape(r.shape) / np.std(column)
    law = replace(law, point=replace(law.point, residuals=(moved,)))
    assert stands(grey, alone, law, gain=1000.0)


def stands(grey: GreyBox, alone: Fitted, law: Fitted, gain: float = 100.0) -> bool:
    """Whether a leader that gains so much beside the machine alone is not forgotten."""
    behind = law.point.minus_two_log - alone.point.minus_two_log
    base = replace(alone, point=replace(alone.point, prior=alone.point.prior + behind + gain))
    ranking = Ranking(grey.samples, [base, law])
    assert ranking.best is law
    forget_what_colour_gains(
        Means(grey.core, grey, EFFORTS["normal"], lambda _: None), ranking, grey
    )
    return ranking.best is law
