"""Reading a recording: file -> table -> rows wanted -> clock -> channels -> trace."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from .assemble import assemble
from .channels import Channel, read_channel
from .clock import read_clock, time_column
from .csv_file import read_csv
from .hdf5_file import read_hdf5
from .hdf5_trace import is_trace_file, read_trace
from .log import Recorder
from .mapping import ColumnRule, TraceMap
from .mapping_file import find_mapping, read_mapping
from .mat_file import read_mat
from .names import CHANNELS
from .selection import select_rows
from .table import Table, find_column, numbers
from .trace import Source, Trace

__all__ = ["read", "read_parts", "read_table"]

_FORMATS = {".csv": "csv", ".txt": "csv", ".tsv": "csv", ".dat": "csv", ".asc": "csv"}
_FORMATS |= {".h5": "hdf5", ".hdf5": "hdf5", ".hdf": "hdf5", ".nc": "hdf5", ".mat": "mat"}


def read(
    path: str | Path,
    mapping: TraceMap | str | Path | None = None,
    *,
    strict: bool = False,
    group: str = "",
) -> Trace:
    """Read a recording (CSV, HDF5 or MAT) as one trace in SI.

    mapping:  how its columns become channels; the mapping file beside it when left out, else the
              canonical names in its header
    strict:   raise at the first trouble instead of repairing it and noting that in ``trace.log``
    group:    group of an HDF5 file or variable of a MAT file, where it holds several recordings

    Raises TraceError naming file, rows, rule and way out.
    """
    path = Path(path)
    recorder = Recorder(path, strict=strict)
    _refuse_folder(path, recorder)
    if mapping is None and not group and find_mapping(path) is None and is_trace_file(path):
        return read_trace(path, recorder)
    mapping = _mapping(path, mapping)
    table = read_table(path, mapping, recorder, group)
    if len(table.rows) < 2:
        rows = table.rows.tolist()
        raise recorder.error("file", "fewer than two rows", "record for longer", rows)
    rules = _rules(table, mapping, recorder)
    ignored = _ignored(table, mapping, recorder) - set(rules)
    clock = time_column(table, mapping.time, recorder)
    select_rows(table, mapping.rows, recorder)
    seconds, set_back, start = read_clock(table, mapping.time, clock, recorder)
    _code_texts(table, mapping, recorder)
    wanted = [name for name in table.columns if name not in {clock, *ignored}]
    for name in table.ambiguous.intersection(wanted, CHANNELS):
        find_column(table, name, recorder, why="channel")  # refuses
    channels: list[Channel] = []
    for name in wanted:
        rule = rules.get(name, ColumnRule())
        if channel := read_channel(table, name, rule, mapping.file, recorder):
            channels.append(channel)
        del table.columns[name]  # a long recording is not held twice
    _check_channels(channels, recorder)
    _name_unmapped(channels, rules, recorder)
    trace = assemble(path.stem, table, seconds, set_back, channels, mapping.time, recorder)
    source = Source(path.name, table.layout, mapping.as_dict(), mapping.origin, start)
    return replace(trace, source=source, log=recorder.log())


def read_parts(
    path: str | Path, mapping: TraceMap | str | Path | None = None, *, strict: bool = False
) -> list[Trace]:
    """Read a recording and split it as its mapping says; one part when it says nothing."""
    return read(path, mapping, strict=strict).split()


def read_table(path: Path, mapping: TraceMap, recorder: Recorder, group: str = "") -> Table:
    """The columns of a file as they stand in it."""
    _refuse_folder(path, recorder)
    if not path.is_file():
        where = "" if path.parent == Path() else f" in {path.parent}"
        raise recorder.error("file", f"there is no such file{where}", "check its name")
    if path.stat().st_size == 0:
        raise recorder.error("file", "the file is empty", "export the recording again")
    layout = replace(mapping.file, group=group) if group else mapping.file
    kind = layout.format or _FORMATS.get(path.suffix.lower()) or _by_content(path)
    try:
        if kind == "hdf5":
            return read_hdf5(path, layout, recorder, mapping.time.column)
        if kind == "mat":
            return read_mat(path, layout, recorder)
        return read_csv(path, layout, recorder)
    except OSError as error:
        reason = error.strerror or str(error)
        raise recorder.error("file", f"cannot be read: {reason}", "check its rights") from None


def _refuse_folder(path: Path, recorder: Recorder) -> None:
    if path.is_dir():
        raise recorder.error("file", "a folder, no file", "name a recording")


def _by_content(path: Path) -> str:
    with path.open("rb") as file:
        head = file.read(520)
    if head.startswith(b"MATLAB"):
        return "mat"
    return "hdf5" if head.startswith(b"\x89HDF\r\n") else "csv"


def _mapping(path: Path, mapping: TraceMap | str | Path | None) -> TraceMap:
    if isinstance(mapping, TraceMap):
        return mapping
    beside = find_mapping(path) if mapping is None else Path(mapping)
    return TraceMap() if beside is None else read_mapping(beside)


def _rules(table: Table, mapping: TraceMap, recorder: Recorder) -> dict[str, ColumnRule]:
    """The mapping's rules under the names the columns have in the table."""
    return {
        find_column(table, name, recorder, why=f'[columns."{name}"]'): rule
        for name, rule in mapping.columns.items()
    }


def _ignored(table: Table, mapping: TraceMap, recorder: Recorder) -> set[str]:
    """Columns that match a pattern of ``file.ignore``."""
    ignored: set[str] = set()
    for pattern in mapping.file.ignore:
        if "*" in pattern or "?" in pattern:
            ignored |= {name for name in table.columns if fnmatchcase(name, pattern)}
        elif pattern not in table.unused:
            ignored.add(find_column(table, pattern, recorder, why="file.ignore"))
    return ignored


def _code_texts(table: Table, mapping: TraceMap, recorder: Recorder) -> None:
    """Number the texts of columns that separate parts, so that they can be kept as channels."""
    for wanted in mapping.split.by:
        name = find_column(table, wanted, recorder, why="split.by uses column")
        column = table.columns[name]
        if column.dtype != object or not numbers(column)[1].any():
            continue
        texts = sorted({str(cell) for cell in column})
        codes = [float(texts.index(str(cell))) for cell in column]
        table.columns[name] = np.array(codes)
        legend = ", ".join(f"{text} = {code}" for code, text in enumerate(texts))
        recorder.add("converted", f"{name}: texts numbered: {legend}")


def _name_unmapped(
    channels: list[Channel], rules: Mapping[str, ColumnRule], recorder: Recorder
) -> None:
    """Columns that no model reads shall not pass for channels."""
    own = [c.name for c in channels if c.is_extra and c.column not in rules]
    if own:
        names = "their own names" if len(own) > 1 else "its own name"
        recorder.add("unmapped", f"not mapped, kept under {names}: {', '.join(own)}")


def _check_channels(channels: list[Channel], recorder: Recorder) -> None:
    seen: dict[str, str] = {}
    for channel in channels:
        if channel.name in seen:
            rule = f"columns {seen[channel.name]!r} and {channel.column!r} both give {channel.name}"
            raise recorder.error("duplicate_column", rule, "map one of them to another channel")
        seen[channel.name] = channel.column
    if not any(channel.name in CHANNELS or channel.rule.channel for channel in channels):
        rule = f"no column is a known channel, found: {', '.join(seen) or 'none'}"
        way_out = "write a mapping file (dualdrive map proposes one)"
        raise recorder.error("column", rule, way_out)
