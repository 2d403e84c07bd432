"""Long series on disk, and what a screen of so many pixels can show of them.

A store is a folder with ``series.json`` and one array per column (NumPy's own format, never a
pickle). Files are mapped, not read: the memory of a view is what it touches. A series longer than
the screen is reduced to the least and the greatest value of every pixel, so that no spike is ever
lost; a coarse copy (least and greatest of every 64 samples) keeps that fast at any length.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.files import write_atomically
from dualdrive.workbench.limits import BLOCK

__all__ = ["Column", "Reduced", "Store", "nearest", "reduced", "write_store"]

Array = NDArray[np.float64]
_INDEX: Final = "series.json"
_COARSE: Final = 50 * BLOCK  # samples from which on a coarse copy is worth its file


@dataclass(frozen=True)
class Column:
    """A series as it is announced: SI unit, words, least and greatest value."""

    name: str
    unit: str
    long_name: str
    low: float
    high: float


def write_store(
    folder: Path,
    records: Mapping[str, tuple[Array, Mapping[str, tuple[Array, str, str]]]],
) -> None:
    """Write a store; the index comes last, so that a store is there whole or not at all.

    records: record -> times and {column: (values of shape (n,), SI unit, words)}
    """
    folder.mkdir(parents=True, exist_ok=True)
    index: dict[str, Any] = {}
    for r, (record, (t, columns)) in enumerate(records.items()):
        np.save(folder / f"{r}-t.npy", np.asarray(t, dtype=np.float64), allow_pickle=False)
        own = {}
        for k, (name, (values, unit, words)) in enumerate(columns.items()):
            y = np.asarray(values, dtype=np.float64)
            np.save(folder / f"{r}-{k}.npy", y, allow_pickle=False)
            if len(y) >= _COARSE:
                np.save(folder / f"{r}-{k}-blocks.npy", _blocks(y), allow_pickle=False)
            low, high = (float(f(y)) if len(y) else 0.0 for f in (np.min, np.max))
            own[name] = {"unit": unit, "long_name": words, "low": low, "high": high}
        span = [float(t[0]), float(t[-1])] if len(t) else [0.0, 0.0]
        index[record] = {"samples": len(t), "span": span, "columns": own}
    with write_atomically(folder / _INDEX) as temporary:
        temporary.write_text(json.dumps(index, allow_nan=False), "utf-8")


def _blocks(y: Array) -> Array:
    """Least and greatest value of every block, shape (2, blocks)."""
    starts = np.arange(0, len(y), BLOCK)
    return np.stack([np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)])


class Store:
    """A store that is read: ``index`` as written, columns by record and name.

    Raises KeyError for a record or column that is not there: names are looked up, never joined to
    a path.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.index: dict[str, Any] = json.loads((folder / _INDEX).read_text("utf-8"))
        self._number = {record: r for r, record in enumerate(self.index)}

    def times(self, record: str) -> Array:
        """Of a record, in s, shape (n,)."""
        return self._mapped(f"{self._number[record]}-t.npy")

    def values(self, record: str, column: str) -> Array:
        """SI, shape (n,)."""
        return self._mapped(f"{self._stem(record, column)}.npy")

    def blocks(self, record: str, column: str) -> Array | None:
        """The coarse copy, shape (2, blocks), where there is one."""
        name = f"{self._stem(record, column)}-blocks.npy"
        return self._mapped(name) if (self.folder / name).is_file() else None

    def column(self, record: str, column: str) -> Column:
        """What is known of a column without reading it."""
        own = self.index[record]["columns"][column]
        return Column(column, own["unit"], own["long_name"], own["low"], own["high"])

    def _stem(self, record: str, column: str) -> str:
        names = list(self.index[record]["columns"])
        if column not in self.index[record]["columns"]:
            raise KeyError(column)
        return f"{self._number[record]}-{names.index(column)}"

    def _mapped(self, name: str) -> Array:
        return _map(str(self.folder / name))


@lru_cache(maxsize=512)
def _map(path: str) -> Array:
    found: Array = np.load(path, mmap_mode="r", allow_pickle=False)
    return found


@dataclass(frozen=True, eq=False)
class Reduced:
    """A stretch of series as it is drawn: times of shape (m,), values of shape (columns, m).

    exact: every sample of the stretch is there; else least and greatest value of every pixel, NaN
        where a pixel has no sample
    """

    t: Array
    values: Array
    exact: bool


def reduced(
    store: Store, record: str, columns: Sequence[str], start: float, stop: float, pixels: int
) -> Reduced:
    """The stretch start .. stop (s) of some columns on so many pixels; KeyError as `Store`."""
    t = store.times(record)
    first, last = (int(i) for i in np.searchsorted(t, [start, stop]))
    first, last = max(first - 1, 0), min(last + 1, len(t))  # lines go on past the edge
    if last - first <= 2 * pixels:
        values = [store.values(record, name)[first:last] for name in columns]
        return Reduced(np.array(t[first:last]), np.array(values), exact=True)
    edges = np.linspace(start, stop, pixels + 1)
    cut = np.searchsorted(t, edges)
    cut[0], cut[-1] = first, last
    rows = [_extremes(store, record, name, cut) for name in columns]
    width = (stop - start) / pixels
    at = (edges[:-1, None] + width * np.array([0.25, 0.75])).ravel()
    return Reduced(at, np.array(rows), exact=False)


def _extremes(store: Store, record: str, name: str, cut: NDArray[np.intp]) -> Array:
    """Least and greatest value between each cut and the next, shape (2 * pixels,)."""
    blocks = store.blocks(record, name)
    if blocks is not None and cut[-1] - cut[0] > 8 * BLOCK * (len(cut) - 1):
        return _of_sources(blocks[0], blocks[1], cut // BLOCK)
    y = store.values(record, name)
    return _of_sources(y, y, cut)


def _of_sources(low: Array, high: Array, cut: NDArray[np.intp]) -> Array:
    first, last = int(cut[0]), max(int(cut[-1]), int(cut[0]) + 1)
    starts = np.minimum(cut[:-1], last - 1) - first
    out = np.empty((len(starts), 2))
    out[:, 0] = np.minimum.reduceat(low[first:last], starts)
    out[:, 1] = np.maximum.reduceat(high[first:last], starts)
    out[np.diff(cut) <= 0] = np.nan
    return out.ravel()


def nearest(store: Store, record: str, columns: Sequence[str], at: float) -> tuple[float, Array]:
    """Time and values, shape (columns,), of the sample nearest to `at` (s)."""
    t = store.times(record)
    k = int(np.searchsorted(t, at))
    if k == len(t) or (k > 0 and at - t[k - 1] < t[k] - at):
        k -= 1
    return float(t[k]), np.array([store.values(record, name)[k] for name in columns])
