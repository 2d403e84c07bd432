"""Torque balance against closed forms and against published figures."""

from __future__ import annotations

import json

import numpy as np
import pytest

from balance_stand_in import Array, Recorded, RigidAxis
from dualdrive.identify import Balance, Processing, Standstill, torque_balance
from measured import emps

J, B, FC = 2.0, 3.0, 5.0
TRUE = {"table.J": J, "table.b": B, "coulomb@table.torque": FC}
NOMINAL = {"table.J": 1.0, "table.b": 1.0, "coulomb@table.torque": 0.0}
#: closed-form motion lies far below the cut-off, so that the filters do not matter
SMOOTH = Processing(cutoff=100.0, decimate=10)


def moved(
    seconds: float = 20.0, offset: float = 0.0, noise: Array | None = None, **extra: Array
) -> Recorded:
    """θ = sin 2t + sin(5t)/3 at 1 kHz with the torque that J, b and F_c take, exactly."""
    t = np.arange(0, seconds, 1e-3)
    speed = 2 * np.cos(2 * t) + 5 / 3 * np.cos(5 * t)
    acceleration = -4 * np.sin(2 * t) - 25 / 3 * np.sin(5 * t)
    torque = J * acceleration + B * speed + FC * np.sign(speed) + offset
    if noise is not None:
        torque = torque + noise
    angle = np.sin(2 * t) + np.sin(5 * t) / 3
    return Recorded(t, {"theta_m": angle, "T_1": torque, **extra})


def coloured(count: int, seed: int, memory: float = 0.995) -> Array:
    """First-order autoregressive noise of unit variance: a correlation time of 0.2 s at 1 kHz."""
    from scipy.signal import lfilter

    white = np.random.default_rng(seed).normal(size=count)
    return np.asarray(lfilter([np.sqrt(1 - memory**2)], [1, -memory], white))


@pytest.mark.parametrize("treatment", ["mask", "bound", "keep"])
def test_closed_form_motion_gives_its_parameters_back(treatment: str) -> None:
    fit = torque_balance(
        RigidAxis(NOMINAL),
        moved(offset=0.7),
        free=list(NOMINAL),
        processing=SMOOTH,
        standstill=Standstill(treatment),  # type: ignore[arg-type]
    )
    for path, true in TRUE.items():
        assert fit.parameters[path].value == pytest.approx(true, rel=2e-3)
    (offset,) = fit.offsets.values()
    # the torque was measured 0.7 too high, so the model lacks that much
    assert offset.value == pytest.approx(0.7, abs=0.01)
    assert fit.error < 0.01
    assert fit.nominal_errors["m"].relative > 0.3
    assert fit.model.declared("table.J").value == fit.parameters["table.J"].value


def test_emps_without_coulomb_friction_leaves_about_18_percent() -> None:
    bare = {"table.J": 90.0, "table.b": 180.0}
    fit = torque_balance(RigidAxis(bare), emps(), free=list(bare), offsets=False)
    assert 0.16 < fit.force_error < 0.20


@pytest.mark.parametrize("treatment", ["mask", "bound", "keep"])
def test_emps_with_coulomb_friction_reaches_the_published_figures(treatment: str) -> None:
    """A. Janot et al., 2019: M 95.109 kg, F_v 203.50, F_c 20.39 N, offset -3.165 N, 4.08 %."""
    start = {"table.J": 90.0, "table.b": 180.0, "coulomb@table.torque": 0.0}
    fit = torque_balance(
        RigidAxis(start),
        emps(),
        free=list(start),
        processing=SMOOTH,  # as far as the authors' own filter reaches
        standstill=Standstill(treatment),  # type: ignore[arg-type]
    )
    published = {"table.J": 95.109, "table.b": 203.50, "coulomb@table.torque": 20.39}
    for path, value in published.items():
        found = fit.parameters[path]
        assert found.value == pytest.approx(value, rel=5e-3)
        assert found.low < value < found.high
        assert found.verdict == "identified"
    (offset,) = fit.offsets.values()
    assert offset.low < -3.165 < offset.high
    assert fit.force_error <= 0.042
    text = fit.table()
    assert "100 Hz; 1000 Hz sampling, both sides decimated ×10" in text
    assert f"{fit.samples['m'].standstill} near standstill" in text


