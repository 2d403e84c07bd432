"""The file of a sweep while it fills: results go to their places, and a kill harms none of them.

Once laid out, the file's structure never changes. The HDF5 library says where each result lies, and
from then on plain writes put it there, first a run's numbers and last the status that says they
count. So the file opens whenever its writer dies, a fault of the disk is a plain error, and others
may read while it fills.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import h5py
import numpy as np

from dualdrive.ensembles import Outcome
from dualdrive.files import FileError, WriteError
from dualdrive.hdf5 import reading

from .layout import PENDING, SCHEMA

__all__ = ["GridFile", "Outcome", "attributes_of", "axes_of", "refuse_filled"]

Array = np.ndarray[Any, Any]

_NOT_A_SWEEP: Final = "is not a sweep; name a file that 'dualdrive sweep' wrote"


class _Place(NamedTuple):
    """Where a dataset begins in the file, and how many bytes of it belong to each run."""

    begin: int
    size: int


class GridFile:
    """A sweep's file, open for its one writer. Raises FileError if it is none, or has a writer."""

    def __init__(self, path: Path) -> None:
        attributes_of(path)
        self.path = path
        with reading(path) as file:
            self._runs = int(np.prod(file["status"].shape[:-1]))
            self._places = {
                name: _Place(item.id.get_offset(), item.nbytes // self._runs)
                for name, item in file.items()
                if item.attrs["role"] != "axis"
            }
            self._figures = [n for n, item in file.items() if item.attrs["role"] == "figure"]
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        except OSError as error:
            raise FileError(f"{path}: cannot be opened: {error.strerror}") from None
        if not _locked(self._file) or not _is(path, self._file):
            os.close(self._file)
            raise FileError(f"{path}: another sweep is filling it; wait for it, or stop it")
        self._pending = self._still_pending()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Put what was written on the disk and close. Raises WriteError when the disk refuses."""
        try:
            os.fsync(self._file)
        except OSError as error:
            raise self._refused(error) from None
        finally:
            os.close(self._file)

    def _still_pending(self) -> Array:
        """Read under the lock, or runs that another sweep has just finished would be done again."""
        begin, size = self._places["status"]
        texts = np.frombuffer(os.pread(self._file, size * self._runs, begin), f"S{size}")
        return np.flatnonzero(texts == PENDING.encode())

    def pending(self) -> list[int]:
        """Numbers of the runs that were still to be done when the file was opened."""
        numbers: list[int] = self._pending.tolist()
        return numbers

    def write(self, outcomes: Iterable[Outcome]) -> None:
        """Put finished runs in their places. Raises WriteError when the disk refuses."""
        try:
            for neighbours in _neighbours(outcomes):
                self._write(neighbours)
        except OSError as error:
            raise self._refused(error) from None

    def _write(self, outcomes: Sequence[Outcome]) -> None:
        """Runs of consecutive numbers, whose places meet; last the status that says they count."""
        first = outcomes[0].run
        for name in self._figures:
            figures = [outcome.figures.get(name, np.nan) for outcome in outcomes]
            self._put(name, first, np.array(figures).data)
        for outcome in outcomes:
            for name, values in (outcome.signals or {}).items():
                self._put(name, outcome.run, np.ascontiguousarray(values, np.float64).data)
        for name in ("message", "status"):
            size = self._places[name].size
            texts = [_fit(getattr(outcome, name), size) for outcome in outcomes]
            self._put(name, first, memoryview(b"".join(texts)))

    def _put(self, name: str, run: int, content: memoryview) -> None:
        place = self._places[name]
        left, at = content.cast("B"), place.begin + run * place.size
        while left:
            written = os.pwrite(self._file, left, at)
            left, at = left[written:], at + written

    def _refused(self, error: OSError) -> WriteError:
        return WriteError(
            f"{self.path}: cannot be written: {error.strerror}; "
            "runs already there are kept, --resume completes them"
        )


def refuse_filled(path: Path) -> None:
    """Raise WriteError while a sweep is filling this file, which may be of any kind."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return  # whoever can't open it finds out on writing
    try:
        if not _locked(file, fcntl.LOCK_SH):
            raise WriteError(f"{path}: another sweep is filling it; wait for it, or stop it")
    finally:
        os.close(file)


def _locked(file: int, kind: int = fcntl.LOCK_EX) -> bool:
    """Take the lock of the one who fills an open file; False while another has it."""
    try:
        fcntl.lockf(file, kind | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _is(path: Path, file: int) -> bool:
    """Whether the open file still bears this name: another sweep may have put its own there."""
    return path.exists() and path.stat().st_ino == os.fstat(file).st_ino


def _neighbours(outcomes: Iterable[Outcome]) -> Iterator[list[Outcome]]:
    """Outcomes in order, those with consecutive numbers in one list."""
    found: list[Outcome] = []
    for outcome in sorted(outcomes, key=lambda outcome: outcome.run):
        if found and outcome.run != found[-1].run + 1:
            yield found
            found = []
        found.append(outcome)
    if found:
        yield found


def attributes_of(path: Path) -> dict[str, Any]:
    """The root attributes of a sweep's file. Raises FileError when it is none of this version."""
    if path.is_file() and not h5py.is_hdf5(path):
        raise FileError(f"{path}: {_NOT_A_SWEEP}")
    with reading(path) as file:
        found = dict(file.attrs)
    schema = str(found.get("schema", ""))
    if not schema.startswith(SCHEMA.rstrip("1")):
        raise FileError(f"{path}: {_NOT_A_SWEEP}")
    if schema != SCHEMA:
        version = found.get("version", "?")
        raise FileError(
            f"{path}: schema = {schema!r}: this version reads {SCHEMA!r}; use dualdrive {version}"
        )
    return found


def axes_of(path: Path) -> dict[str, Array]:
    """The axes of a sweep's file in order: path -> SI values."""
    names = json.loads(attributes_of(path)["axes"])
    with reading(path) as file:
        return {name: file[name][...] for name in names}


def _fit(text: str, length: int) -> bytes:
    """UTF-8 of this length; a longer text ends in an ellipsis, so that it shows."""
    raw = text.encode()
    if len(raw) > length:
        raw = raw[: length - 3].decode(errors="ignore").encode() + "…".encode()
    return raw.ljust(length, b"\0")
