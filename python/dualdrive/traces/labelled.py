"""Traces from labelled arrays: what `Trace.to_pandas` and `Trace.to_xarray` give, and the like."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dualdrive.units import UnitError, coherent, conversion

from .log import TraceError
from .names import CHANNELS, TIME
from .trace import Trace

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["from_pandas", "from_xarray"]


def from_pandas(
    frame: pd.DataFrame, units: Mapping[str, str] | None = None, *, name: str = ""
) -> Trace:
    """A trace from a data frame: the index is time in s (or time deltas), a column a channel.

    Args:
        frame: numbers, one row per sample; rows must be in order and finite.
        units: column -> unit of its numbers; ``frame.attrs["units"]`` unless given, else SI.
        name: of the trace; ``frame.attrs["name"]`` unless given.

    Raises:
        TraceError: naming column, unit or time, rule and way out.

    """
    told = dict(units if units is not None else frame.attrs.get("units", {}))
    called = name or str(frame.attrs.get("name", "trace"))
    columns = {str(c): frame[c].to_numpy() for c in frame.columns}
    return _trace(frame.index.to_numpy(), columns, told, {}, called)


def from_xarray(dataset: xr.Dataset, *, name: str = "") -> Trace:
    """A trace from a dataset over dimension ``t``: units and names from the variables' attributes.

    Args:
        dataset: one-dimensional variables over ``t`` (s); others are refused.
        name: of the trace; ``dataset.attrs["name"]`` unless given.

    Raises:
        TraceError: naming variable, unit or dimension, rule and way out.

    """
    called = name or str(dataset.attrs.get("name", "trace"))
    for key, variable in dataset.data_vars.items():
        if variable.dims != (TIME,):
            rule = f"{key} is over {', '.join(map(str, variable.dims)) or 'nothing'}, not over t"
            raise TraceError(f"{called}: {rule}; select one first", kind="column")
    variables = {str(key): v for key, v in dataset.data_vars.items()}
    units = {key: str(v.attrs["units"]) for key, v in variables.items() if "units" in v.attrs}
    words = {key: str(v.attrs.get("long_name", "")) for key, v in variables.items()}
    values = {key: v.to_numpy() for key, v in variables.items()}
    return _trace(dataset[TIME].to_numpy(), values, units, words, called)


def _trace(
    t: Any,
    columns: Mapping[str, Any],
    units: Mapping[str, str],
    words: Mapping[str, str],
    name: str,
) -> Trace:
    if np.issubdtype(t.dtype, np.timedelta64):
        t = t / np.timedelta64(1, "s")
    channels, si = {}, {}
    for key, values in columns.items():
        try:
            given = units.get(key, CHANNELS[key].unit if key in CHANNELS else "")
            si[key] = CHANNELS[key].unit if key in CHANNELS else coherent(given)
            scale, offset = conversion(given, si[key])
            channels[key] = scale * np.asarray(values, dtype=np.float64) + offset
        except (UnitError, ValueError, TypeError) as error:
            raise TraceError(f"{name}: {key}: {error}; correct it", kind="unit") from None
    try:
        times = np.asarray(t, dtype=np.float64)
    except (ValueError, TypeError):
        raise TraceError(f"{name}: the index is no time in s; set it", kind="name") from None
    return Trace(t=times, channels=channels, units=si, long_names=words, name=name)
