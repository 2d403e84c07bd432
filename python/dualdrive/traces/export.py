"""A trace as data frame, dataset or file."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

from .atomic import write_atomically
from .log import TraceError
from .names import TIME

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from .trace import Trace

__all__ = ["to_csv", "to_hdf5", "to_pandas", "to_xarray"]


def to_pandas(trace: Trace) -> pd.DataFrame:
    """See `Trace.to_pandas`."""
    import pandas as pd

    frame = pd.DataFrame(dict(trace.channels), index=pd.Index(trace.t, name=TIME))
    frame.attrs = {"name": trace.name, "units": dict(trace.units)}
    return frame


def to_xarray(trace: Trace) -> xr.Dataset:
    """See `Trace.to_xarray`."""
    import xarray as xr

    variables = {
        name: (TIME, values, {"units": trace.units[name], "long_name": trace.long_names[name]})
        for name, values in trace.channels.items()
    }
    time = (TIME, trace.t, {"units": "s", "long_name": "time"})
    attributes = {"name": trace.name, **trace.labels}
    return xr.Dataset(variables, coords={TIME: time, "row": (TIME, trace.rows)}, attrs=attributes)


def to_csv(trace: Trace, path: Path) -> Path:
    """See `Trace.to_csv`."""
    for name in trace.channels:
        if not name.strip() or name != name.strip() or "\n" in name or "\r" in name:
            message = f"{path}: channel {name!r} cannot stand in a CSV header; rename it"
            raise TraceError(message, kind="name")
    heads = [f"{TIME} [s]", *(f"{name} [{trace.units[name]}]" for name in trace.channels)]
    frame = to_pandas(trace).reset_index()
    with write_atomically(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerow(heads)
        frame.to_csv(file, header=False, index=False, lineterminator="\n")
    return path


def to_hdf5(trace: Trace, path: Path) -> Path:
    """See `Trace.to_hdf5`. Made in memory first: HDF5 does not recover from a disk that is full."""
    import h5py

    from .hdf5_trace import write_trace

    image = io.BytesIO()
    with h5py.File(image, "w", track_order=True) as file:
        write_trace(trace, file)
    with write_atomically(path) as temporary:
        temporary.write_bytes(image.getbuffer())
    return path
