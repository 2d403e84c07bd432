"""The file of a sweep: a grid with labelled axes, written run by run, whole after any kill.

A file is laid out and filled with "nothing yet" under a temporary name, and takes its own name
only then. From there on no run changes its structure: results go into space that is there already,
first the numbers and, after a flush, the status that says they count. So a killed sweep leaves a
file that opens, a full disk is met before the first run, and what is missing can be told.

The library's default file format is kept on purpose: files opened for the newer formats or for
reading while writing carry a flag that a killed writer leaves set, and then do not open again.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

import h5py
import numpy as np

from dualdrive.figures import Figure
from dualdrive.files import FileError, write_atomically
from dualdrive.units import human

from .grid import Grid

__all__ = [
    "PENDING",
    "SCHEMA",
    "DiskError",
    "GridFile",
    "Kept",
    "Outcome",
    "attributes_of",
    "axes_of",
]

SCHEMA: Final = "dualdrive sweep 1"
PENDING: Final = "pending"

_STATUS_BYTES: Final = 24
_MESSAGE_BYTES: Final = 400


class DiskError(FileError):
    """The disk refuses: no room, no permission, a fault. The message is one line."""


@dataclass(frozen=True)
class Outcome:
    """What one run leaves: its number in the grid, figures, status, kept signals."""

    run: int
    figures: Mapping[str, float]
    status: str
    message: str = ""
    signals: Mapping[str, np.ndarray[Any, Any]] | None = None


@dataclass(frozen=True)
class Kept:
    """Whole signals to keep: output times in s, and (name, unit, long name) of each."""

    t: np.ndarray[Any, Any]
    signals: Sequence[tuple[str, str, str]]


class GridFile:
    """A sweep's file, open for writing; the one writer of its kind."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path = path
        self._file = file
        self._figures = _of_role(file, "figure")
        self._signals = _of_role(file, "signal")
        self._status, self._message = file["status"], file["message"]
        self.shape: tuple[int, ...] = self._status.shape

    @classmethod
    def create(
        cls,
        path: Path,
        grid: Grid,
        figures: Sequence[Figure],
        attributes: Mapping[str, Any],
        kept: Kept | None = None,
    ) -> Self:
        """Lay out the file of a grid in which every run is pending, and open it.

        Raises DiskError when the disk refuses or has no room for the whole grid.
        """
        _check_room(path, grid, len(figures), kept)
        try:
            with write_atomically(path) as temporary:
                _create(temporary, grid, figures, attributes, kept)
        except FileError as error:
            raise DiskError(str(error)) from None
        return cls.reopen(path)

    @classmethod
    def reopen(cls, path: Path) -> Self:
        """Open the file of a sweep to go on with it. Raises FileError if it is none, or in use."""
        attributes_of(path)
        try:
            return cls(path, h5py.File(path, "r+"))
        except OSError as error:
            raise _cannot_open(path, error, "in use by another program; close it there") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; what was written is there."""
        with suppress(OSError, RuntimeError):  # a full disk has been reported by `write`
            self._file.close()

    def pending(self) -> np.ndarray[Any, Any]:
        """Numbers of the runs that are still to be done, shape (n,)."""
        return np.flatnonzero(self._status[...].ravel() == PENDING.encode())

    def write(self, outcomes: Iterable[Outcome]) -> None:
        """Put finished runs in their places. Raises DiskError when the disk refuses."""
        outcomes = list(outcomes)
        try:
            for outcome in outcomes:
                self._write_numbers(outcome)
            self._file.flush()
            for outcome in outcomes:
                index = np.unravel_index(outcome.run, self.shape)
                self._status[index] = outcome.status.encode()
            self._file.flush()
        except (OSError, RuntimeError) as error:
            raise DiskError(
                f"{self.path}: cannot be written: {_reason(error)}; runs already there are kept, "
                "--resume completes them"
            ) from None

    def _write_numbers(self, outcome: Outcome) -> None:
        index = np.unravel_index(outcome.run, self.shape)
        for name, dataset in self._figures.items():
            dataset[index] = outcome.figures.get(name, np.nan)
        self._message[index] = _fit(outcome.message, _MESSAGE_BYTES)
        for name, values in (outcome.signals or {}).items():
            self._signals[name][(*index, slice(0, len(values)))] = values


def attributes_of(path: Path) -> dict[str, Any]:
    """The root attributes of a sweep's file. Raises FileError when it is none of this version."""
    try:
        with h5py.File(path, "r") as file:
            found = dict(file.attrs)
    except OSError as error:
        raise _cannot_open(path, error) from None
    schema = str(found.get("schema", ""))
    if not schema.startswith(SCHEMA.rstrip("1")):
        raise FileError(f"{path}: is not a sweep; name a file that 'dualdrive sweep' wrote")
    if schema != SCHEMA:
        version = found.get("version", "?")
        raise FileError(
            f"{path}: schema = {schema!r}: this version reads {SCHEMA!r}; use dualdrive {version}"
        )
    return found


