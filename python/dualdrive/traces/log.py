"""What was found wrong with a recording, where, and what was done about it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from dualdrive.echo import shorten

__all__ = ["KINDS", "Issue", "Log", "Recorder", "TraceError", "row_ranges"]

# Kind of issue -> what it is. `note` kinds change nothing and never stop a strict reading.
KINDS: Final[dict[str, str]] = {
    "blank_row": "a row without any value",
    "no_time": "a row whose time cannot be read",
    "repeated_row": "a row that repeats the one before, time stamp included",
    "repeated_time": "different rows with one time stamp",
    "time_backwards": "time runs backwards",
    "clock_wrap": "the clock's counter starts again",
    "jitter": "unevenly spaced time stamps",
    "gap": "a pause much longer than a step",
    "lone_row": "a single row between two pauses",
    "missing": "an empty cell or NaN",
    "non_numeric": "a cell that is not a number",
    "not_finite": "an infinite value",
    "denormal": "a number too small to be one: uninitialised or decayed memory",
    "sign_bit": "a raw count that is no whole number of the declared width",
    "wrapped": "an angle that starts again after a turn",
    "reset": "a counter that is set back",
    "jump": "an angle that jumps in one step",
    "stale": "a row that repeats all values of the one before while the machine moves",
    "rates": "an angle and a speed that contradict each other",
    "short_part": "a part of the recording too short to use",
    "duplicate_column": "two columns with one name",
    "selected": "rows left out on request",
    "text_column": "a column of text that is not used",
    "foreign_unit": "an extra channel kept in a unit that is not known here",
    "unmapped": "columns that are no channel, kept under their own names",
    "converted": "a convention of the recorder that was converted",
}
_NOTES: Final = frozenset({"selected", "text_column", "foreign_unit", "unmapped", "converted"})


class TraceError(ValueError):
    """A recording that cannot be used as it stands. The message is one line.

    kind:  one of KINDS, or of "file", "column", "unit", "mapping", "name", "write"
    rows:  rows of the file concerned, as a text editor counts them
    """

    def __init__(self, message: str, *, kind: str, rows: Sequence[int] = ()) -> None:
        super().__init__(shorten(message))
        self.kind = kind
        self.rows = tuple(int(row) for row in rows)


def row_ranges(rows: Sequence[int], most: int = 5) -> str:
    """Return ``row 7`` or ``rows 3-5, 9 and 11-20``, shortened after `most` ranges."""
    ordered = sorted(set(rows))
    if not ordered:
        return "no row"
    starts = [0] + [i for i in range(1, len(ordered)) if ordered[i] != ordered[i - 1] + 1]
    ends = [*(i - 1 for i in starts[1:]), len(ordered) - 1]
    spans = [
        f"{ordered[a]}-{ordered[b]}" if b > a else f"{ordered[a]}"
        for a, b in zip(starts, ends, strict=True)
    ]
    if len(ordered) == 1:
        return f"row {spans[0]}"
    if len(spans) > most:
        return f"rows {', '.join(spans[:most])} and more ({len(ordered)} in all)"
    head = ", ".join(spans[:-1])
    return f"rows {head} and {spans[-1]}" if head else f"rows {spans[-1]}"


@dataclass(frozen=True, slots=True)
class Issue:
    """One kind of trouble (or a note) in one recording.

    rows are counted as in the file: a CSV's first line is 1, a binary file's first sample is 1.
    """

    kind: str
    message: str
    rows: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"unknown kind of issue: {self.kind!r}; one of {', '.join(KINDS)}")

    @property
    def is_note(self) -> bool:
        """True for what was asked for or needs no attention."""
        return self.kind in _NOTES

    def __str__(self) -> str:
        where = f" ({row_ranges(self.rows)})" if self.rows else ""
        return f"{self.kind}: {self.message}{where}"


@dataclass(frozen=True, slots=True)
class Log:
    """Everything that was noticed while a recording was read, in order."""

    issues: tuple[Issue, ...] = ()

    def __iter__(self) -> Iterator[Issue]:
        return iter(self.issues)

    def __len__(self) -> int:
        return len(self.issues)

    def __contains__(self, kind: object) -> bool:
        return any(issue.kind == kind for issue in self.issues)

    def __getitem__(self, kind: str) -> tuple[Issue, ...]:
        """All issues of one kind; empty when there is none."""
        return tuple(issue for issue in self.issues if issue.kind == kind)

    def __str__(self) -> str:
        return "\n".join(map(str, self.issues)) if self.issues else "nothing to repair"

    @property
    def troubles(self) -> tuple[Issue, ...]:
        """The issues that are more than notes."""
        return tuple(issue for issue in self.issues if not issue.is_note)

    def within(self, rows: Sequence[int]) -> Log:
        """The log of a part: issues without rows, and those that touch the part's rows."""
        own = frozenset(rows)
        kept = []
        for issue in self.issues:
            inside = tuple(row for row in issue.rows if row in own)
            if inside or not issue.rows:
                kept.append(Issue(issue.kind, issue.message, inside))
        return Log(tuple(kept))


class Recorder:
    """Collects issues while reading; in strict mode the first trouble is an error."""

    def __init__(self, path: Path, *, strict: bool) -> None:
        self.path = path
        self.strict = strict
        self._issues: list[Issue] = []

    def add(self, kind: str, message: str, rows: Iterable[int] = ()) -> None:
        """Note one issue; raises TraceError in strict mode unless it is a note."""
        issue = Issue(kind, message, tuple(int(row) for row in rows))
        if self.strict and not issue.is_note:
            way_out = "repair the file, or read it without strict"
            raise TraceError(
                f"{self.path.name or self.path}: {issue}; {way_out}", kind=kind, rows=issue.rows
            )
        self._issues.append(issue)

    def error(self, kind: str, rule: str, way_out: str, rows: Iterable[int] = ()) -> TraceError:
        """The error for what cannot be repaired, to be raised by the caller."""
        listed = tuple(int(row) for row in rows)
        where = f" ({row_ranges(listed)})" if listed else ""
        message = f"{self.path.name or self.path}: {rule}{where}; {way_out}"
        return TraceError(message, kind=kind, rows=listed)

    def log(self) -> Log:
        """What was collected."""
        return Log(tuple(self._issues))
