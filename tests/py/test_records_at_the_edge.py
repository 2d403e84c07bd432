"""Records and machines at the edge of what a grey box takes.

A table at rest, a law of nought, a delay of a tenth of a sample, records of two sample times.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from bench_record import grey_box
from dualdrive import Machine, _core
from dualdrive.diagnose import diagnose
from dualdrive.diagnose.screening import Library, scores
from dualdrive.diagnose.simulated_errors import of_the_data_sheet, simulated_error
from dualdrive.innovations import (
    GreyBox,
    Noise,
    Point,
    Variant,
    first_noise,
    inflation,
    least_noise,
    maximum_likelihood,
    predictable,
    slopes,
)
from dualdrive.replay import records
from dualdrive.traces import Trace
from test_innovations import CHANNELS, REVERSALS, STEP, bench

LATE = 1e-4  # s
#: of sensors' noise: over which it forgets, s, and how large it is, SI
MEMORY, NOISY = 5e-3, {"theta_m": 2e-6, "theta_1": 2e-5, "theta_2": 2e-5, "I_1": 1e-2, "I_2": 1e-2}


def test_a_table_that_is_held_has_no_speed_to_creep_by() -> None:
    """Nought over nought ended a diagnosis: creep is counted by the speed that is commanded."""
    machine = Machine.load("bench")
    machine.add("coulomb", "table", torque=0.3)
    own = grey_box(machine, machine.core, 600, 1, motion=_core.constant(0.0))
    nothing = Variant(own.core)
    assert own.resting(nothing) == {}
    noise, floor = (f(own.core, own.records, 0.01) for f in (first_noise, least_noise))
    found = maximum_likelihood(own, nothing, own.start(nothing), noise, floor=floor, steps=2)
    assert found is not None
    assert np.isfinite(found[0].minus_two_log)


@pytest.mark.long
def test_a_record_that_no_error_is_told_of_names_nothing() -> None:
    """Of the table's speed alone a wrong law had been named with probability 1."""
    t = STEP * np.arange(2000, dtype=np.float64)
    run = _core.simulate(
        bench({"coulomb@table": {"torque": 0.3}}), {"theta_ref": REVERSALS},
        end=t[-1], times=list(t), signals=["omega_m"],
    )  # fmt: skip
    speed = run.values[:, 0] + 1e-4 * np.random.default_rng(1).standard_normal(len(t))
    trace = Trace(t, {"theta_ref": REVERSALS.value(t), "omega_m": speed}, name="speed")
    found = diagnose(Machine.load("bench"), trace, effort="quick", experiment=False)
    assert found.verdict == "unknown"
    assert found.paragraph.startswith("Whether anything is missing these records can't show.")
    assert "record the table's angle" in found.paragraph


@pytest.mark.parametrize(
    "law", [("coulomb", "table"), ("viscous", "table"), ("cogging", "motor_1")]
)
def test_a_law_of_nought_is_nought_in_the_data_sheets_machine(law: tuple[str, str]) -> None:
    """A fit begins with it at its usual size: of 300 N*m the sheet's error was 121, not 0.1."""
    machine = Machine.load("bench")
    machine.add(*law)
    own = grey_box(machine, bench(), 1500, 2)
    given = simulated_error(own.core, [r.record for r in own.records])
    assert of_the_data_sheet(own).error() == pytest.approx(given, rel=0.02)


def test_a_score_of_a_delay_begins_at_the_size_that_it_tells() -> None:
    """It is probed by a part of a sample, and that is what the regression counts in."""
    own = grey_box(Machine.load("bench"), bench(), 3000, 3, late={"theta_1": LATE})
    nothing = Variant(own.core)
    start = own.start(nothing)
    gains = own.gains(nothing, start, first_noise(own.core, own.records, 1e-3))
    [point] = own.points([nothing], [start], gains)
    columns = slopes(own, point, range(len(start)), gains)
    blank = tuple(np.zeros_like(r.measured) for r in own.records)
    known = Library(own.core, own).variants(nothing, Point(nothing, start, blank, 0.0, 0.0))
    [late] = [v for v in known if v.label == "sensor_delay@theta_1"]
    [told] = scores(own, point, columns, [late], gains, inflation(point))
    assert told.start["sensor_delay@theta_1.time"] == pytest.approx(LATE, rel=0.5)


def recorded(core: _core.Machine, name: str, step: float, samples: int, seed: int) -> Trace:
    """Of the bench at such a sample time, under noise that forgets over the same time at any."""
    t = step * np.arange(samples, dtype=np.float64)
    run = _core.simulate(
        core, {"theta_ref": REVERSALS}, end=t[-1], times=list(t), signals=list(CHANNELS)
    )
    pole = np.exp(-step / MEMORY)
    drive = np.random.default_rng(seed).standard_normal((samples, len(CHANNELS)))
    drive[1:] *= np.sqrt(1.0 - pole**2)
    noise = lfilter([1.0], [1.0, -pole], drive, axis=0) * [NOISY[c] for c in CHANNELS]
    seen = dict(zip(CHANNELS, (run.values + noise).T, strict=True))
    return Trace(t, {"theta_ref": REVERSALS.value(t), **seen}, name=name)


def test_noise_forgets_over_the_same_time_at_any_sample_time() -> None:
    """With a pole per sample of either record one of them left 1.6, the other 0.6 times its noise.

    (An autoregression is a course of Ornstein and Uhlenbeck's seen at the samples.)
    """
    machine = Machine.load("bench")
    traces = {
        "slow": recorded(machine.core, "slow", 1e-3, 2000, 1),
        "fast": recorded(machine.core, "fast", 1.25e-4, 4000, 2),
    }
    played = predictable(machine.core, records(machine, traces, start="rest"))
    own, step = GreyBox(machine.core, played, []), 1.25e-4
    pole = float(np.exp(-step / MEMORY))
    kinds = dict(zip(played[0].channels, played[0].kinds, strict=True))
    drive = {kinds[c]: sd * float(np.sqrt(1.0 - pole**2)) for c, sd in NOISY.items()}
    noise = Noise(drive, dict.fromkeys(drive, pole), {}, step=step)
    nothing = Variant(own.core)
    [found] = own.likelihoods(nothing, [(own.start(nothing), noise)])
    assert found is not None
    for residuals in found[0].residuals:
        left = np.sqrt(np.mean(residuals[50:] ** 2, axis=0))
        assert left == pytest.approx(np.ones(len(CHANNELS)), abs=0.06)
