"""A damaged MAT file of version 5 is told, and never reaches a reader that trusts it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.io import savemat

from dualdrive.traces import TraceError, read
from dualdrive.traces.mat_elements import MatError, check_elements
from measured import measured_file

T = 0.01 * np.arange(20.0)


def written(path: Path, variables: dict[str, Any], **how: Any) -> Path:
    savemat(str(path), variables, **how)
    return path


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize(
    "value",
    [
        T,
        T.astype("f4"),
        np.arange(20, dtype="i2"),
        T + 1j,
        "words",
        {"speed": T, "inner": {"x": 1.0, "name": "a"}},
        np.array([1.0, "a", T], dtype=object),
        np.array([], dtype=float),
        True,
        sparse.csc_matrix(np.eye(3)),
        np.zeros((2, 3, 4)),
    ],
)
def test_whatever_is_sound_passes(tmp_path: Path, value: Any, packed: bool) -> None:
    check_elements(written(tmp_path / "x.mat", {"t": T, "x": value}, do_compression=packed))


def test_a_real_recording_passes() -> None:
    check_elements(measured_file("emps/DATA_EMPS.mat"))
    check_elements(measured_file("emps/DATA_EMPS_PULSES.mat"))


def test_complex_without_an_imaginary_part_does_not_end_the_process(tmp_path: Path) -> None:
    """SciPy read on beyond the end: a segmentation fault, found by fuzzing."""
    path = written(tmp_path / "x.mat", {"t": T, "theta_m": T})
    data = bytearray(path.read_bytes())
    assert data[128:136] == b"\x0e\0\0\0" + data[132:136], "the first variable"
    data[128 + 16 + 1] |= 0x08  # its flags
    path.write_bytes(bytes(data))
    with pytest.raises(TraceError, match=r"x\.mat: not a readable MAT file: .*imaginary part"):
        read(path)


@pytest.mark.parametrize("at", [125, 127])  # its version, the order of its bytes
def test_a_damaged_head_is_told_without_words_of_the_library(tmp_path: Path, at: int) -> None:
    path = written(tmp_path / "x.mat", {"t": T})
    data = bytearray(path.read_bytes())
    data[at] = 0
    path.write_bytes(bytes(data))
    with pytest.raises(TraceError) as caught:
        read(path)
    assert str(caught.value) == "x.mat: not a readable MAT file; export again"


@pytest.mark.parametrize(
    ("at", "value", "words"),
    [
        (128, 9, "type 9, where a variable should be"),
        (132, 250, "an element of"),
        (128 + 16, 99, "class 99"),
        (128 + 32, 7, "numbers, where the dimensions want"),
        (128 + 35, 0xFF, "dimensions -"),
    ],
)
def test_what_is_damaged_is_told_with_its_place(
    tmp_path: Path, at: int, value: int, words: str
) -> None:
    path = written(tmp_path / "x.mat", {"t": T})
    data = bytearray(path.read_bytes())
    data[at] = value
    path.write_bytes(bytes(data))
    with pytest.raises(MatError, match=words):
        check_elements(path)