def axes_of(path: Path) -> dict[str, np.ndarray[Any, Any]]:
    """The axes of a sweep's file in order: path -> SI values."""
    names = json.loads(attributes_of(path)["axes"])
    with h5py.File(path, "r") as file:
        return {name: file[name][...] for name in names}


def _create(
    path: Path,
    grid: Grid,
    figures: Sequence[Figure],
    attributes: Mapping[str, Any],
    kept: Kept | None,
) -> None:
    try:
        with h5py.File(path, "w") as file:
            _lay_out(file, grid, figures, kept)
            file.attrs.update({"schema": SCHEMA, **attributes})
    except (OSError, RuntimeError) as error:
        raise OSError(_reason(error)) from error


def _lay_out(file: h5py.File, grid: Grid, figures: Sequence[Figure], kept: Kept | None) -> None:
    scales = [_scale(file, a.path, a.values, a.unit, a.long_name) for a in grid.axes]
    for name, unit, long_name in figures:
        _dataset(file, name, scales, np.dtype("f8"), np.nan, unit, long_name, "figure")
    texts = (
        ("status", _STATUS_BYTES, PENDING, "how the run ended; pending: not yet"),
        ("message", _MESSAGE_BYTES, "", "what went wrong and what to try"),
    )
    for name, length, fill, long_name in texts:
        kind = np.dtype(f"S{length}")
        text = _dataset(file, name, scales, kind, np.bytes_(fill), "", long_name, "state")
        text.attrs["_Encoding"] = "utf-8"  # read as text by xarray
    if kept is not None:
        scales = [*scales, _scale(file, "t", kept.t, "s", "time")]
        for name, unit, long_name in kept.signals:
            _dataset(file, name, scales, np.dtype("f8"), np.nan, unit, long_name, "signal")


def _of_role(file: h5py.File, role: str) -> dict[str, h5py.Dataset]:
    return {name: item for name, item in file.items() if item.attrs["role"] == role}


def _scale(
    file: h5py.File, name: str, values: np.ndarray[Any, Any], unit: str, long_name: str
) -> h5py.Dataset:
    scale = file.create_dataset(name, data=values)
    _describe(scale, unit, long_name, "axis")
    scale.make_scale(name)
    return scale


def _dataset(
    file: h5py.File,
    name: str,
    scales: Sequence[h5py.Dataset],
    dtype: np.dtype[Any],
    fill: Any,
    unit: str,
    long_name: str,
    role: str,
) -> h5py.Dataset:
    """A dataset whose space is taken and filled now, so that later writes only replace bytes."""
    space = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    space.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    space.set_fill_time(h5py.h5d.FILL_TIME_ALLOC)
    shape = tuple(len(scale) for scale in scales)
    dataset = file.create_dataset(name, shape=shape, dtype=dtype, fillvalue=fill, dcpl=space)
    _describe(dataset, unit, long_name, role)
    for dimension, scale in zip(dataset.dims, scales, strict=True):
        dimension.attach_scale(scale)
    return dataset


def _describe(dataset: h5py.Dataset, unit: str, long_name: str, role: str) -> None:
    dataset.attrs["unit"] = unit
    dataset.attrs["units"] = unit  # the word that xarray knows
    dataset.attrs["long_name"] = long_name
    dataset.attrs["role"] = role


def _check_room(path: Path, grid: Grid, figures: int, kept: Kept | None) -> None:
    signals = len(kept.t) * len(kept.signals) if kept is not None else 0
    needed = grid.size * (8 * (figures + signals) + _STATUS_BYTES + _MESSAGE_BYTES)
    with suppress(OSError):  # no such folder: said where the file is made
        free = shutil.disk_usage(path.parent).free
        if needed > free:
            raise FileError(
                f"{path}: {grid.size:,} runs need {_size(needed)}, the disk has {_size(free)}; "
                f"take fewer points{' or keep fewer signals' if signals else ''}"
            )


def _size(count: float) -> str:
    return human(count, "B") if count < 1e12 else f"{count / 1e12:,.4g} TB"


def _fit(text: str, length: int) -> bytes:
    """UTF-8 of at most `length` bytes; a longer text ends in an ellipsis, so that it shows."""
    raw = text.encode()
    if len(raw) <= length:
        return raw
    return raw[: length - 3].decode(errors="ignore").encode() + "…".encode()


def _cannot_open(path: Path, error: OSError, otherwise: str = "") -> FileError:
    if isinstance(error, FileNotFoundError):
        why = "there is no such file"
    elif isinstance(error, PermissionError):
        why = "no permission to open it"
    elif isinstance(error, BlockingIOError) or "lock" in str(error):
        why = "in use by another program; close it there, or wait for it"
    else:
        why = otherwise or "is not a sweep; name a file that 'dualdrive sweep' wrote"
    return FileError(f"{path}: {why}")


def _reason(error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number:
        return os.strerror(number)
    return next((os.strerror(n) for n in (27, 28, 5) if f"errno = {n}," in str(error)), str(error))
