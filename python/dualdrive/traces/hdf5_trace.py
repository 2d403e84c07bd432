"""dualdrive's own trace files: HDF5 with everything a trace knows about itself.

Root datasets ``t`` and the channels (dimension scale t, attributes unit and long_name), so that
any HDF5 tool shows them; ``trace_rows``, ``trace_breaks``; the rest as JSON in attribute ``trace``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dualdrive.files import FileError
from dualdrive.hdf5 import datasets, numbers_to_read, reading

from .arrays import refuse_excess
from .log import Issue, Log, Recorder, TraceError
from .names import TIME

if TYPE_CHECKING:
    from .trace import Trace

__all__ = ["is_trace_file", "opened", "read_trace", "write_trace"]

SCHEMA: Final = "dualdrive trace 1"
_SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"  # of HDF5, where no user block comes before it
_OWN: Final = ("trace_rows", "trace_breaks")
_SLASH: Final = "\N{DIVISION SLASH}"  # HDF5 would take a plain one for a group


def write_trace(trace: Trace, file: Any) -> None:
    """Write a trace into an open, empty HDF5 file."""
    columns = [(TIME, trace.t, "s", "time")]
    columns += [(n, v, trace.units[n], trace.long_names[n]) for n, v in trace.channels.items()]
    for name, values, unit, long_name in columns:
        item = file.create_dataset(name.replace("/", _SLASH), data=values)
        item.attrs["unit"] = unit
        item.attrs["long_name"] = long_name
    file[TIME].make_scale(TIME)
    for name in trace.channels:
        file[name.replace("/", _SLASH)].dims[0].attach_scale(file[TIME])
    file.create_dataset(_OWN[0], data=trace.rows)
    file.create_dataset(_OWN[1], data=np.array(trace.breaks, dtype=np.int64))
    file.attrs["schema"] = SCHEMA
    file.attrs["trace"] = json.dumps(_story(trace))


def _story(trace: Trace) -> dict[str, Any]:
    source = trace.source
    return {
        "name": trace.name,
        "labels": dict(trace.labels),
        "constants": dict(trace.constants),
        "source": {
            "file": source.file,
            "layout": dict(source.layout),
            "mapping": dict(source.mapping),
            "mapping_file": source.mapping_file,
            "start": source.start,
        },
        "log": [[issue.kind, issue.message, list(issue.rows)] for issue in trace.log],
    }


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """An HDF5 file that is being read; what is amiss with it comes as a TraceError."""
    try:
        with reading(path, path.name) as file:
            yield file
    except FileError as error:
        raise TraceError(str(error), kind="file") from None


def is_trace_file(path: Path) -> bool:
    """Tell whether `path` was written by `Trace.to_hdf5`."""
    try:
        if not path.is_file() or not _begins_as_hdf5(path):
            return False
        import h5py

        with h5py.File(path, "r") as file:
            return bool(file.attrs.get("schema") == SCHEMA)
    except Exception:  # a damaged file: the reader for all HDF5 files says so
        return False


def _begins_as_hdf5(path: Path) -> bool:
    """Whether it may be one of ours: no other file is worth loading the library for."""
    with path.open("rb") as file:
        return file.read(len(_SIGNATURE)) == _SIGNATURE


@contextmanager
def _named(recorder: Recorder) -> Iterator[None]:
    """What a trace says of its own parts, with the name of the file that they were read from."""
    try:
        yield
    except TraceError as error:
        if str(error).startswith(f"{recorder.path.name}: "):
            raise
        raise recorder.error("file", f"damaged: {error}", "export it again") from None


def read_trace(path: Path, recorder: Recorder) -> Trace:
    """Read what `write_trace` wrote. In strict mode a trace that was repaired is refused."""
    from .trace import Source, Trace

    with opened(path) as file, _named(recorder):
        refuse_excess(sum(map(numbers_to_read, filter(None, datasets(file).values()))), recorder)
        story = json.loads(file.attrs["trace"])
        items = {n.replace(_SLASH, "/"): file[n] for n in file if n not in (TIME, *_OWN)}
        log = Log(tuple(Issue(kind, text, tuple(rows)) for kind, text, rows in story["log"]))
        for issue in log:
            recorder.add(issue.kind, issue.message, issue.rows)
        return Trace(
            t=file[TIME][()],
            channels={name: item[()] for name, item in items.items()},
            units={name: item.attrs["unit"] for name, item in items.items()},
            long_names={name: item.attrs["long_name"] for name, item in items.items()},
            name=story["name"],
            labels=story["labels"],
            constants=story["constants"],
            rows=file[_OWN[0]][()],
            breaks=tuple(file[_OWN[1]][()].tolist()),
            log=log,
            source=Source(**story["source"]),
        )
