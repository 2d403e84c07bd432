"""HDF5: one group with ``t`` and the channels beside it, each with its unit.

That is how dualdrive writes its own runs and traces, so a simulated run can be read as a trace.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dualdrive.hdf5 import datasets

from .arrays import table_of
from .hdf5_trace import opened
from .log import Recorder
from .mapping import FileLayout
from .names import TIME
from .table import Table

__all__ = ["read_hdf5"]


def read_hdf5(path: Path, wanted: FileLayout, recorder: Recorder, time: str = "") -> Table:
    """Read the group that holds the clock; a group is named in the mapping where there are several.

    time: dataset that is the clock, ``t`` unless the mapping says otherwise
    """
    with opened(path) as file:
        return _table(_group(file, wanted.group, time or TIME, recorder), wanted, recorder)


def _group(file: Any, wanted: str, time: str, recorder: Recorder) -> Any:
    import h5py

    if wanted:
        if isinstance(file.get(wanted), h5py.Group):
            return file[wanted]
        way_out = f"the file has: {', '.join(_names(file, h5py.Group)) or 'no group'}"
        raise recorder.error("file", f"no group {wanted!r}", way_out)
    clocks = [name for name in datasets(file) if f"/{name}".endswith(f"/{time}")]
    every = [name.removesuffix(time).rstrip("/") or "/" for name in clocks]
    # what stands within a recording (the events of a run) belongs to it
    groups = [g for g in every if not any(g.startswith(f"{other}/") for other in every)]
    if len(groups) == 1:
        return file[groups[0]]
    if groups:
        way_out = f"name one of: {', '.join(groups)}"
        raise recorder.error("file", f"{len(groups)} groups hold a recording", way_out)
    if any(isinstance(item, h5py.Dataset) for item in file.values()):
        return file
    way_out = "state [file] group and [time] column in the mapping"
    raise recorder.error("file", f"no group with a dataset {time!r}", way_out)


def _names(file: Any, kind: type) -> list[str]:
    found: list[str] = []
    file.visititems(lambda name, item: found.append(name) if isinstance(item, kind) else None)
    return found


def _table(group: Any, wanted: FileLayout, recorder: Recorder) -> Table:
    found = datasets(group)
    leaves = [name.rsplit("/", 1)[-1] for name in found]
    named = {
        leaf if leaves.count(leaf) == 1 else name.replace("/", "."): item
        for (name, item), leaf in zip(found.items(), leaves, strict=True)
    }
    there = {name: item.attrs for name, item in named.items() if item is not None}
    return table_of(
        named,
        recorder,
        units={name: _text(attributes, "unit", "units") for name, attributes in there.items()},
        long_names={name: _text(attributes, "long_name") for name, attributes in there.items()},
        layout={"format": "hdf5", "group": group.name},
        ignore=wanted.ignore,
    )


def _text(attributes: Any, *keys: str) -> str:
    for key in keys:
        value = attributes.get(key, "")
        if isinstance(value, bytes | np.bytes_):
            value = value.decode("utf-8", errors="replace")
        if isinstance(value, str) and value:
            return value
    return ""
