"""How the file of a sweep is laid out: HDF5 with labelled axes, and room for every result.

A file is laid out and filled with "nothing yet" under a temporary name and takes its own name only
then. All space is taken at once, so that a disk without room is met before the first run.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from dualdrive.ensembles import PENDING
from dualdrive.figures import Figure
from dualdrive.files import FileError, WriteError, write_atomically
from dualdrive.units import human

from .grid import Grid

__all__ = ["PENDING", "SCHEMA", "Kept", "lay_file"]

SCHEMA: Final = "dualdrive sweep 1"

_STATUS_BYTES: Final = 24
_MESSAGE_BYTES: Final = 400
_STRUCTURE_BYTES: Final = 1_000_000  # more than the headers and attributes of any sweep need

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Kept:
    """Whole signals to keep: output times in s, and (name, unit, long name) of each."""

    t: Array
    signals: Sequence[tuple[str, str, str]]

    @property
    def size(self) -> int:
        """Numbers to keep per run."""
        return len(self.t) * len(self.signals)


def lay_file(
    path: Path,
    grid: Grid,
    figures: Sequence[Figure],
    attributes: Mapping[str, Any],
    kept: Kept | None = None,
    *,
    overwrite: bool = False,
) -> None:
    """Make the file of a grid in which every run is pending.

    Raises FileError when the grid is larger than the disk, WriteError when the disk refuses.
    """
    numbers = len(figures) + (kept.size if kept is not None else 0)
    needed = grid.size * (8 * numbers + _STATUS_BYTES + _MESSAGE_BYTES)
    _check_room(path, grid, needed)
    with write_atomically(path, overwrite=overwrite, flush=False) as temporary:  # flushed later
        _reserve(temporary, needed + _STRUCTURE_BYTES)
        with h5py.File(temporary, "w") as file:
            _lay_out(file, grid, figures, kept)
            file.attrs.update({"schema": SCHEMA, **attributes})


def _check_room(path: Path, grid: Grid, needed: int) -> None:
    """A grid no disk of this size could hold is a slip; one that is too full can be emptied."""
    try:
        disk = shutil.disk_usage(path.absolute().parent)
    except OSError:
        return  # no such folder: said where the file is made
    if needed > disk.free and disk.total:
        kind = FileError if needed > disk.total else WriteError
        raise kind(
            f"{path}: {grid.size:,} runs need {_size(needed)}, the disk has {_size(disk.free)}; "
            "take fewer points or keep fewer signals"
        )


def _size(count: float) -> str:
    return human(count, "B") if count < 1e12 else f"{count / 1e12:,.4g} TB"


def _reserve(path: Path, size: int) -> None:
    """Meet a full disk here, in plain words: in the midst of a write the HDF5 library may crash."""
    with path.open("rb+") as file:
        os.posix_fallocate(file.fileno(), 0, size)


def _lay_out(file: h5py.File, grid: Grid, figures: Sequence[Figure], kept: Kept | None) -> None:
    scales = [_scale(file, a.path, a.values, a.unit, a.long_name) for a in grid.axes]
    for name, unit, long_name in figures:
        _dataset(file, name, scales, np.dtype("f8"), np.nan, unit, long_name, "figure")
    _texts(file, "status", scales, _STATUS_BYTES, PENDING, "how the run ended; pending: not yet")
    _texts(file, "message", scales, _MESSAGE_BYTES, "", "what went wrong and what to try")
    if kept is not None:
        scales = [*scales, _scale(file, "t", kept.t, "s", "time")]
        for name, unit, long_name in kept.signals:
            _dataset(file, name, scales, np.dtype("f8"), np.nan, unit, long_name, "signal")


def _texts(
    file: h5py.File,
    name: str,
    scales: Sequence[h5py.Dataset],
    length: int,
    fill: str,
    long_name: str,
) -> None:
    """Texts as rows of characters along a nameless dimension, which xarray joins again.

    Texts in one piece would be plainer; the netCDF library, which xarray prefers where it is
    installed, crashes on those of fixed length.
    """
    characters = file.create_dataset(f"string{length}", shape=(length,), dtype=">f4")
    _describe(characters, "", "characters of a text", "axis")
    characters.make_scale(f"This is a netCDF dimension but not a netCDF variable.{length:10}")
    along = [*scales, characters]
    text = _dataset(file, name, along, np.dtype("S1"), np.bytes_(b""), "", long_name, "state")
    text.attrs["_Encoding"] = "utf-8"
    if fill:
        text[...] = np.array(list(fill.ljust(length, "\0")), dtype="S1")


def _scale(file: h5py.File, name: str, values: Array, unit: str, long_name: str) -> h5py.Dataset:
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
    """A dataset in one piece whose space is taken and filled now: results only replace bytes."""
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
