"""Damaged and strange files: a trace or a one-line error, never anything else."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dualdrive.traces import Trace, TraceError, TraceMap, guess_mapping, read
from dualdrive.traces.mapping_file import mapping_from

GOOD = (
    "Export 7\n\nt [s];theta_m [deg];omega_1 [rpm];T_1 [%];note\n"
    + "\n".join(f"{k / 10};{k % 7 * 50};{k * k};{-k};run" for k in range(30))
).replace(".", ",")
MAPPING = {"time": {"column": "t"}, "columns": {"T_1": {"unit": "%", "of": "90 N*m"}}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


def sound_or_refused(reading: Callable[[], Trace | TraceMap]) -> None:
    with contextlib.suppress(TraceError):
        result = reading()
        if not isinstance(result, Trace):
            return
        assert (np.diff(result.t) > 0).all()
        assert all(np.isfinite(values).all() for values in result.channels.values())
        assert len(result.rows) == len(result) >= 2


@given(st.binary(max_size=300), st.sampled_from(["x.csv", "x.h5", "x.mat", "x"]))
def test_any_bytes(folder: Path, data: bytes, name: str) -> None:
    path = folder / name
    path.write_bytes(data)
    sound_or_refused(lambda: read(path))


@settings(max_examples=200)
@given(st.text("0123456789.,;:-e \t\n\"'tNaT_1[]()°%|/#", max_size=200))
def test_any_table_like_text(folder: Path, text: str) -> None:
    path = folder / "x.csv"
    path.write_text("t,theta_m\n" + text)
    sound_or_refused(lambda: read(path))
    path.write_text(text)
    sound_or_refused(lambda: guess_mapping(path))


@st.composite
def damaged(draw: st.DrawFn) -> str:
    """The good file with a few cells, characters or lines changed, repeated or lost."""
    lines = GOOD.split("\n")
    junk = st.sampled_from(
        ["", "x", "1e999", "-0", "NaN", "inf", "9" * 30, ";", '"', "\0", "  ", "1"]
    )
    for _ in range(draw(st.integers(1, 6))):
        k = draw(st.integers(0, len(lines) - 1))
        cells = lines[k].split(";")
        change = draw(st.sampled_from(["cell", "lose", "repeat", "swap", "cut"]))
        if change == "cell":
            cells[draw(st.integers(0, len(cells) - 1))] = draw(junk)
            lines[k] = ";".join(cells)
        elif change == "lose" and len(lines) > 1:
            del lines[k]
        elif change == "repeat":
            lines.insert(k, lines[k])
        elif change == "swap":
            lines[k], lines[-1] = lines[-1], lines[k]
        else:
            lines[k] = lines[k][: draw(st.integers(0, len(lines[k])))]
    return "\n".join(lines)


@settings(max_examples=200)
@given(
    damaged(), st.sampled_from(["refuse", "split"]), st.sampled_from(["refuse", "spread", "last"])
)
def test_damaged_recordings(folder: Path, text: str, backwards: str, repeated: str) -> None:
    mapping = mapping_from(
        {**MAPPING, "time": {"column": "t", "backwards": backwards, "repeated": repeated}}
    )
    path = folder / "x.csv"
    path.write_text(text)
    sound_or_refused(lambda: read(path, mapping))
