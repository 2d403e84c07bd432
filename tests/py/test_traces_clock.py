"""Time bases with every fault a recorder can have. Expected times are written by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dualdrive.traces import ColumnRule, Trace, TraceError, TraceMap, read
from dualdrive.traces.mapping_file import mapping_from


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


def make(folder: Path, stamps: list[str], header: str = "t") -> Path:
    """A recording whose theta_m counts its rows 0, 1, 2, ..."""
    rows = [f"{stamp};{k}" for k, stamp in enumerate(stamps)]
    path = folder / "log.csv"
    path.write_text("\n".join([f"{header};theta_m", *rows]) + "\n")
    return path


def clock(**rule: object) -> TraceMap:
    return mapping_from({"time": rule})


def steady(count: int, step: float = 0.001) -> list[str]:
    return [f"{k * step:.6f}" for k in range(count)]


def refused(path: Path, mapping: TraceMap | None = None) -> TraceError:
    with pytest.raises(TraceError) as caught:
        read(path, mapping)
    return caught.value


def test_steady_clock_is_left_alone(folder: Path) -> None:
    trace = read(make(folder, steady(20)))
    assert not trace.log.issues
    np.testing.assert_allclose(trace.t, 0.001 * np.arange(20))


def test_numbers_keep_their_origin_unless_asked(folder: Path) -> None:
    path = make(folder, ["5", "6", "7"])
    np.testing.assert_array_equal(read(path).t, [5, 6, 7])
    np.testing.assert_array_equal(read(path, clock(zero=True)).t, [0, 1, 2])


def test_jitter_is_reported_with_rows_and_kept(folder: Path) -> None:
    trace = read(make(folder, ["0", "10", "21", "30", "40", "50"], "t [ms]"))
    np.testing.assert_allclose(trace.t, [0, 0.010, 0.021, 0.030, 0.040, 0.050])
    (issue,) = trace.log["jitter"]
    assert issue.rows == (4, 5)  # the steps of 11 and 9 ms end there
    assert "from 9 to 11 ms" in issue.message


def test_gap_splits_into_segments(folder: Path) -> None:
    stamps = [*steady(20), "31.5", "31.501", "31.502"]
    trace = read(make(folder, stamps))
    (issue,) = trace.log["gap"]
    assert issue.rows == (22,)
    assert "31.48 s" in issue.message
    first, second = trace.segments()
    assert (len(first), len(second)) == (20, 3)
    assert second.t[0] == 31.5
    assert second.rows.tolist() == [22, 23, 24]
    assert "gap" not in first.log


def test_gap_limit_can_be_stated(folder: Path) -> None:
    path = make(folder, ["0", "1", "2", "5", "6"])
    assert read(path).breaks == ()
    assert read(path, clock(gap="2s")).breaks == (3,)
    assert read(path, clock(gap="3s")).breaks == ()


def test_single_row_between_pauses_is_left_out(folder: Path) -> None:
    trace = read(make(folder, [*steady(20), "9", "20", "20.001"]))
    assert trace.log["lone_row"][0].rows == (22,)
    assert trace.log["gap"][0].rows == (23,)
    assert 20.0 not in trace["theta_m"]


def test_repeated_rows_are_left_out(folder: Path) -> None:
    path = folder / "log.csv"
    path.write_text("t,theta_m\n0,1\n1,2\n1,2\n1,2\n2,3\n")
    trace = read(path)
    assert trace.log["repeated_row"][0].rows == (4, 5)
    np.testing.assert_array_equal(trace["theta_m"], [1, 2, 3])


def test_different_rows_at_one_time(folder: Path) -> None:
    path = make(folder, ["0", "0", "2", "2", "4", "4"])
    error = refused(path)
    assert (error.kind, error.rows) == ("repeated_time", (3, 5, 7))
    assert "spread" in str(error)
    np.testing.assert_array_equal(read(path, clock(repeated="first"))["theta_m"], [0, 2, 4])
    np.testing.assert_array_equal(read(path, clock(repeated="last"))["theta_m"], [1, 3, 5])
    trace = read(path, clock(repeated="spread"))
    np.testing.assert_allclose(trace.t, [0, 1, 2, 3, 4, 5])
    assert trace.log["repeated_time"][0].rows == (3, 5, 7)


def test_spread_does_not_reach_across_a_pause(folder: Path) -> None:
    stamps = ["0", "0", "2", "2", "4", "4", "90", "90", "92", "92"]
    trace = read(make(folder, stamps), clock(repeated="spread"))
    np.testing.assert_allclose(trace.t, [0, 1, 2, 3, 4, 5, 90, 91, 92, 93])
    assert trace.breaks == (6,)


def test_time_running_backwards(folder: Path) -> None:
    path = make(folder, ["0", "1", "2", "0", "1", "2"])
    error = refused(path)
    assert (error.kind, error.rows) == ("time_backwards", (5,))
    assert 'backwards = "split"' in str(error)
    trace = read(path, clock(backwards="split"))
    assert trace.breaks == (3,)
    assert (np.diff(trace.t) > 0).all()
    first, second = trace.segments()
    np.testing.assert_allclose(np.diff(second.t), [1, 1])
    np.testing.assert_array_equal(first["theta_m"], [0, 1, 2])


def test_clock_counter_that_overflows(folder: Path) -> None:
    path = make(folder, ["65534", "65535", "0", "1", "2"], "t [ms]")
    assert refused(path).kind == "time_backwards"
    trace = read(path, clock(wrap=65536.0, zero=True))
    np.testing.assert_allclose(trace.t, 0.001 * np.arange(5))
    assert trace.log["clock_wrap"][0].rows == (4,)


@pytest.mark.parametrize(
    ("stamps", "pattern", "start"),
    [
        (["2025-08-07 14:15:59.990", "2025-08-07 14:16:00.000"], "", "2025-08-07T14:15:59.990000"),
        (["2025-11-09T09:27:03.740Z", "2025-11-09T09:27:03.750Z"], "iso", "2025-11-09T09:27:03.7"),
        (["31.12.2025 23:59:59,995", "01.01.2026 00:00:00,005"], "", "2025-12-31T23:59:59.995"),
        (["31.12.2025 23:59:59.995", "01.01.2026 00:00:00.005"], "", "2025-12-31T23:59:59.995"),
        (["23:59:58,1", "23:59:58,11"], "", ""),
        (
            ["03/04/2025 11:59:59.995 PM", "03/05/2025 12:00:00.005 AM"],
            "%m/%d/%Y %I:%M:%S.%f %p",
            "2025-03-04T23:59:59.995",
        ),
    ],
)
def test_dates(folder: Path, stamps: list[str], pattern: str, start: str) -> None:
    trace = read(make(folder, stamps, "Timestamp"), clock(column="Timestamp", format=pattern))
    np.testing.assert_allclose(trace.t, [0, 0.010], atol=1e-12)
    assert trace.source.start.startswith(start)


def test_ambiguous_dates_ask_for_a_pattern(folder: Path) -> None:
    error = refused(make(folder, ["03/04/2025 10:00:00", "03/04/2025 10:00:01"], "time"))
    assert error.kind == "no_time"
    assert "format" in str(error)


def test_rows_without_time_are_left_out(folder: Path) -> None:
    trace = read(make(folder, ["0", "1", "", "3", "later", "5"]))
    assert trace.log["no_time"][0].rows == (4, 6)
    np.testing.assert_array_equal(trace["theta_m"], [0, 1, 3, 5])


def test_several_clocks(folder: Path) -> None:
    path = folder / "log.csv"
    path.write_text("Zeit,Time,theta_m\n0,10,1\n1,11,2\n")
    assert "several columns" in str(refused(path))
    np.testing.assert_array_equal(read(path, clock(column="Time")).t, [10, 11])


def test_a_stated_step_replaces_the_stamps(folder: Path) -> None:
    path = make(folder, ["0", "0.9", "2.2", "3"])
    trace = read(path, clock(sample_time="1s", column="t"))
    np.testing.assert_allclose(trace.t, [0, 1, 2, 3])


def test_rows_selected_away_leave_a_pause(folder: Path) -> None:
    path = folder / "log.csv"
    rows = [f"{k},{k},{int(30 <= k < 60)}" for k in range(90)]
    path.write_text("\n".join(["t,theta_m,pause", *rows]))
    trace = read(path, mapping_from({"rows": {"drop": ["pause == 1"]}}))
    assert trace.breaks == (30,)
    assert trace.log["selected"][0].rows == tuple(range(32, 62))


def test_strict_reading_stops_at_the_first_trouble(folder: Path) -> None:
    path = make(folder, [*steady(20), "31.5", "31.501"])
    with pytest.raises(TraceError, match="gap"):
        read(path, strict=True)
    assert isinstance(read(make(folder, steady(20)), strict=True), Trace)


def test_strict_reading_allows_what_was_asked_for(folder: Path) -> None:
    path = folder / "log.csv"
    path.write_text("t,theta_m,use,word\n0,1,1,a\n1,2,1,b\n2,3,0,c\n")
    mapping = TraceMap(columns={"theta_m": ColumnRule(unit="rad")})
    mapping = mapping_from({**mapping.as_dict(), "rows": {"keep": ["use == 1"]}})
    assert len(read(path, mapping, strict=True)) == 2
