"""A proposal how to read a file whose columns have names of their own.

Only a proposal: it is written as a mapping file with its reasons as comments, for a person to
confirm. `read` never guesses by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .clock import CLOCK_NAMES, read_clock
from .csv_layout import count_columns
from .log import Recorder, TraceError
from .mapping import ColumnRule, FileLayout, TimeRule, TraceMap
from .names import CHANNELS, is_canonical
from .proposal import ColumnGuess, Proposal, agreeing, tried
from .reading import read_table
from .relations import related
from .table import Table, numbers
from .words import Meaning, meaning, words_of

__all__ = ["guess_mapping", "propose"]

_NO_CLOCK: Final = "No clock found, 1 ms assumed: state [time] column, or sample_time."
_COUNTS: Final = 50  # whole numbers that spread this far without a unit are hardly SI
_SETTING: Final = 12  # different values, at most, of what is set and not measured ...
_LONG: Final = 1000  # ... in a record of this many rows
_CLOCKED: Final = 10  # rows, at least, of a clock that has no name
_CLOCK_UNIT: Final = {"s": "s", "sec": "s", "seconds": "s", "ms": "ms", "us": "us", "min": "min"}


def guess_mapping(path: str | Path, drives: Sequence[int] | None = None) -> TraceMap:
    """The mapping that `propose` proposes, with reasons and doubts in ``notes``."""
    return propose(path, drives).mapping


def propose(path: str | Path, drives: Sequence[int] | None = None) -> Proposal:
    """Propose a mapping for a recording from its header words, units and values.

    drives: numbers in the columns' names that are drive 1 (and drive 2): (3,) for axis 3 of a
            robot; found by itself where left out, and said in the notes

    Raises TraceError where the file cannot be read as a table at all.
    """
    return _Guess(Path(path), drives).proposal()


class _Guess:
    """The columns of one file on their way to a proposal."""

    def __init__(self, path: Path, drives: Sequence[int] | None) -> None:
        self.path = path
        self.recorder = Recorder(path, strict=False)
        self.notes: list[str] = []
        self.table, self.names = self._table()
        self.clock, self.time = _guess_clock(self.table, self.notes)
        self.said = {c: meaning(c, self.table.units.get(c, "")) for c in self.table.columns}
        self.drives = tuple(drives) if drives else self._drives()
        self.taken: dict[str, str] = {}
        self.rules: dict[str, ColumnRule] = {}
        self.why: dict[str, str] = {}
        self.assumed: dict[str, str] = {}

    def _table(self) -> tuple[Table, tuple[str, ...]]:
        """The file as a table; columns without a header are numbered."""
        try:
            return read_table(self.path, TraceMap(), self.recorder), ()
        except TraceError as error:
            if "no header" not in str(error):
                raise
        count = count_columns(self.path, self.recorder)
        names = tuple(f"column {k}" for k in range(1, count + 1))
        layout = FileLayout(names=names)
        self.notes.append("The file has no header: its columns are numbered here.")
        return read_table(self.path, TraceMap(file=layout), self.recorder), names

    def _drives(self) -> tuple[int, ...]:
        """Which numbers in the names are the drives of one machine, told where it is a choice."""
        counted = [m for m in self.said.values() if m.quantity and m.number is not None]
        axes = sorted({m.number for m in counted if m.axis and m.number})
        if len(axes) == 1:
            return (axes[0],)
        if axes:
            listed = ", ".join(map(str, axes))
            if axes == [1, 2]:
                self.notes.append(
                    "Axes 1 and 2 are taken for the two drives of one machine; if each is an axis "
                    "of its own: --drives 1 or --drives 2."
                )
                return 1, 2
            self.notes.append(
                f"Axes {listed}: each has a motor of its own, and a machine is one axis; axis "
                f"{axes[0]} is taken, --drives {axes[-1]} takes axis {axes[-1]}."
            )
            return (axes[0],)
        motors = sorted({m.number for m in counted if m.of_a_drive and m.number})
        if set(motors) <= {1, 2}:
            return 1, 2
        taken = tuple(motors[:2])
        listed, told = ", ".join(map(str, motors)), " and ".join(map(str, taken))
        others = "" if len(motors) == 1 else f"; --drives {motors[-2]},{motors[-1]} takes others"
        self.notes.append(
            f"Drives {listed}: a machine has one or two; {told} taken as "
            f"{' and '.join(map(str, (1, 2)[: len(taken)]))}{others}."
        )
        return taken

    def proposal(self) -> Proposal:
        for column in self.table.columns:
            self._by_name(column)
        self._by_values()
        if not self.rules:
            self.notes.append("No channel recognised: add [columns] by hand.")
        mapping = TraceMap(file=self._layout(), time=self.time, columns=self.rules)
        rules, told = agreeing(self.path, mapping, self.taken, self.table)
        self.assumed |= told
        mapping = replace(mapping, columns=rules)
        self.notes += tried(self.path, mapping)
        guesses = tuple(self._guess(c, rules) for c in self.table.columns if c != self.clock)
        left = [g for g in guesses if not g.channel]
        head = f"Proposal for {self.path.name}; check every line, signs above all."
        notes = [head, *self.notes, *(f"{g.column}: {g.reason}" for g in guesses if g.channel)]
        notes += [f"{g.column}: not mapped: {g.reason}" for g in left]
        return Proposal(self.path, replace(mapping, notes=tuple(notes)), guesses, (*self.notes,))

    def _layout(self) -> FileLayout:
        found = self.table.layout
        return FileLayout(
            format=found["format"].split()[0],
            encoding=found.get("encoding", ""),
            delimiter=found.get("delimiter", ""),
            decimal=found.get("decimal", ""),
            names=self.names,
        )

    def _by_name(self, column: str) -> None:
        """Give a column the channel that its name says, or say why it gets none."""
        said = self.said[column]
        if column == self.clock:
            return
        if column in self.table.ambiguous:
            self.why[column] = "more than one column has this name"
        elif not _is_numeric(self.table, column):
            self.why[column] = "holds no numbers"
        elif is_canonical(column):
            self._take(column, column, "", "a canonical name")
        elif not said.quantity:
            self.why[column] = "its name says no angle, speed, torque, current or voltage"
        elif said.number is not None and self._elsewhere(said):
            what = "axis" if said.axis else "drive"
            self.why[column] = f"of {what} {said.number}, which is not taken"
        else:
            drive = self._drive(said)
            channel = said.channel(drive)
            words = ", ".join(f'"{word}"' for word in said.words)
            if not channel:
                self.why[column] = f"says {words}, but not of which drive or place"
            elif channel == "T_load" and self._set_by_hand(column):
                self.why[column] = f"says {words}, but holds few values, as a setting does"
            elif channel in self.taken:
                also = f"could also be {channel}, like {self.taken[channel]}"
                self.why[column] = f"{also}; kept as extra"
            else:
                self._take(column, channel, said.unit, f"says {words}", said.current)

    def _set_by_hand(self, column: str) -> bool:
        values, _ = numbers(self.table.columns[column])
        return len(values) >= _LONG and len(np.unique(values[np.isfinite(values)])) <= _SETTING

    def _elsewhere(self, said: Meaning) -> bool:
        """Whether it belongs to a drive or axis that is not taken; there is one command alone."""
        if said.axis or said.role == "ref":
            mine = self.drives if said.of_a_drive else self.drives[:1]
            counts = {m.number for m in self.said.values() if m.role == said.role and m.quantity}
            return said.number not in mine and (said.axis or len(counts) > 1)
        return said.of_a_drive and said.number not in self.drives

    def _drive(self, said: Meaning) -> int | None:
        """1 or 2; 1, too, for a motor without number where no other has one."""
        if said.number in self.drives:
            return self.drives.index(said.number) + 1
        numbered = any(m.of_a_drive and m.number is not None for m in self.said.values())
        return None if said.number is not None or numbered else 1

    def _take(self, column: str, channel: str, unit: str, why: str, current: str = "") -> None:
        stated = self.table.units.get(column, "")
        self.taken[channel] = column
        self.rules[column] = ColumnRule(
            channel=channel, unit="" if unit == stated else unit, current=current
        )
        told = "" if unit or stated else f"; no unit stated, {CHANNELS[channel].unit} assumed"
        self.why[column] = why
        self.assumed[column] = told

    def _by_values(self) -> None:
        """Columns whose names say nothing, where names alone gave no angle of the table."""
        if {"theta_m", "theta_ref", "theta_1"} & self.taken.keys():
            return
        silent = [
            c for c, m in self.said.items()
            if c not in self.rules and c != self.clock and not m.quantity
            and _is_numeric(self.table, c)
        ]  # fmt: skip
        t = None
        if self.clock:
            t, _, _ = read_clock(self.table, self.time, self.clock, self.recorder)
        columns = {c: numbers(self.table.columns[c])[0] for c in silent}
        found, step = related(t, columns)
        for column in silent:
            channel, why = found.get(column, ("", ""))
            if channel and channel not in self.taken:
                self._take(column, channel, "", why)
            else:
                self.why[column] = "neither its name nor its values say what it is"
        if found:
            self.notes.append(
                "Names say nothing here, so values had to: of a linear axis state unit = 'm' (m/s, "
                "N) and radius = '1 m'."
            )
        if step:
            self.time = TimeRule(sample_time=f"{step:g} s")
            self.notes.remove(_NO_CLOCK)
            self.notes.append(
                f"No clock; sample time {step:g} s, by which the speed is the rate of the angle."
            )
        if self.table.constants:
            listed = ", ".join(f"{n} = {v:.6g}" for n, v in self.table.constants.items())
            self.notes.append(f"Numbers beside the columns, for scales perhaps: {listed}.")

    def _guess(self, column: str, rules: dict[str, ColumnRule]) -> ColumnGuess:
        values, _ = numbers(self.table.columns[column])
        known = values[np.isfinite(values)]
        low, high = (float(f(known)) if known.size else np.nan for f in (np.min, np.max))
        rule = rules.get(column)
        channel = rule.channel if rule else ""
        stated = self.table.units.get(column, "")
        unit = (rule.unit if rule else "") or stated
        why = self.why[column] + self.assumed.get(column, "")
        if channel and not unit:
            unit = CHANNELS[channel].unit
            why += _counts(known)
        if not channel and known.size and low == high:
            why += f"; always {low:g}"
        return ColumnGuess(column, channel, unit, low, high, why)


def _counts(known: NDArray[np.float64]) -> str:
    """What whole numbers without a unit may be."""
    if not (known == np.round(known)).all() or np.ptp(known) < _COUNTS:
        return ""
    bit = int(np.log2(max(known.max(), 1.0)))
    below = known[known < 2.0**bit]
    signed = known.min() >= 0 and below.size and below.max() < 2.0 ** (bit - 1)
    sign = f", their sign in bit {bit} (sign_bit = {bit})" if signed else ""
    return f": whole numbers, counts perhaps{sign}; state unit and scale, e.g. '1/4096' of turn"


def _is_numeric(table: Table, column: str) -> bool:
    values, bad = numbers(table.columns[column])
    return bool(np.count_nonzero(np.isfinite(values)) > np.count_nonzero(bad))


def _guess_clock(table: Table, notes: list[str]) -> tuple[str, TimeRule]:
    for column in table.columns:
        words = words_of(column)
        if column.lower() not in CLOCK_NAMES and not {"time", "zeit", "timestamp"} & set(words):
            continue
        values, bad = numbers(table.columns[column])
        if np.count_nonzero(bad) > len(bad) // 2:
            notes.append(f"{column}: dates; time counts from the first row.")
            return column, TimeRule(column=column)
        unit = table.units.get(column, "") or _CLOCK_UNIT.get(words[-1], "")
        if not unit:
            return column, _in_unit(column, values, notes, f"{column}: no unit stated")
        return column, TimeRule(column=column, unit=unit)
    first = next(iter(table.columns), "")
    if first and not meaning(first, table.units.get(first, "")).quantity:
        values, bad = numbers(table.columns[first])
        if not bad.any() and _rises_evenly(values):
            return first, _in_unit(first, values, notes, f"{first} rises evenly: the clock")
    notes.append(_NO_CLOCK)
    return "", TimeRule(sample_time="1ms")


def _in_unit(column: str, values: NDArray[np.float64], notes: list[str], why: str) -> TimeRule:
    """A clock whose unit its steps must tell."""
    steps = np.diff(values[np.isfinite(values)])
    step = float(np.median(steps)) if steps.size else 0.0
    unit = "ms" if step >= 0.5 and step == round(step) else "s"
    notes.append(f"{why}, {unit} assumed from steps of {step:.4g}.")
    return TimeRule(column=column, unit=unit)


def _rises_evenly(values: NDArray[np.float64]) -> bool:
    """Whether no value is further from a straight line than a step of it."""
    if values.size < _CLOCKED or not (np.diff(values) > 0).all():
        return False
    line = np.linspace(values[0], values[-1], values.size)
    return bool(np.abs(values - line).max() < line[1] - line[0])
