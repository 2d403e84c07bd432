"""Measured data in: recordings become traces in SI, with nothing repaired in silence.

from dualdrive.traces import read
trace = read("axis_c.csv")          # canonical names in the header, or axis_c.map.toml beside it
trace["theta_m"], trace.log
"""

from __future__ import annotations

from .guess import guess_mapping, propose
from .labelled import from_pandas, from_xarray
from .log import KINDS, Issue, Log, TraceError
from .mapping import ColumnRule, FileLayout, RowRule, SplitRule, TimeRule, TraceMap
from .mapping_file import find_mapping, read_mapping, write_mapping
from .names import CHANNELS
from .proposal import ColumnGuess, Proposal
from .reading import read, read_parts
from .trace import Source, Trace

__all__ = [
    "CHANNELS",
    "KINDS",
    "ColumnGuess",
    "ColumnRule",
    "FileLayout",
    "Issue",
    "Log",
    "Proposal",
    "RowRule",
    "Source",
    "SplitRule",
    "TimeRule",
    "Trace",
    "TraceError",
    "TraceMap",
    "find_mapping",
    "from_pandas",
    "from_xarray",
    "guess_mapping",
    "propose",
    "read",
    "read_mapping",
    "read_parts",
    "write_mapping",
]
