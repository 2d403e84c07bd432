"""The time base: from a column of numbers or dates to seconds that only increase."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.units import UnitError, conversion

from .log import Recorder
from .mapping import TimeRule
from .mapping_file import duration
from .table import Table, find_column, numbers

__all__ = ["read_clock", "time_column"]

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

CLOCK_NAMES: Final = ("t", "time", "timestamp", "zeit", "time_s", "datetime", "date", "uhrzeit")

# Dates that can be read only one way. 03/04/2025 is two dates: its pattern must be stated.
_DATES: Final = ("iso", "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S,%f", "%d.%m.%Y %H:%M:%S")
_DATES_TODAY: Final = ("%H:%M:%S.%f", "%H:%M:%S,%f", "%H:%M:%S")


def time_column(table: Table, rule: TimeRule, recorder: Recorder) -> str:
    """Name of the clock's column; empty where the mapping states a sample time instead."""
    if rule.column:
        return find_column(table, rule.column, recorder, why="[time] column")
    found = [name for name in table.columns if name.lower() in CLOCK_NAMES]
    if len(found) > 1 and "t" in found:
        found = ["t"]
    if len(found) == 1:
        return find_column(table, found[0], recorder, why="clock")
    if rule.sample_time:
        return ""
    rule_text = (
        "several columns could be the clock: " + ", ".join(found) if found else "no column t"
    )
    way_out = "state [time] column or sample_time in the mapping"
    raise recorder.error("column", rule_text, way_out)


def read_clock(
    table: Table, rule: TimeRule, column: str, recorder: Recorder
) -> tuple[Floats, list[int], str]:
    """Return seconds, the rows at which time was set back, and the absolute start if known.

    Rows of `table` that have no time of their own are taken out of it, by name.
    """
    if rule.sample_time:
        step = duration(rule.sample_time, "time.sample_time")
        return (table.rows - table.rows[0]) * step, [], ""
    seconds, start = _seconds(table, rule, column, recorder)
    readable = np.isfinite(seconds)
    if not readable.all():
        if np.count_nonzero(readable) < 2:
            rule_text = f"{column}: no time can be read, e.g. {table.columns[column][0]!r}"
            way_out = "state [time] format, e.g. %m/%d/%Y %H:%M:%S.%f"
            raise recorder.error("no_time", rule_text, way_out)
        recorder.add("no_time", f"{column}: rows left out", table.rows[~readable])
        table.take(readable)
        seconds = seconds[readable]
    if rule.wrap:
        seconds = _count_on(seconds, rule, column, table, recorder)
    seconds = _repeated(seconds, rule, table, recorder)
    seconds, breaks = _backwards(seconds, rule, table, recorder)
    return seconds - (seconds[0] if rule.zero and len(seconds) else 0.0), breaks, start


def _seconds(table: Table, rule: TimeRule, column: str, recorder: Recorder) -> tuple[Floats, str]:
    values, bad = numbers(table.columns[column])
    if np.count_nonzero(bad) > len(bad) // 2:
        return _dates(table.columns[column], rule, column, recorder)
    if rule.format:
        rule_text = f"time.format = {rule.format!r} is of texts, and {column} holds numbers"
        raise recorder.error("mapping", rule_text, "state [time] unit instead")
    unit = rule.unit or table.units.get(column, "") or "s"
    try:
        return values * conversion(unit, "s").scale, ""
    except UnitError as error:
        way_out = "state [time] unit, e.g. ms"
        raise recorder.error("unit", f"{column}: {error}", way_out) from None


def _dates(
    cells: NDArray[Any], rule: TimeRule, column: str, recorder: Recorder
) -> tuple[Floats, str]:
    """Host time stamps as seconds since the first, and the first as ISO text."""
    import pandas as pd

    for pattern in (rule.format,) if rule.format else (*_DATES, *_DATES_TODAY):
        style = "ISO8601" if pattern == "iso" else pattern
        try:
            stamps = pd.to_datetime(pd.Series(cells), format=style, utc=True, errors="coerce")
        except ValueError as error:
            rule_text = f"time.format = {pattern!r}: {error}"
            raise recorder.error("mapping", rule_text, "correct the pattern") from None
        known = stamps.notna().to_numpy()
        if rule.format or 10 * np.count_nonzero(known) >= 9 * np.count_nonzero(~_empty(cells)):
            break
    else:
        return np.full(len(cells), np.nan), ""
    if not known.any():
        return np.full(len(cells), np.nan), ""
    first = stamps[known].iloc[0]
    seconds: Floats = np.asarray((stamps - first).dt.total_seconds(), dtype=np.float64)
    zone = "Z" if any(str(cell).endswith(("Z", "+00:00")) for cell in cells[:2]) else ""
    text = first.tz_localize(None).isoformat() + zone
    return seconds, "" if pattern in _DATES_TODAY else text


