"""Acceptance reports of the ecmc motion tests: positions, and what the report prints of them.

Such a test leaves a report in Markdown, and beside it its positions as ``TGT_DATA[i]=...``,
``REF_DATA_FWD[i,j]=...``, ``REF_DATA_BWD[i,j]=...``. Its printed figures are held against the
definition; where the two part, the difference is said in words.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Final, NamedTuple

from dualdrive.files import read_text

from .iso230 import Iso230, evaluate
from .rules import IndexingError

__all__ = ["Departure", "Report", "is_report", "read_report"]

_SETTING: Final = re.compile(r"^(UNIT|DEC)=(\S+)\s*$", re.M)
_TARGET: Final = re.compile(r"^TGT_DATA\[(\d+)\]=(\S+)", re.M)
_POSITION: Final = re.compile(r"^REF_DATA_(FWD|BWD)\[(\d+),(\d+)\]=(\S+)", re.M)
_PRINTED: Final = re.compile(r"^\**(A|R|E|B|M)(_fwd|_bwd|_avg)?\s*=\s*(\S+)\s*\[(\w+)\]", re.M)
_FIRST_ROW: Final = re.compile(r"^1\|[^|]+\|([^|]+)\|", re.M)
_LETTERS: Final = {"_fwd": "_up", "_bwd": "_down", "_avg": "_mean", "": ""}
_METRES: Final = {"mm": 1e-3, "um": 1e-6, "m": 1.0}


class Departure(NamedTuple):
    """A printed figure that is not what the definition gives; both in m."""

    figure: str
    printed: float
    defined: float
    also: str

    def words(self) -> str:
        """The departure as one line, in mm."""
        text = (
            f"{self.figure}: printed {self.printed * 1e3:.6g} mm, "
            f"by the definition {self.defined * 1e3:.6g} mm"
        )
        return f"{text}; the printed number is {self.also}" if self.also else text


class Report(NamedTuple):
    """A report as read.

    result:      its positions, evaluated;  printed: its own figures, m
    departures:  figures that are not what the definition gives
    swapped:     whether report and data file call opposite directions forward; None if unknown
    """

    result: Iso230
    printed: dict[str, float]
    departures: list[Departure]
    swapped: bool | None

    def words(self) -> list[str]:
        """What there is to say about the report, one line each."""
        lines = [f"the report departs from the definition: {d.words()}" for d in self.departures]
        if self.swapped:
            lines.append(
                "report and data file call opposite directions forward: the sign of B_i is open"
            )
        if self.printed and not self.departures:
            lines.append("the report's figures are those of the definition")
        return lines


def is_report(path: str | Path) -> bool:
    """Whether a file holds the positions of such a test."""
    path = Path(path)
    return path.suffix in (".dat", ".txt") and bool(_TARGET.search(read_text(path)))


def read_report(path: str | Path) -> Report:
    """Read the data file of such a test, and the report beside it if it is there.

    The report of ``x_ISO230.dat`` is ``x``. Raises IndexingError naming file, rule and way out.
    """
    path = Path(path)
    text = read_text(path)
    settings = dict(_SETTING.findall(text))
    scale = _METRES.get(settings.get("UNIT", "mm"))
    if scale is None:
        raise IndexingError(f"{path}: UNIT={settings['UNIT']}: must be one of {', '.join(_METRES)}")
    result = _evaluated(path, text, scale)
    beside = path.with_name(path.name.removesuffix("_ISO230.dat"))
    if beside == path or not beside.is_file():
        return Report(result, {}, [], None)
    report = read_text(beside)
    printed = {
        letter + _LETTERS[way]: float(value) * _METRES[unit]
        for letter, way, value, unit in _PRINTED.findall(report)
    }
    swapped = _swapped(result, report, scale)
    own = _exchanged(result) if swapped else result
    digit = 10.0 ** -int(settings.get("DEC", "4")) * scale
    return Report(own, printed, _departures(own, printed, digit), swapped)


def _evaluated(path: Path, text: str, scale: float) -> Iso230:
    targets = {int(i): float(value) * scale for i, value in _TARGET.findall(text)}
    seen: dict[str, dict[int, dict[int, float]]] = {"FWD": {}, "BWD": {}}
    for way, i, j, value in _POSITION.findall(text):
        seen[way].setdefault(int(i), {})[int(j)] = float(value) * scale
    order = sorted(targets, key=lambda i: targets[i])
    sides = []
    for way, rows in seen.items():
        lacking = [i for i in order if i not in rows]
        if lacking:
            raise IndexingError(f"{path}: REF_DATA_{way}[{lacking[0]},...]: missing")
        sides.append([[rows[i][j] for j in sorted(rows[i])] for i in order])
    return evaluate([targets[i] for i in order], *sides, unit="m", name=path.stem)


def _swapped(result: Iso230, report: str, scale: float) -> bool | None:
    """Compare the first position that the report calls forward with the data file's two."""
    first = _FIRST_ROW.search(report)
    if first is None or result.down is None:
        return None
    printed = float(first[1]) * scale - result.targets[0]
    return bool(abs(result.down[0, 0] - printed) < abs(result.up[0, 0] - printed))


def _exchanged(result: Iso230) -> Iso230:
    assert result.down is not None
    places = result.targets[:, None]
    up, down = result.down + places, result.up + places
    return evaluate(result.targets, up, down, unit="m", name=result.name)


def _departures(result: Iso230, printed: dict[str, float], digit: float) -> list[Departure]:
    """Printed figures that are off by more than a unit of their last digit."""
    defined = result.figures()
    candidates = {name: value for name, value in defined.items() if value is not None}
    if result.down is not None:
        mixed = result.up.mean(axis=1).max() - result.down.mean(axis=1).min()
        candidates["the largest mean upwards less the smallest downwards"] = float(mixed)
    found = []
    for letter, value in printed.items():
        true = defined[letter]
        # reversal errors are printed with the sign of the largest one
        if true is None or math.isclose(abs(value), abs(true), rel_tol=0, abs_tol=1.5 * digit):
            continue
        same = [
            name
            for name, other in candidates.items()
            if name != letter and abs(value - other) <= 1.5 * digit
        ]
        found.append(Departure(letter, value, true, " and ".join(same)))
    return found
