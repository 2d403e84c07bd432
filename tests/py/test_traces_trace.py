"""What can be done with a trace: taking parts, resampling, differences, writing it down."""

from __future__ import annotations

import math
import resource
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from dualdrive.traces import CHANNELS, Issue, Log, Source, Trace, TraceError, read
from dualdrive.traces.resample import METHODS

Floats = NDArray[np.float64]


def even(count: int, step: float) -> Floats:
    return step * np.arange(count, dtype=np.float64)


@pytest.fixture
def trace() -> Trace:
    """Ten seconds with a setting that changes at 4 s and 7 s, and a pause after 5 s."""
    t = even(100, 0.1)
    t[50:] += 20.0
    return Trace(
        t=t,
        channels={"theta_m": 0.1 * t, "T_1": np.sin(t), "mode": np.floor(np.arange(100) / 40)},
        units={"mode": ""},
        rows=np.arange(2, 102),
        breaks=(50,),
        log=Log((Issue("gap", "a pause", (52,)), Issue("denormal", "T_1", (3, 90)))),
    )


def test_a_trace_cannot_be_changed(trace: Trace) -> None:
    with pytest.raises(ValueError, match="read-only"):
        trace["theta_m"][0] = 1.0
    with pytest.raises(TypeError):
        trace.channels["x"] = trace.t  # type: ignore[index]
    own = np.zeros(3)
    made = Trace(t=np.arange(3.0), channels={"x": own})
    own[:] = 7.0
    assert not made["x"].any()


@pytest.mark.parametrize(
    ("t", "values", "mention"),
    [
        ([0, 1, 1], [0, 0, 0], "strictly increasing"),
        ([0, 2, 1], [0, 0, 0], "strictly increasing"),
        ([0, 1, math.nan], [0, 0, 0], "finite"),
        ([0, 1, 2], [0, math.inf, 0], "not finite"),
        ([0, 1, 2], [0, 0], "shape"),
        ([], [], "at least one"),
    ],
)
def test_bad_arrays(t: list[float], values: list[float], mention: str) -> None:
    with pytest.raises(TraceError, match=mention):
        Trace(t=np.array(t, dtype=float), channels={"theta_m": np.array(values, dtype=float)})


def test_units_of_canonical_channels_are_fixed() -> None:
    t = np.arange(3.0)
    assert Trace(t=t, channels={"T_1": t}).units["T_1"] == "N*m"
    with pytest.raises(TraceError, match=r"is in 'deg', not rad"):
        Trace(t=t, channels={"theta_m": t}, units={"theta_m": "deg"})
    assert {what.unit for what in CHANNELS.values()} == {"rad", "rad/s", "A", "V", "N*m"}


def test_unknown_channel_names_the_known_ones(trace: Trace) -> None:
    with pytest.raises(
        TraceError, match="no channel 'speed'; the channels are: theta_m, T_1, mode"
    ):
        trace["speed"]
    assert "t" in trace
    np.testing.assert_array_equal(trace["t"], trace.t)
    assert (trace.canonical, trace.extra) == (("theta_m", "T_1"), ("mode",))


def test_taking_parts(trace: Trace) -> None:
    part = trace.between("1 s", 2.05)
    assert (part.t[0], len(part)) == (1.0, 11)
    assert part.rows[0] == 12
    first, second = trace.segments()
    assert (len(first), len(second)) == (50, 50)
    assert "gap" not in first.log
    assert first.log["denormal"][0].rows == (3,)
    assert second.from_zero().t[0] == 0.0
    holed = trace.take(np.arange(100) % 10 != 5)
    assert len(holed.segments()) == 12  # ten holes and the pause, which falls on no hole
    with pytest.raises(TraceError, match="no sample left"):
        trace.between(500, 600)
    with pytest.raises(TraceError, match="one value per sample"):
        trace.take([True])
    with pytest.raises(TraceError, match="stay in order"):
        trace.take([3, 2])


def test_split_at_changes(trace: Trace) -> None:
    parts = trace.split("mode")
    assert [len(part) for part in parts] == [40, 40, 20]
    assert [part.labels["mode"] for part in parts] == [0, 1, 2]
    assert [part.name for part in parts] == [f"trace[mode={k}]" for k in range(3)]
    assert parts[1].breaks == (10,)
    settled = trace.split("mode", settle="0.5 s", min_time="1.9 s")
    assert [part.rows[0] for part in settled] == [7, 47]  # 15 samples, 1.4 s: too short
    assert settled[0].log["short_part"][0].message == "not in any part: rows 2-6, 42-46 and 82-101"
    with pytest.raises(TraceError, match="lower min_time"):
        trace.split("mode", min_time="1 h")
    assert trace.split() == [trace]