def test_masked_samples_are_counted_and_not_fitted() -> None:
    everything = torque_balance(
        RigidAxis(NOMINAL), moved(), free=list(NOMINAL), standstill=Standstill("keep")
    ).samples["m"]
    masked = torque_balance(
        RigidAxis(NOMINAL), moved(), free=list(NOMINAL), standstill=Standstill(speed=0.5)
    ).samples["m"]
    assert everything.fitted == everything.total == masked.total
    assert masked.fitted + masked.standstill == masked.total
    t = np.arange(0, 20, 1e-3)
    slow = np.abs(2 * np.cos(2 * t) + 5 / 3 * np.cos(5 * t)) < 0.5
    assert masked.standstill / masked.total == pytest.approx(slow.mean(), abs=0.03)


def test_at_rest_only_torque_beyond_the_friction_limit_counts() -> None:
    """Stuck for 10 s under 0.6 F_c: no friction law is violated, unless friction is too small."""
    t = np.arange(0, 20, 1e-3)
    ramp = np.clip(t - 10, 0, None)
    speed, acceleration = 0.3 * ramp**2, 0.6 * ramp
    torque = np.where(t < 10, 0.6 * FC, J * acceleration + B * speed + FC)
    trace = Recorded(t, {"theta_m": 0.1 * ramp**3, "T_1": torque})
    setup = {"offsets": False, "processing": SMOOTH, "standstill": Standstill("bound", share=1e-4)}

    def left(limit: float) -> float:
        axis = RigidAxis({**TRUE, "coulomb@table.torque": limit})
        fit = torque_balance(axis, trace, free=["table.J"], prior=1e-9, **setup)  # type: ignore[arg-type]
        (residual,) = fit.residuals.values()
        return float(np.abs(residual.residual[residual.t < 9]).max())

    assert left(FC) < 1e-9
    assert left(0.4 * FC) == pytest.approx(0.2 * FC, rel=1e-6)


def test_intervals_cover_the_truth_under_coloured_noise() -> None:
    """95 % intervals over 60 records; those of white noise would cover less than half."""
    inside, narrow = [], []
    for seed in range(60):
        trace = moved(noise=2.0 * coloured(20_000, seed))
        fit = torque_balance(RigidAxis(NOMINAL), trace, free=list(NOMINAL), processing=SMOOTH)
        for path, true in TRUE.items():
            found = fit.parameters[path]
            half = (found.high - found.low) / 2
            white = half * np.sqrt(fit.effective / fit.samples["m"].fitted)
            inside.append(abs(found.value - true) <= half)
            narrow.append(abs(found.value - true) <= white)
    assert 0.89 <= np.mean(inside) <= 0.99
    assert np.mean(narrow) < 0.7


def test_two_inertias_on_one_shaft_are_told_to_belong_together() -> None:
    trace = moved()
    trace = Recorded(trace.t, {**trace.channels, "theta_1": trace.channels["theta_m"]})
    axis = RigidAxis({**NOMINAL, "motor_1.J": 0.5})
    fit = torque_balance(axis, trace, free=list(axis.values), processing=SMOOTH)
    first, second = fit.parameters["table.J"], fit.parameters["motor_1.J"]
    assert {first.verdict, second.verdict} == {"not identified"}
    assert "only together with table.J" in second.reason
    assert first.value + second.value == pytest.approx(J, rel=2e-3)
    assert fit.parameters["table.b"].verdict == "identified"
    assert fit.condition == float("inf")
    assert json.loads(fit.to_json())["condition"] is None


def test_a_tolerance_holds_what_the_record_does_not_determine() -> None:
    trace = moved(noise=coloured(20_000, 1))
    trace = Recorded(trace.t, {**trace.channels, "theta_1": trace.channels["theta_m"]})
    axis = RigidAxis({**NOMINAL, "motor_1.J": 0.5})
    fit = torque_balance(axis, trace, free=list(axis.values), prior={"motor_1.J": 0.1})
    held = fit.parameters["motor_1.J"]
    assert held.verdict == "prior"
    assert held.value == pytest.approx(0.5, abs=0.05)
    # 1.96 sigma of the prior, and no less
    assert (held.high - held.low) / 2 == pytest.approx(1.96 * 0.05, rel=0.2)


