"""Columns out of nested arrays: what MAT and HDF5 files hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.hdf5 import numbers_to_read
from dualdrive.memory import excess

from .log import Recorder
from .names import CHANNELS, TIME
from .table import Table

__all__ = ["refuse_excess", "table_of"]

#: float64 arrays that a number passes through: as read, as a column, cleaned, in the trace
_COPIES: Final = 4


def refuse_excess(numbers: int, recorder: Recorder) -> None:
    """Raise TraceError where so many numbers would not fit into memory as a trace."""
    if too_much := excess(_COPIES * np.dtype(np.float64).itemsize * float(numbers)):
        rule = f"reading its {numbers} numbers {too_much}"
        raise recorder.error("file", rule, "export a shorter stretch, or fewer columns")


def table_of(
    arrays: Mapping[str, Any],
    recorder: Recorder,
    *,
    units: Mapping[str, str] | None = None,
    long_names: Mapping[str, str] | None = None,
    layout: Mapping[str, str] | None = None,
    ignore: Sequence[str] = (),
) -> Table:
    """Make a table of the arrays that have the length most of them share.

    arrays:  NumPy's, or HDF5 datasets, of which only what is used is read; None where there is none
    ignore:  patterns of names that are not wanted, whatever they hold

    A matrix with that many rows (or columns) gives ``name[1]``, ``name[2]``, ... Single numbers
    become constants. Arrays of another length or kind are left out, by name; a channel is refused.
    """
    shaped = {n: a if hasattr(a, "dtype") else np.asarray(a) for n, a in arrays.items()}
    numeric = {n: a for n, a in shaped.items() if a.dtype.kind in "fiub" and a.size}
    length = _common_length(numeric)
    constants = {n: a for n, a in numeric.items() if a.size == 1 and length != 1}
    used = {
        n: a for n, a in numeric.items() if n not in constants and length in a.shape and a.ndim <= 2
    }
    left_out = [n for n in arrays if n not in used and n not in constants]
    if not used:
        way_out = "state [file] group in the mapping, or export columns of equal length"
        raise recorder.error("file", "no arrays of numbers", way_out)
    for name in (TIME, *CHANNELS):
        if name in shaped and name not in used and not any(fnmatchcase(name, p) for p in ignore):
            rule = f"{name} is {_kind(arrays[name], shaped[name])}, no column of {length} numbers"
            raise recorder.error("column", rule, "repair it, or list it in [file] ignore")
    refuse_excess(sum(map(_size, (used | constants).values())), recorder)
    if left_out:
        names = ", ".join(map(repr, left_out[:8])) + (" ..." if len(left_out) > 8 else "")
        recorder.add("text_column", f"{names}: no column of {length} numbers, not used")
    columns: dict[str, NDArray[Any]] = {}
    for name, array in used.items():
        columns |= _columns(name, array[()], length)
    return Table(
        columns,
        np.arange(1, length + 1, dtype=np.int64),
        units={n: u for n, u in (units or {}).items() if n in columns and u},
        long_names={n: text for n, text in (long_names or {}).items() if n in columns and text},
        constants={n: float(np.ravel(a[()])[0]) for n, a in constants.items()},
        layout=dict(layout or {}),
        unused=frozenset(left_out) | frozenset(constants),
    )


def _size(array: Any) -> int:
    return int(array.size) if isinstance(array, np.ndarray) else numbers_to_read(array)


def _kind(given: Any, array: Any) -> str:
    """What an array is that can't be a column, in words."""
    if given is None:
        return "a link into nothing"
    if array.dtype.kind == "c":
        return "complex"
    if array.dtype.kind not in "fiub":
        return "not numeric"
    return f"of shape {'x'.join(map(str, array.shape))}" if array.shape else "a single number"


def _common_length(arrays: Mapping[str, Any]) -> int:
    """Length of the longest dimension that occurs most often."""
    lengths = [max(a.shape) for a in arrays.values() if 0 < a.ndim <= 2 and a.size > 1]
    return max(sorted(set(lengths), reverse=True), key=lengths.count) if lengths else 1


def _columns(name: str, array: NDArray[Any], length: int) -> dict[str, NDArray[Any]]:
    if array.ndim == 1 or 1 in array.shape:
        return {name: array.ravel().astype(np.float64)}
    upright = array if array.shape[0] == length else array.T
    return {f"{name}[{k + 1}]": upright[:, k].astype(np.float64) for k in range(upright.shape[1])}
