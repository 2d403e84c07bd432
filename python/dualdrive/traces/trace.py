"""A measured trace: channels over time in SI, and the story of how they were read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive.units import parse

from .log import Log, TraceError
from .names import CHANNELS, TIME, is_canonical

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["Source", "Trace"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Source:
    """Where a trace comes from.

    start is the absolute time of the file's first row as ISO text where the file knows it.
    """

    file: str = ""
    layout: Mapping[str, str] = field(default_factory=dict)
    mapping: Mapping[str, Any] = field(default_factory=dict)
    mapping_file: str = ""
    start: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Trace:
    """Channels over time, all float64 in SI, finite, read-only.

    t:          seconds, strictly increasing, shape (n,)
    channels:   name -> values, shape (n,); canonical names and the file's extra columns
    units:      SI unit of each channel; canonical ones have theirs anyway
    rows:       row of the file behind each sample
    breaks:     samples that begin a new segment after a pause or a counter that was set back
    labels:     settings that hold throughout (a part's TestIndex)
    constants:  single numbers that stood beside the columns

    Raises TraceError where lengths differ, time does not increase, or a value is not finite.
    """

    t: Floats
    channels: Mapping[str, Floats]
    units: Mapping[str, str] = field(default_factory=dict)
    long_names: Mapping[str, str] = field(default_factory=dict)
    name: str = "trace"
    labels: Mapping[str, float] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    rows: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    breaks: tuple[int, ...] = ()
    log: Log = field(default_factory=Log)
    source: Source = field(default_factory=Source)

    def __post_init__(self) -> None:
        t = _own(self.t)
        channels = {name: _own(values) for name, values in self.channels.items()}
        rows = np.asarray(self.rows, dtype=np.int64)
        rows = np.arange(1, len(t) + 1) if not rows.size else rows.copy()
        rows.flags.writeable = False
        units = {n: self.units.get(n, CHANNELS[n].unit if n in CHANNELS else "") for n in channels}
        texts = {n: CHANNELS[n].long_name if n in CHANNELS else n for n in channels}
        texts |= {n: text for n, text in self.long_names.items() if n in channels and text}
        own = {"t": t, "rows": rows, "breaks": tuple(int(i) for i in self.breaks)}
        own |= {"channels": MappingProxyType(channels), "units": MappingProxyType(units)}
        own |= {"long_names": MappingProxyType(texts)}
        own |= {"labels": MappingProxyType(dict(self.labels))}
        own |= {"constants": MappingProxyType(dict(self.constants))}
        for key, value in own.items():
            object.__setattr__(self, key, value)
        self._check()

    def _check(self) -> None:
        def fail(rule: str, rows: Sequence[int] = ()) -> TraceError:
            return TraceError(f"{self.name}: {rule}; give other arrays", kind="column", rows=rows)

        if self.t.ndim != 1 or len(self.t) < 1:
            raise fail("t must be a row of at least one number")
        if not np.isfinite(self.t).all() or (np.diff(self.t) <= 0).any():
            raise fail("t must be finite and strictly increasing")
        if len(self.rows) != len(self.t):
            raise fail(f"{len(self.rows)} row numbers for {len(self.t)} samples")
        if any(not 0 < i < len(self.t) for i in self.breaks):
            raise fail(f"breaks {self.breaks} must lie inside 1..{len(self.t) - 1}")
        for name, values in self.channels.items():
            if values.shape != self.t.shape:
                raise fail(f"{name} has shape {values.shape}, t has {self.t.shape}")
            if not np.isfinite(values).all():
                raise fail(f"{name} is not finite", self.rows[~np.isfinite(values)].tolist())
            if name in CHANNELS and self.units[name] != CHANNELS[name].unit:
                raise fail(f"{name} is in {self.units[name]!r}, not {CHANNELS[name].unit}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Read-only views of a mapping don't travel: the trace is made again from plain ones."""
        own = (getattr(self, f.name) for f in fields(self))
        return type(self), tuple(dict(v) if isinstance(v, MappingProxyType) else v for v in own)

    # --- looking at it -----------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.t)

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def __contains__(self, name: object) -> bool:
        return name == TIME or name in self.channels

    def __getitem__(self, name: str) -> Floats:
        """Values of one channel, or of ``t``. TraceError names what there is instead."""
        if name == TIME:
            return self.t
        if name not in self.channels:
            has = ", ".join(self.channels) or "none"
            message = f"{self.name}: no channel {name!r}; the channels are: {has}"
            raise TraceError(message, kind="name")
        return self.channels[name]

    @property
    def canonical(self) -> tuple[str, ...]:
        """Channels whose meaning dualdrive knows."""
        return tuple(name for name in self.channels if is_canonical(name))

    @property
    def extra(self) -> tuple[str, ...]:
        """The other columns of the file."""
        return tuple(name for name in self.channels if not is_canonical(name))

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s, pauses included."""
        return float(self.t[-1] - self.t[0])

    @property
    def step(self) -> float:
        """Median time step in s; zero for a single sample."""
        return float(np.median(np.diff(self.t))) if len(self) > 1 else 0.0

    def same_samples(self, other: Trace) -> bool:
        """Whether both have the same known channels with the same values, whatever their clocks."""
        names = set(self.canonical)
        alike = names and names == set(other.canonical)
        return bool(alike) and all(np.array_equal(self[name], other[name]) for name in names)

    def __repr__(self) -> str:
        from .show import as_text

        return as_text(self)

    def _repr_html_(self) -> str:
        from .show import as_html

        return as_html(self)

    # --- taking parts ------------------------------------------------------------------------

    def take(self, which: slice | ArrayLike, *, name: str = "", log: Log | None = None) -> Trace:
        """The samples of a slice, a mask or increasing indices; a hole inside makes a break.

        Raises TraceError when nothing is left or the order would change.
        """
        chosen = which if isinstance(which, slice) else np.asarray(which)
        if not isinstance(chosen, slice) and chosen.dtype == bool and chosen.shape != self.t.shape:
            rule = f"a mask of shape {chosen.shape} for {len(self)} samples"
            raise TraceError(f"{self.name}: {rule}; give one value per sample", kind="name")
        index = np.arange(len(self))[chosen]
        if not index.size or (np.diff(index) <= 0).any():
            rule = "no sample left" if not index.size else "samples must stay in order"
            raise TraceError(f"{self.name}: {rule}; take other samples", kind="name")
        segment = np.zeros(len(self), dtype=np.int64)
        segment[list(self.breaks)] = 1
        segment = np.cumsum(segment)[index]
        breaks = np.flatnonzero((np.diff(segment) != 0) | (np.diff(index) > 1)) + 1
        rows = self.rows[index]
        return replace(
            self,
            t=self.t[index],
            channels={n: values[index] for n, values in self.channels.items()},
            rows=rows,
            breaks=tuple(breaks.tolist()),
            name=name or self.name,
            log=(self.log if log is None else log).within(rows.tolist()),
        )

    def between(self, start: float | str, stop: float | str) -> Trace:
        """The samples with start <= t <= stop (numbers in s, or text such as ``200ms``)."""
        first, last = (parse(x, "s", key="time") for x in (start, stop))
        return self.take((self.t >= first) & (self.t <= last))

    def segments(self, min_samples: int = 2) -> list[Trace]:
        """The stretches between breaks that have at least `min_samples` samples."""
        edges = [0, *self.breaks, len(self)]
        spans = [slice(a, b) for a, b in pairwise(edges)]
        return [self.take(s) for s in spans if s.stop - s.start >= min_samples]

    def split(
        self, *by: str, settle: float | str = 0.0, min_time: float | str = 0.0
    ) -> list[Trace]:
        """Parts between the changes of the channels `by`; the file's own rule when none is given.

        settle:    time in s to leave out at the start of each part
        min_time:  parts shorter than this are left out; their rows are named in every part's log
        """
        from .parts import split

        return split(self, by, parse(settle, "s"), parse(min_time, "s"))

    # --- making others -----------------------------------------------------------------------

    def from_zero(self) -> Trace:
        """The same trace with t starting at 0."""
        return replace(self, t=self.t - self.t[0])

    def with_channel(
        self, name: str, values: ArrayLike, unit: str = "", long_name: str = ""
    ) -> Trace:
        """The trace with one channel more, or one replaced. `values` has shape (n,), in SI."""
        unit = unit or (CHANNELS[name].unit if name in CHANNELS else "")
        return replace(
            self,
            channels={**self.channels, name: np.asarray(values, dtype=np.float64)},
            units={**self.units, name: unit},
            long_names={**self.long_names, name: long_name},
        )

    def without(self, *names: str) -> Trace:
        """The trace without some of its channels."""
        return replace(self, channels={n: v for n, v in self.channels.items() if n not in names})

    def difference(
        self, first: str, second: str, *, ratio: float = 1.0, turn: float | None = None
    ) -> Floats:
        """Return ``first - ratio * second``, shape (n,), unwrapped per segment.

        turn: period in rad of what the two encoders can tell; whole turns between them are taken
              out, so that the difference starts within half a turn of zero and does not jump
        """
        from .parts import difference

        return difference(self, first, second, ratio, turn)

    def resample(self, step: float | str | None = None, *, method: str = "auto") -> Trace:
        """The trace on even steps; see `dualdrive.traces.resample` for the methods and limits."""
        from .resample import resample

        return resample(self, None if step is None else parse(step, "s", key="step"), method)

    def to_pandas(self) -> pd.DataFrame:
        """A data frame with one column per channel and t as index."""
        from .export import to_pandas

        return to_pandas(self)

    def to_xarray(self) -> xr.Dataset:
        """A dataset over dimension t, with ``units`` and ``long_name`` on each variable."""
        from .export import to_xarray

        return to_xarray(self)

    def to_csv(self, path: str | Path) -> Path:
        """Write a CSV: times and channels as they are, but neither log nor labels.

        Raises TraceError when it cannot be written; nothing is left half-written.
        """
        from .export import to_csv

        return to_csv(self, Path(path))

    def to_hdf5(self, path: str | Path) -> Path:
        """Write an HDF5 file that `read` reads back whole: log, labels, source and all.

        Raises TraceError when it cannot be written; nothing is left half-written.
        """
        from .export import to_hdf5

        return to_hdf5(self, Path(path))


def _own(values: ArrayLike) -> Floats:
    """A read-only copy, so that nobody can change a trace from outside."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array
