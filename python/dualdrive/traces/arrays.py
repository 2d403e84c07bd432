"""Columns out of nested arrays: what MAT and HDF5 files hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .log import Recorder
from .table import Table

__all__ = ["table_of"]


def table_of(
    arrays: Mapping[str, Any],
    recorder: Recorder,
    *,
    units: Mapping[str, str] | None = None,
    long_names: Mapping[str, str] | None = None,
    layout: Mapping[str, str] | None = None,
) -> Table:
    """Make a table of the arrays that have the length most of them share.

    A matrix with that many rows (or columns) gives ``name[1]``, ``name[2]``, ... Single numbers
    become constants. Arrays of another length are left out, by name.
    """
    columns: dict[str, NDArray[Any]] = {}
    constants: dict[str, float] = {}
    length = _common_length(arrays)
    left_out = []
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.kind not in "fiub" or array.size == 0:
            left_out.append(name)
        elif array.size == 1 and length != 1:
            constants[name] = float(array.ravel()[0])
        elif length in array.shape and array.ndim <= 2:
            columns |= _columns(name, array, length)
        else:
            left_out.append(name)
    if not columns:
        way_out = "state [file] group in the mapping, or export columns of equal length"
        raise recorder.error("file", "no arrays of numbers", way_out)
    if left_out:
        names = ", ".join(map(repr, left_out[:8])) + (" ..." if len(left_out) > 8 else "")
        recorder.add("text_column", f"{names}: no column of {length} numbers, not used")
    return Table(
        columns,
        np.arange(1, length + 1, dtype=np.int64),
        units={n: u for n, u in (units or {}).items() if n in columns and u},
        long_names={n: text for n, text in (long_names or {}).items() if n in columns and text},
        constants=constants,
        layout=dict(layout or {}),
    )


def _common_length(arrays: Mapping[str, Any]) -> int:
    """Length of the longest dimension that occurs most often."""
    lengths = [max(np.shape(a)) for a in arrays.values() if 0 < np.ndim(a) <= 2 and np.size(a) > 1]
    return max(sorted(set(lengths), reverse=True), key=lengths.count) if lengths else 1


def _columns(name: str, array: NDArray[Any], length: int) -> dict[str, NDArray[Any]]:
    if array.ndim == 1 or 1 in array.shape:
        return {name: array.ravel().astype(np.float64)}
    upright = array if array.shape[0] == length else array.T
    return {f"{name}[{k + 1}]": upright[:, k].astype(np.float64) for k in range(upright.shape[1])}
