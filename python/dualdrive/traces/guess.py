"""A proposal how to read a file whose columns have names of their own.

Only a proposal: it is written as a mapping file with its reasons as comments, for a person to
confirm. `read` never guesses by itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from .clock import CLOCK_NAMES
from .log import Recorder, TraceError
from .mapping import ColumnRule, FileLayout, TimeRule, TraceMap
from .names import CHANNELS, is_canonical
from .rates import PAIRS, rate_ratio
from .read import read, read_table
from .table import Table, numbers

__all__ = ["guess_mapping"]

# Words of headers, English and German, lower case.
_QUANTITY: Final = {
    "theta": "position pos angle theta phi lage winkel istlage sollage",
    "omega": "speed velocity vel omega drehzahl geschwindigkeit rpm dps",
    "T": "torque moment drehmoment trq nm",
    "I": "current strom amp amps",
    "U": "voltage spannung volt",
}
_ROLE: Final = {
    "ref": "ref reference set setpoint target command commanded cmd demand soll sollwert sollage",
    "pinion": "pinion ritzel joint",
    "motor": "motor mot drive fc inverter antrieb umrichter servo master slave",
    "table": "table ring load axis tisch achse direct last output secondary enc encoder",
}
_INDEX: Final = {"1": "1 a master", "2": "2 b slave"}
_UNIT: Final = {
    "rad": "rad", "mrad": "mrad", "deg": "deg", "degree": "deg", "arcsec": "arcsec",
    "rpm": "rpm", "dps": "deg/s", "nm": "N*m", "knm": "kN*m", "ma": "mA", "mm": "mm", "um": "um",
    "pct": "%", "percent": "%",
}  # fmt: skip
# Change of a raw angle over the integral of a raw speed -> their likely units.
_RATES: Final = {
    1.0: ("rad", "rad/s"),
    6.0: ("deg", "rpm"),
    180 / np.pi: ("deg", "rad/s"),
    360.0: ("deg", "turn/s"),
    np.pi / 30: ("rad", "rpm"),
    1 / 60: ("turn", "rpm"),
}
_CLOCK_UNIT: Final = {"s": "s", "sec": "s", "seconds": "s", "ms": "ms", "us": "us", "min": "min"}


def guess_mapping(path: str | Path) -> TraceMap:
    """Propose a mapping for a recording from its header words, units and values.

    The reasons, and what could not be told, are in ``notes``. Raises TraceError where the file
    cannot be read as a table at all.
    """
    path = Path(path)
    recorder = Recorder(path, strict=False)
    table = read_table(path, TraceMap(), recorder)
    notes = [f"Proposal for {path.name}; check every line, signs above all."]
    clock, time = _guess_clock(table, notes)
    columns: dict[str, ColumnRule] = {}
    taken: dict[str, str] = {}
    for column in table.columns:
        if column == clock or column in table.ambiguous or not _is_numeric(table, column):
            continue
        channel, unit = _guess_channel(column, table.units.get(column, ""))
        if channel and channel in taken:
            notes.append(f"{column}: could also be {channel}, like {taken[channel]}; kept as extra")
        elif channel:
            taken[channel] = column
            columns[column] = _rule(channel, unit, table.units.get(column, ""))
            if not unit:
                notes.append(_assumed(column, channel))
    if not columns:
        notes.append("No channel recognised: add [columns] by hand.")
    layout = table.layout
    stated = FileLayout(
        format=layout["format"].split()[0],
        encoding=layout.get("encoding", ""),
        delimiter=layout.get("delimiter", ""),
        decimal=layout.get("decimal", ""),
    )
    mapping = TraceMap(file=stated, time=time, columns=columns)
    mapping = replace(mapping, columns=_agreeing(path, mapping, taken, table, notes))
    return replace(mapping, notes=(*notes, *_tried(path, mapping)))


def _agreeing(
    path: Path, mapping: TraceMap, taken: dict[str, str], table: Table, notes: list[str]
) -> dict[str, ColumnRule]:
    """The rules with units and signs under which angles are the integrals of their speeds."""
    rules = dict(mapping.columns)
    try:
        trace = read(path, mapping)
    except TraceError:
        return rules
    for theta, omega in PAIRS:
        if theta not in trace or omega not in trace:
            continue
        pauses = np.array(trace.breaks, dtype=np.int64)
        ratio = rate_ratio(trace.t, trace[theta], trace[omega], pauses)
        angle, speed = taken[theta], taken[omega]
        if ratio is None or any(rules[c].unit or table.units.get(c) for c in (angle, speed)):
            continue
        for factor, units in _RATES.items():
            if abs(abs(ratio) / factor - 1) < 0.1:
                sign = 1 if ratio > 0 else -1
                rules[angle] = replace(rules[angle], unit=units[0], sign=sign)
                rules[speed] = replace(rules[speed], unit=units[1])
                flip = ", counted the other way" if sign < 0 else ""
                words = f"{angle} in {units[0]} and {speed} in {units[1]}{flip}"
                notes.append(f"{words}: so that they agree (ratio {ratio:.4g}).")
                for assumed in (_assumed(angle, theta), _assumed(speed, omega)):
                    notes.remove(assumed)
    return rules


def _tried(path: Path, mapping: TraceMap) -> Iterable[str]:
    """What reading with the proposal says about itself: contradictions, wraps, resets."""
    try:
        trace = read(path, mapping)
    except TraceError as error:
        return [f"Reading with it fails: {error}"]
    return [str(issue) for kind in ("rates", "wrapped", "reset") for issue in trace.log[kind]]


def _is_numeric(table: Table, column: str) -> bool:
    values, bad = numbers(table.columns[column])
    return bool(np.count_nonzero(np.isfinite(values)) > np.count_nonzero(bad))


def _words(name: str) -> list[str]:
    """Lower-case words of a name: ``FC1Torque`` -> fc 1 torque; ``ax1_vel_dps`` -> ax 1 vel dps."""
    parted = re.sub(r"(?<=[a-zäöü])(?=[A-Z])|(?<=[^\W\d_])(?=\d)|(?<=\d)(?=[^\W\d_])", " ", name)
    return re.findall(r"[^\W\d_]+|\d+", parted.lower())


def _guess_clock(table: Table, notes: list[str]) -> tuple[str, TimeRule]:
    for column in table.columns:
        words = _words(column)
        if column.lower() not in CLOCK_NAMES and not {"time", "zeit", "timestamp"} & set(words):
            continue
        values, bad = numbers(table.columns[column])
        if np.count_nonzero(bad) > len(bad) // 2:
            notes.append(f"{column}: dates; time counts from the first row.")
            return column, TimeRule(column=column)
        unit = table.units.get(column, "") or _CLOCK_UNIT.get(words[-1], "")
        if not unit:
            steps = np.diff(values[np.isfinite(values)])
            step = float(np.median(steps)) if steps.size else 0.0
            unit = "ms" if step >= 0.5 and step == round(step) else "s"
            notes.append(f"{column}: no unit stated, {unit} assumed from steps of {step:g}.")
        return column, TimeRule(column=column, unit=unit)
    notes.append("No clock found: state [time] column, or sample_time.")
    return "", TimeRule(sample_time="1ms")


def _find(words: list[str], vocabulary: dict[str, str]) -> str:
    """Key of the first entry one of the words belongs to; long words may be joined to others."""

    def meant(word: str, known: str) -> bool:
        joined = len(known) >= 4 and (word.startswith(known) or (len(known) >= 5 and known in word))
        return word == known or joined

    return next(
        (
            key
            for key, all_known in vocabulary.items()
            if any(meant(word, known) for word in words for known in all_known.split())
        ),
        "",
    )


def _assumed(column: str, channel: str) -> str:
    return f"{column}: no unit stated, {CHANNELS[channel].unit} assumed."


def _guess_channel(column: str, unit: str) -> tuple[str, str]:
    """Channel and unit of a column, empty where nothing fits."""
    if is_canonical(column):
        return column, unit
    words = _words(column)
    unit = unit or next((_UNIT[w] for w in reversed(words) if w in _UNIT), "")
    quantity, role, index = (_find(words, v) for v in (_QUANTITY, _ROLE, _INDEX))
    channel = _channel(quantity, role, index)
    return (channel, unit) if channel in CHANNELS else ("", "")


def _channel(quantity: str, role: str, index: str) -> str:
    if quantity in ("I", "U"):
        return f"{quantity}_{index}"
    if quantity == "T":
        return "T_load" if role == "table" else f"T_{index}"
    if not quantity:
        return ""
    if role == "ref":
        return f"{quantity}_ref"
    if role == "pinion":
        return f"{quantity}_c{index}"
    if role == "motor":
        return f"{quantity}_{index}"
    return f"{quantity}_m" if role == "table" else ""


def _rule(channel: str, unit: str, stated: str) -> ColumnRule:
    """Units that the file states itself need not be repeated."""
    return ColumnRule(channel=channel, unit="" if unit == stated else unit)