def test_difference_of_wrapped_angles() -> None:
    t = even(50, 0.1)
    motor, table = 3 * t + 0.02, 3 * t
    wrapped = Trace(
        t=t,
        channels={
            "theta_m": table % (2 * math.pi),
            "theta_c1": (motor + 5) % (2 * math.pi),
            "x": t,
        },
    )
    apart = wrapped.difference("theta_c1", "theta_m", turn=2 * math.pi)
    np.testing.assert_allclose(apart, 5.02 - 2 * math.pi, atol=1e-12)
    assert np.ptp(wrapped.difference("theta_c1", "theta_m")) > 6
    np.testing.assert_allclose(wrapped.difference("theta_m", "theta_m", ratio=1.0), 0)
    with pytest.raises(TraceError, match="convert one"):
        wrapped.difference("theta_m", "x")


# --- resampling ----------------------------------------------------------------------------------


def uneven(seed: int = 3) -> Floats:
    rng = np.random.default_rng(seed)
    return np.asarray(np.sort(np.r_[0.0, rng.uniform(0, 10, 400), 10.0]), dtype=np.float64)


@pytest.mark.parametrize("method", [m for m in METHODS if m != "previous"])
@pytest.mark.parametrize("step", [0.005, 0.02, 0.1])
def test_a_straight_line_stays_one(method: str, step: float) -> None:
    t = uneven()
    made = Trace(t=t, channels={"theta_m": 2 * t - 3}).resample(step, method=method)
    np.testing.assert_allclose(np.diff(made.t), step, rtol=1e-9)
    assert made.t[-1] <= t[-1]
    np.testing.assert_allclose(made["theta_m"], 2 * made.t - 3, atol=1e-9)


def test_previous_never_looks_ahead() -> None:
    t = np.array([0.0, 1.0, 2.0, 3.0])
    made = Trace(t=t, channels={"x": np.array([0.0, 5.0, 7.0, 9.0])}).resample(
        0.5, method="previous"
    )
    np.testing.assert_array_equal(made["x"], [0, 0, 5, 5, 7, 7, 9])


def test_coarser_steps_average_what_would_fold_back() -> None:
    t = even(10001, 1e-3)
    ripple = np.sin(2 * math.pi * 99.0 * t)  # at 10 ms steps its samples look like 1 Hz
    trace = Trace(t=t, channels={"T_1": ripple})
    assert np.abs(trace.resample("10ms")["T_1"]).max() < 0.02
    assert np.abs(trace.resample("10ms", method="linear")["T_1"]).max() > 0.9
    assert "by mean" in str(trace.resample("10ms").log)


def test_switches_are_held(trace: Trace) -> None:
    made = trace.segments()[0].resample("37ms")
    assert set(made["mode"]) == {0.0, 1.0}
    assert made["mode"][made.t < 4.0 - 1e-9].max() == 0


def test_resampling_refuses(trace: Trace) -> None:
    with pytest.raises(TraceError, match="has 1 pauses"):
        trace.resample(0.01)
    piece = trace.segments()[0]
    for step in (0.0, -1.0, 100.0):
        with pytest.raises(TraceError, match="does not fit"):
            piece.resample(step)
    with pytest.raises(TraceError, match="method 'magic' unknown"):
        piece.resample(0.1, method="magic")


# --- showing and writing -------------------------------------------------------------------------


def test_text_and_html(trace: Trace) -> None:
    assert "100 samples, 29.9 s" in repr(trace)
    assert "2 segments" in repr(trace)
    assert "torque of motor 1" in repr(trace)
    html = trace.with_channel("<b>", trace.t)._repr_html_()
    assert "&lt;b&gt;" in html
    assert "<b>" not in html.replace("<b>trace</b>", "")


