"""What happens to values: holes, memory rubbish, wraps, resets, conventions of recorders."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from dualdrive.traces import Trace, TraceError, read
from dualdrive.traces.mapping_file import mapping_from

Floats = NDArray[np.float64]
Columns = Mapping[str, Sequence[object] | Floats]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


def make(folder: Path, columns: Columns) -> Path:
    """A CSV with t = 0, 1, 2, ... unless given, of columns of numbers or texts."""
    count = max(len(values) for values in columns.values())
    table = {"t": range(count), **columns}
    rows = zip(*table.values(), strict=True)
    path = folder / "log.csv"
    lines = [",".join(table), *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines))
    return path


def mapped(folder: Path, columns: Columns, **rules: Mapping[str, object]) -> Trace:
    return read(make(folder, columns), mapping_from({"columns": rules}))


def refused(folder: Path, columns: Columns, **rules: Mapping[str, object]) -> TraceError:
    with pytest.raises(TraceError) as caught:
        mapped(folder, columns, **rules)
    return caught.value


# --- holes -------------------------------------------------------------------------------------

HOLED: Columns = {"theta_m": [0, 1, "", "", 4, 5, "", 7]}


def test_rows_with_holes_are_left_out_by_default(folder: Path) -> None:
    trace = mapped(folder, HOLED)
    assert trace.log["missing"][0].rows == (4, 5, 8)
    np.testing.assert_array_equal(trace.t, [0, 1, 4, 5, 7])


def test_interpolation_only_where_asked_and_not_beyond_the_ends(folder: Path) -> None:
    holes: Columns = {"theta_m": ["", *HOLED["theta_m"]], "T_1": range(9)}
    trace = mapped(folder, holes, theta_m={"missing": "interpolate"})
    np.testing.assert_allclose(trace["theta_m"], range(8))
    messages = {issue.message: issue.rows for issue in trace.log["missing"]}
    assert messages["theta_m: interpolated"] == (5, 6, 9)
    assert messages["theta_m: hole too long, rows left out"] == (2,)


def test_long_holes_are_not_interpolated(folder: Path) -> None:
    values: list[object] = [*range(30), *[""] * 12, *range(42, 60)]
    trace = mapped(folder, {"theta_m": values}, theta_m={"missing": "interpolate"})
    assert len(trace) == 48
    assert trace.breaks == (30,)  # the hole is now a pause of 13 steps


def test_held_values(folder: Path) -> None:
    trace = mapped(folder, {"theta_m": range(4), "setting": ["", 5, "", 6]})
    np.testing.assert_array_equal(trace["setting"], [5, 5, 5, 6])
    assert trace.log["missing"][0].rows == (2, 4)


def test_mostly_empty_channel_is_refused(folder: Path) -> None:
    error = refused(folder, {"theta_m": [0, 1, 2, 3], "T_1": ["", 1, "", ""]})
    assert error.kind == "missing"
    assert "'T_1'" in str(error)
    assert error.rows == (2, 4, 5)
    assert refused(folder, {"theta_m": ["", ""], "T_1": [1, 2]}).kind == "non_numeric"


def test_infinite_and_denormal(folder: Path) -> None:
    trace = mapped(
        folder, {"theta_m": [0, 1, "inf", 3, 4], "T_1": [1, -6.9e-310, 3, 1e-323, 1e-300]}
    )
    assert trace.log["not_finite"][0].rows == (4,)
    assert trace.log["denormal"][0].rows == (3, 5)
    np.testing.assert_array_equal(trace["T_1"], [1, 0, 0, 1e-300])


# --- angles ------------------------------------------------------------------------------------


def ramp(count: int = 400, speed: float = 0.1) -> Floats:
    """An angle that turns forward, back and forward again, several turns each."""
    k = np.arange(count)
    return np.asarray(speed * np.where(k < count // 2, k, count - k)) + 0.3


@pytest.mark.parametrize("low", [0.0, -math.pi])
def test_wrapped_angles_are_unwrapped(folder: Path, low: float) -> None:
    true = ramp()
    wrapped = (true - low) % (2 * math.pi) + low
    trace = mapped(folder, {"theta_m": wrapped})
    turns = np.round((trace["theta_m"] - true) / (2 * math.pi))
    np.testing.assert_allclose(trace["theta_m"], true + 2 * math.pi * turns[0], atol=1e-9)
    expected = np.flatnonzero(np.abs(np.diff(wrapped)) > math.pi) + 3
    assert trace.log["wrapped"][0].rows == tuple(expected.tolist())


def test_wrap_at_a_stated_count_and_switched_off(folder: Path) -> None:
    counts = np.round(ramp(speed=0.05) / (2 * math.pi) * 4096)
    rule = {"channel": "theta_1", "unit": "turn", "scale": "1/4096", "wrap": 4096}
    trace = mapped(folder, {"pos": counts % 4096}, pos=rule)
    np.testing.assert_allclose(np.diff(trace["theta_1"]), np.diff(counts) * 2 * math.pi / 4096)
    off = mapped(folder, {"pos": counts % 4096}, pos={**rule, "wrap": False})
    assert np.abs(np.diff(off["theta_1"])).max() > 6
    assert "wrapped" not in off.log


def test_an_angle_that_passes_a_turn_is_not_wrapped(folder: Path) -> None:
    trace = mapped(folder, {"theta_m": ramp(), "theta_ref": ramp()})
    np.testing.assert_array_equal(trace["theta_m"], ramp())
    assert not trace.log.issues


def test_counter_set_back_begins_a_segment(folder: Path) -> None:
    forward = 0.1 * np.arange(300)
    values = np.r_[forward, forward[:200]]
    trace = mapped(folder, {"theta_m": values, "T_1": values})
    assert trace.log["reset"][0].rows == (302,)
    assert trace.breaks == (300,)
    counted = mapped(folder, {"theta_m": values}, theta_m={"reset": "continue"})
    assert counted.breaks == ()
    np.testing.assert_allclose(np.delete(np.diff(counted["theta_m"]), 299), 0.1)
    assert np.diff(counted["theta_m"])[299] == 0
    kept = mapped(folder, {"theta_m": values}, theta_m={"reset": "keep"})
    np.testing.assert_array_equal(kept["theta_m"], values)


def test_lone_jump_is_named_but_kept(folder: Path) -> None:
    values: Floats = 0.1 * np.arange(300, dtype=np.float64)
    values[150:] += 40.0
    trace = mapped(folder, {"theta_1": values})
    assert trace.log["jump"][0].rows == (152,)
    np.testing.assert_array_equal(trace["theta_1"], values)


def test_a_quick_move_is_no_jump(folder: Path) -> None:
    steps = np.full(400, 0.001)
    steps[200:212] = [0.02, 0.08, *[0.2] * 8, 0.08, 0.02]  # 3 % of the samples, 200 times faster
    assert not mapped(folder, {"theta_1": np.cumsum(steps)}).log.troubles


def test_a_commanded_step_is_no_reset(folder: Path) -> None:
    steps = np.r_[np.zeros(50), np.full(50, 1.0), np.zeros(50)]
    trace = mapped(folder, {"theta_ref": steps, "theta_m": np.sin(np.arange(150))})
    assert not trace.log.troubles


def test_stale_rows_are_named(folder: Path) -> None:
    a, b, c = np.random.default_rng(1).normal(size=(3, 40))
    for values in (a, b, c):
        values[20] = values[19]
    trace = mapped(folder, {"omega_1": a, "omega_2": b, "omega_m": c})
    assert trace.log["stale"][0].rows == (22,)


@pytest.mark.parametrize(
    ("unit", "sign", "ratio"), [("rad/s", 1, 1.0), ("rpm", 1, 30 / math.pi), ("rad/s", -1, -1.0)]
)
def test_speed_that_contradicts_its_angle(folder: Path, unit: str, sign: int, ratio: float) -> None:
    t = np.arange(400, dtype=np.float64)
    columns: Columns = {"theta_m": np.sin(t / 20), "w": np.cos(t / 20) / 20}
    rule: Mapping[str, object] = {"channel": "omega_m", "unit": unit, "sign": sign}
    log = mapped(folder, columns, w=rule).log
    if ratio == 1:
        assert "rates" not in log
    else:
        found = re.search(r"changes by (\S+) times", log["rates"][0].message)
        assert found is not None
        assert float(found[1]) == pytest.approx(ratio, rel=2e-3)


def test_angles_that_moved_during_a_pause_contradict_nothing(folder: Path) -> None:
    t = np.r_[np.arange(200.0), np.arange(200.0) + 5000]
    angle = np.sin(t / 20) + np.where(t > 1000, 40.0, 0.0)
    log = mapped(folder, {"t": t, "theta_m": angle, "omega_m": np.cos(t / 20) / 20}).log
    assert [issue.kind for issue in log] == ["gap"]


# --- conventions of recorders ------------------------------------------------------------------


def test_sign_scale_offset_unit(folder: Path) -> None:
    rule = {"channel": "theta_m", "unit": "deg", "sign": -1, "scale": 0.5, "offset": 10}
    trace = mapped(folder, {"x": [0, 2, 4]}, x=rule)
    np.testing.assert_allclose(trace["theta_m"], np.radians([-10, -11, -12]))


def test_sign_bit(folder: Path) -> None:
    rule = {"channel": "omega_1", "unit": "turn/s", "scale": "1/4096", "sign_bit": 15}
    trace = mapped(folder, {"speed": [0, 300, 32768 + 300, 32768]}, speed=rule)
    np.testing.assert_allclose(trace["omega_1"] * 4096 / (2 * math.pi), [0, 300, -300, 0])
    error = refused(folder, {"speed": [0, 70000, -1, 2.5]}, speed=rule)
    assert (error.kind, error.rows) == ("sign_bit", (3, 4, 5))


def test_percent_of_rated(folder: Path) -> None:
    rule = {"channel": "T_1", "unit": "%", "of": "0.2 kN*m"}
    np.testing.assert_allclose(mapped(folder, {"M": [50, -150]}, M=rule)["T_1"], [100, -300])
    assert 'of = "100 N*m"' in str(refused(folder, {"M": [1, 2]}, M={**rule, "of": ""}))
    assert refused(folder, {"M": [1, 2]}, M={**rule, "of": "5 A"}).kind == "unit"
    extra = mapped(folder, {"theta_m": [1, 2], "duty": [50, 60]}, duty={"unit": "%"})
    np.testing.assert_allclose(extra["duty"], [0.5, 0.6])


def test_phase_current_becomes_the_current_of_the_model(folder: Path) -> None:
    # torque k_T I_rms must equal K_d I with K_d = k_T / sqrt(3); a peak is sqrt(2) times an rms
    rms = mapped(folder, {"i": [10, 20]}, i={"channel": "I_1", "unit": "A", "current": "rms"})
    np.testing.assert_allclose(rms["I_1"] / math.sqrt(3), [10, 20])
    peak = mapped(folder, {"i": [10, 20]}, i={"channel": "I_1", "unit": "Apk"})
    np.testing.assert_allclose(math.sqrt(2) * peak["I_1"], rms["I_1"])
    assert "rms" in str(rms.log["converted"][0])
    plain = mapped(folder, {"I_1": [10, 20]})
    np.testing.assert_array_equal(plain["I_1"], [10, 20])


def test_linear_axis_about_a_radius(folder: Path) -> None:
    columns: Columns = {"x": [0, 500], "v": [0, 60], "F": [1, 2]}
    trace = mapped(
        folder,
        columns,
        x={"channel": "theta_m", "unit": "mm", "radius": "0.25 m"},
        v={"channel": "omega_m", "unit": "m/min", "radius": "0.25 m"},
        F={"channel": "T_1", "unit": "kN", "radius": "0.25 m"},
    )
    np.testing.assert_allclose(trace["theta_m"], [0, 2])
    np.testing.assert_allclose(trace["omega_m"], [0, 4])
    np.testing.assert_allclose(trace["T_1"], [250, 500])
    error = refused(folder, columns, x={"channel": "theta_m", "unit": "deg", "radius": "1 m"})
    assert "radius needs a length" in str(error)


def test_extra_channels_in_si_or_their_own_unit(folder: Path) -> None:
    path = folder / "log.csv"
    path.write_text("t,theta_m,oil [degC],vib [g],x [mm]\n0,1,20,1,1\n1,2,30,1,2\n")
    trace = read(path)
    np.testing.assert_allclose(trace["oil"], [293.15, 303.15])
    np.testing.assert_allclose(trace["x"], [0.001, 0.002])
    assert (trace.units["oil"], trace.units["x"]) == ("K", "m")
    path.write_text("t,theta_m,oil [mash]\n0,1,20\n1,2,30\n")
    trace = read(path)
    assert trace.units["oil"] == "mash"
    assert "foreign_unit" in trace.log


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=60))
def test_unwrapping_undoes_any_wrapping(
    tmp_path_factory: pytest.TempPathFactory, steps: list[float]
) -> None:
    folder = tmp_path_factory.mktemp("wrap")
    true = np.cumsum(steps) * 0.2
    wrapped = true % (2 * math.pi)
    rule = {"wrap": 2 * math.pi, "reset": "keep"}
    trace = mapped(folder, {"theta_m": wrapped}, theta_m=rule)
    np.testing.assert_allclose(trace["theta_m"] - wrapped[0], true - true[0], atol=1e-9)