def test_what_the_data_sheet_gets_wrong_is_no_noise() -> None:
    """A third of the inertia, believed to a tenth: what that leaves, as noise, held it there."""
    trace = moved(noise=0.5 * coloured(20_000, 2))
    axis = RigidAxis({**TRUE, "table.J": 0.3 * J})
    fit = torque_balance(axis, trace, free=["table.J"], prior=0.1, processing=SMOOTH)
    assert fit.parameters["table.J"].value == pytest.approx(J, rel=0.05)


def test_each_record_has_its_own_offset() -> None:
    traces = {"warm": moved(offset=1.0), "cold": moved(offset=-2.0)}
    fit = torque_balance(RigidAxis(NOMINAL), traces, free=list(NOMINAL), processing=SMOOTH)
    assert fit.offsets["warm", "m"].value == pytest.approx(1.0, abs=0.02)
    assert fit.offsets["cold", "m"].value == pytest.approx(-2.0, abs=0.02)


def test_bounds_hold_and_the_interval_stays_inside() -> None:
    still = moved()
    trace = Recorded(still.t, {**still.channels, "theta_1": -still.channels["theta_m"] / 4})
    axis = RigidAxis({**TRUE, "motor_1.J": 0.1})
    # only a negative inertia of the motor could explain a table that is heavier than 1.9
    fit = torque_balance(axis, trace, free=["motor_1.J"], offsets=False)
    held = fit.parameters["motor_1.J"]
    assert held.low >= 0.0
    lighter = RigidAxis({**TRUE, "table.J": 1.9, "motor_1.J": 0.1})
    held = torque_balance(lighter, trace, free=["motor_1.J"], offsets=False).parameters["motor_1.J"]
    assert held.value == 0.0
    assert held.low == 0.0


def test_the_total_is_closed_unless_equations_are_named() -> None:
    rows = np.arange(6.0).reshape(3, 2)
    balance = Balance(("total", "c1", "m"), rows, rows[..., None], rows)
    assert balance.select(None).equations == ("total",)
    np.testing.assert_array_equal(balance.select(["m", "c1"]).residual, rows[[2, 1]])
    with pytest.raises(ValueError, match="no equation 'mesh'; there are total, c1, m"):
        balance.select(["mesh"])
    assert Balance(("c1", "m"), rows, rows, rows).select(None).equations == ("c1", "m")


def test_pauses_split_a_record_and_are_not_differentiated_across() -> None:
    whole = moved()
    kept = (whole.t < 9) | (whole.t > 13)
    trace = Recorded(whole.t[kept], {n: x[kept] for n, x in whole.channels.items()})
    fit = torque_balance(RigidAxis(NOMINAL), trace, free=list(NOMINAL), processing=SMOOTH)
    assert fit.parameters["table.J"].value == pytest.approx(J, rel=2e-3)
    (residual,) = fit.residuals.values()
    assert not np.any((residual.t > 8.9) & (residual.t < 13.1))


def test_all_that_moves_the_balance_is_free_unless_named() -> None:
    axis = RigidAxis({**NOMINAL, "motor_1.J": 1.0})  # of which no motion was recorded
    assert set(torque_balance(axis, moved()).parameters) == set(NOMINAL)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cutoff": 600.0}, "not below half the sampling rate, 500 Hz"),
        ({"cutoff": -1.0}, "cutoff = -1.0 must be positive"),
        ({"decimate": 0}, "decimate = 0 must be at least 1"),
        ({"trim": 11.0}, "no stretch without a pause is long enough"),
    ],
)
def test_filters_that_cannot_be_are_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        torque_balance(
            RigidAxis(NOMINAL),
            moved(),
            processing=Processing(**change),  # type: ignore[arg-type]
        )


def test_traces_that_cannot_be_are_refused() -> None:
    good = moved()
    with pytest.raises(ValueError, match="no trace given"):
        torque_balance(RigidAxis(NOMINAL), [])
    torn = good.channels["T_1"].copy()
    torn[17] = np.nan
    with pytest.raises(ValueError, match="bad: T_1 has no number in row 17"):
        torque_balance(
            RigidAxis(NOMINAL), {"bad": Recorded(good.t, {**good.channels, "T_1": torn})}
        )
    back = good.t.copy()
    back[5] = 0.0
    with pytest.raises(ValueError, match="t must rise from row to row; row 5 does not"):
        torque_balance(RigidAxis(NOMINAL), Recorded(back, good.channels))
    with pytest.raises(ValueError, match="every sample is masked"):
        torque_balance(RigidAxis(NOMINAL), good, standstill=Standstill(speed=1e9))