def test_pandas_and_xarray(trace: Trace) -> None:
    frame = trace.to_pandas()
    np.testing.assert_array_equal(frame["theta_m"].to_numpy(), trace["theta_m"])
    assert frame.index.name == "t"
    dataset = trace.to_xarray()
    assert dataset["T_1"].attrs == {"units": "N*m", "long_name": "torque of motor 1"}
    np.testing.assert_array_equal(dataset["t"].to_numpy(), trace.t)
    assert trace.without("mode").extra == ()


numbers = st.floats(-1e150, 1e150, allow_subnormal=False)
names = st.text("abcXYZ_ Ω°(),;\"'#/[]", min_size=1, max_size=8).map(str.strip).filter(bool)


@st.composite
def traces(draw: st.DrawFn) -> Trace:
    count = draw(st.integers(2, 12))
    steps = draw(arrays(np.float64, count - 1, elements=st.floats(0.5, 2.0)))
    known = draw(st.lists(st.sampled_from(sorted(CHANNELS)), min_size=1, max_size=3, unique=True))
    extra = draw(st.lists(names, max_size=2, unique=True))
    taken = {*CHANNELS, "t"}
    columns = [*known, *(name for name in extra if name.lower() not in taken)]
    values = {name: draw(arrays(np.float64, count, elements=numbers)) for name in columns}
    return Trace(t=np.concatenate([[0.25], 0.25 + np.cumsum(steps)]), channels=values)


@given(traces())
def test_hdf5_round_trip_is_whole(tmp_path_factory: pytest.TempPathFactory, made: Trace) -> None:
    again = read(made.to_hdf5(tmp_path_factory.mktemp("h5") / "x.h5"))
    np.testing.assert_array_equal(again.t, made.t)
    assert list(again) == list(made)
    for name in made:
        np.testing.assert_array_equal(again[name], made[name])
    assert (dict(again.units), again.breaks) == (dict(made.units), made.breaks)


def test_hdf5_keeps_the_story(trace: Trace, tmp_path: Path) -> None:
    source = Source("a.csv", {"format": "csv"}, {"split": {"by": ["mode"]}}, "a.map.toml", "2025")
    full = Trace(**{**trace.__dict__, "source": source, "labels": {"TestIndex": 2.0}})
    again = read(full.to_hdf5(tmp_path / "x.h5"))
    assert (again.log, again.source, dict(again.labels)) == (full.log, source, {"TestIndex": 2.0})
    np.testing.assert_array_equal(again.rows, trace.rows)
    assert len(again.split()) == 3
    with pytest.raises(TraceError, match="gap"):
        read(tmp_path / "x.h5", strict=True)


@given(traces())
def test_csv_round_trip(tmp_path_factory: pytest.TempPathFactory, made: Trace) -> None:
    made = made.without(*(name for name in made if name.startswith("theta")))
    if not made.canonical:
        made = made.with_channel("T_1", made.t)
    again = read(made.to_csv(tmp_path_factory.mktemp("csv") / "x.csv"))
    np.testing.assert_array_equal(again.t, made.t)
    assert list(again) == list(made)
    for name in made:
        np.testing.assert_array_equal(again[name], made[name])


@pytest.mark.parametrize("name", ["x.csv", "x.h5"])
def test_a_failed_write_leaves_what_was_there(
    trace: Trace, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # half a module would stay behind
    path = tmp_path / name
    path.write_text("precious")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))  # what a full disk looks like
    try:
        with pytest.raises(TraceError, match="cannot be written") as caught:
            (trace.to_csv if name.endswith("csv") else trace.to_hdf5)(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert caught.value.kind == "write"
    assert path.read_text() == "precious"
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_a_new_file_takes_the_place_of_the_old_one_at_once(trace: Trace, tmp_path: Path) -> None:
    path, other_name = tmp_path / "x.csv", tmp_path / "kept"
    path.write_text("precious")
    path.chmod(0o640)
    other_name.hardlink_to(path)
    trace.to_csv(path)
    assert other_name.read_text() == "precious"  # whoever reads the old one reads all of it
    assert path.stat().st_mode & 0o777 == 0o640


def test_unwritable_paths(trace: Trace, tmp_path: Path) -> None:
    for path in (tmp_path / "no" / "such" / "x.csv", tmp_path):
        with pytest.raises(TraceError, match="cannot be written"):
            trace.to_csv(path)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(TraceError, match="cannot stand in a CSV header"):
        trace.with_channel("a\nb", trace.t).to_csv(tmp_path / "x.csv")