def _empty(cells: NDArray[Any]) -> Mask:
    return np.array([cell is None for cell in cells])


def _count_on(
    seconds: Floats, rule: TimeRule, column: str, table: Table, recorder: Recorder
) -> Floats:
    """Undo the overflows of a clock that counts up to `rule.wrap`."""
    unit = rule.unit or table.units.get(column, "") or "s"
    period = rule.wrap * conversion(unit, "s").scale
    over = np.flatnonzero(np.diff(seconds) < -0.5 * period)
    if over.size:
        recorder.add("clock_wrap", f"{column}: counts on past {rule.wrap:g}", table.rows[over + 1])
    turns = np.zeros(len(seconds))
    turns[over + 1] = 1.0
    return np.asarray(seconds + period * np.cumsum(turns))


def _repeated(seconds: Floats, rule: TimeRule, table: Table, recorder: Recorder) -> Floats:
    """Rows that share their time stamp with the row before."""
    same = np.concatenate([[False], np.diff(seconds) == 0])
    if not same.any():
        return seconds
    twin = same.copy()
    for column in table.columns.values():
        twin[1:] &= _equal(column[1:], column[:-1])
    if twin.any():
        recorder.add("repeated_row", "rows left out", table.rows[twin])
        table.take(~twin)
        seconds, same = seconds[~twin], same[~twin]
    if not same.any():
        return seconds
    rows = table.rows[same]
    if rule.repeated == "refuse":
        way_out = 'write repeated = "first", "last" or "spread" in [time], or state sample_time'
        raise recorder.error("repeated_time", "different rows at one time", way_out, rows)
    if rule.repeated == "spread":
        recorder.add("repeated_time", "spread evenly up to the next time stamp", rows)
        return _spread(seconds, same)
    keep = ~same if rule.repeated == "first" else ~np.append(same[1:], False)
    recorder.add("repeated_time", f"only the {rule.repeated} row of each time kept", rows)
    table.take(keep)
    return np.asarray(seconds[keep])


def _equal(a: NDArray[Any], b: NDArray[Any]) -> Mask:
    equal = np.asarray(a == b, dtype=bool)
    if a.dtype != object:
        equal |= np.isnan(a) & np.isnan(b)
    return equal


def _spread(seconds: Floats, same: Mask) -> Floats:
    """Share the time to the next stamp evenly among the rows of one stamp."""
    first = np.flatnonzero(~same)
    count = np.diff(np.append(first, len(seconds)))
    stamps = seconds[first]
    steps = np.diff(stamps)
    usual = float(np.median(steps)) if steps.size else 0.0
    until_next = np.minimum(np.append(steps, usual), usual) if usual > 0 else np.append(steps, 0.0)
    place = np.arange(len(seconds)) - np.repeat(first, count)
    return np.asarray(seconds + place * np.repeat(until_next / count, count))


def _backwards(
    seconds: Floats, rule: TimeRule, table: Table, recorder: Recorder
) -> tuple[Floats, list[int]]:
    """Refuse a clock that is set back, or begin a new segment there when that is asked for."""
    steps = np.diff(seconds)
    back = np.flatnonzero(steps < 0) + 1
    if not back.size:
        return seconds, []
    rows = table.rows[back]
    if rule.backwards == "refuse":
        way_out = 'cut the file there, or write backwards = "split" or wrap = its period in [time]'
        raise recorder.error("time_backwards", "time runs backwards", way_out, rows)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    recorder.add("time_backwards", "a new segment begins", rows)
    shift = np.zeros(len(seconds))
    shift[back] = 100 * usual - steps[back - 1]  # clearly a pause, of unknown true length
    return seconds + np.cumsum(shift), [int(i) for i in back]
