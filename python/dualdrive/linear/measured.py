"""Measured frequency responses: read from what drives, controls and analysers export."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.files import refuse_existing, write_atomically
from dualdrive.linear.errors import LinearError
from dualdrive.linear.response import FrequencyResponse
from dualdrive.linear.sinumerik import is_measurement, read_measurement
from dualdrive.traces import TraceError
from dualdrive.traces.csv_file import read_csv
from dualdrive.traces.log import Recorder
from dualdrive.traces.mapping import FileLayout
from dualdrive.traces.table import Table

__all__ = ["read_response", "write_response"]

Array = NDArray[np.float64]

#: quantity -> how its column begins, in lower case
_NAMES: Final = {
    "frequency": r"f$|f[\W_]|freq|omega|w$|w[\W_]",
    "magnitude": r"mag|gain|amp|abs|\|",
    "phase": r"phase|phi|arg",
    "coherence": r"coh|gamma",
}
#: unit as written, in lower case -> the one unit it means
_UNITS: Final = {
    "frequency": {"hz": "Hz", "khz": "kHz", "rad/s": "rad/s", "rad": "rad/s"},
    "magnitude": {"db": "dB", "abs": "abs", "1": "abs"},
    "phase": {"deg": "deg", "°": "deg", "degree": "deg", "degrees": "deg", "rad": "rad"},
}


def read_response(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    input: str = "",  # noqa: A002 -- what it is
    output: str = "",
    unit: str = "",
) -> FrequencyResponse:
    """Read a table of frequency, magnitude and phase, with coherence where there is a column of it.

    Or a frequency measurement as a SINUMERIK control saves it; columns and units are for tables.

    columns:  quantity (frequency, magnitude, phase, coherence) -> column; default: by their names
    units:    of frequency (Hz, kHz, rad/s), magnitude (dB, abs), phase (deg, rad); default: as the
              header says: ``magnitude [dB]``, ``phase_deg``. A frequency without unit is in Hz.
    input, output, unit: what was measured, for captions; unit is that of output over input

    Raises LinearError naming file, column or row, rule and way out.
    """
    path = Path(path)
    try:
        if is_measurement(path):
            return read_measurement(path, input=input, output=output)
        table = read_csv(path, FileLayout(), Recorder(path, strict=False))
    except OSError as error:
        raise LinearError(f"{path}: cannot be read: {error.strerror}") from None
    except TraceError as error:
        raise LinearError(str(error)) from None
    notes: list[str] = []
    _end_with_the_data(table, notes)
    reader = _Reader(path, table, dict(columns or {}), dict(units or {}), notes)
    f = reader.frequency()
    size, angle = reader.magnitude(), reader.phase()
    agreed = reader.values("coherence") if reader.column("coherence") else None
    still = f == 0
    if still.any():
        notes.append("row at 0 Hz left out")
    order = np.argsort(f, kind="stable")
    order = order[~still[order]]
    f = f[order]
    if not f.size or f[0] < 0 or (np.diff(f) == 0).any():
        raise LinearError(f"{path}: frequencies must be positive, and each there only once")
    return FrequencyResponse(
        frequency_hz=f,
        response=(size * np.exp(1j * angle))[order],
        input=input or "input",
        output=output or "output",
        unit=unit,
        note="; ".join([str(path), *notes]),
        coherence=None if agreed is None else agreed[order],
        origin="measured",
    )


def write_response(
    response: FrequencyResponse, path: str | Path, *, overwrite: bool = False
) -> None:
    """Write a CSV that `read_response` reads. Raises FileError where it can't be written."""
    path = Path(path)
    refuse_existing(path, overwrite=overwrite)
    columns = {
        "frequency [Hz]": response.frequency_hz,
        "magnitude [dB]": response.magnitude_db,
        "phase [deg]": response.phase_deg,
    }
    if response.coherence is not None:
        columns["coherence"] = response.coherence
    if response.distortion is not None:
        columns["distortion"] = response.distortion
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(f"{value:.12g}" for value in row) for row in rows)]
    with write_atomically(path, overwrite=overwrite) as temporary:
        temporary.write_text("\n".join(lines) + "\n", "utf-8")


def _end_with_the_data(table: Table, notes: list[str]) -> None:
    """Leave out what a control writes below its table: the settings that it was measured with."""
    first = next(iter(table.columns.values()), np.zeros(0))
    known = np.flatnonzero([np.isfinite(_number(value)) for value in first.tolist()])
    end = int(known[-1]) + 1 if known.size else len(first)
    if end < len(first):
        notes.append(f"{len(first) - end} lines below the table left out")
        table.columns = {name: values[:end] for name, values in table.columns.items()}
        table.rows = table.rows[:end]


def _number(cell: object) -> float:
    """A cell as a number; NaN where it is none."""
    try:
        return float(cell)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return float("nan")


class _Reader:
    """Columns of a table by what they hold."""

    def __init__(
        self,
        path: Path,
        table: Table,
        columns: dict[str, str],
        units: dict[str, str],
        notes: list[str],
    ) -> None:
        self.path, self.table, self.notes = path, table, notes
        self.given, self.units = columns, units
        for name in (*columns, *units):
            if name not in _NAMES:
                raise LinearError(f"{name!r}: no such quantity; there are {', '.join(_NAMES)}")

    def column(self, quantity: str) -> str | None:
        """The name of a quantity's column, or None. Raises LinearError where two may be it."""
        names = list(self.table.columns)
        if quantity in self.given:
            if self.given[quantity] not in names:
                known = ", ".join(names)
                raise LinearError(
                    f"{self.path}: no column {self.given[quantity]!r}; there are {known}"
                )
            return self.given[quantity]
        found = [name for name in names if re.match(_NAMES[quantity], name.lower())]
        if len(found) != 1 and quantity in _UNITS:  # TR1: Gain (dB) beside TR1: Gain (Real)
            found = self._by_unit(quantity) or found
        if len(found) > 1:
            raise LinearError(
                f"{self.path}: {' and '.join(found)} may each be the {quantity}; say which"
            )
        return found[0] if found else None

    def _by_unit(self, quantity: str) -> list[str]:
        """Columns whose header states a unit that only this quantity has."""
        own = {unit for unit in _UNITS[quantity] if unit not in ("1", "rad")}
        said = {name: self._stated(name).lower() for name in self.table.columns}
        return [name for name, unit in said.items() if unit in own]

    def _stated(self, name: str) -> str:
        """The unit that a header states, in brackets; empty where it states none."""
        bracket = re.search(r"[(\[]([^)\]]+)[)\]]\s*$", name)
        return self.table.units.get(name, "") or (bracket[1] if bracket else "")

    def values(self, quantity: str) -> Array:
        """Its numbers. Raises LinearError where there are none, or not everywhere."""
        name = self.column(quantity)
        if name is None:
            raise LinearError(
                f"{self.path}: no column of {quantity}; there are {', '.join(self.table.columns)}; "
                "name it in the header, or say which it is"
            )
        values = np.array([_number(v) for v in self.table.columns[name].tolist()])
        good = np.isfinite(values)
        if not good.all():
            row = int(self.table.rows[~good][0])
            raise LinearError(f"{self.path}: line {row}: {name} is no number; repair or delete it")
        return np.asarray(values, float)

    def unit(self, quantity: str) -> str:
        """The unit that was given, or that the header says; empty where neither does."""
        known = _UNITS[quantity]
        name = self.column(quantity) or ""
        said = self.units.get(quantity) or self._stated(name)
        if not said:
            end = re.search(r"[ _/]([A-Za-z°]+)$", name)
            said = end[1] if end and end[1].lower() in known else ""
        if said and said.lower() not in known:
            wanted = ", ".join(dict.fromkeys(known.values()))
            raise LinearError(f"{self.path}: {quantity} in {said!r}: choose one of {wanted}")
        return known[said.lower()] if said else ""

    def frequency(self) -> Array:
        """In Hz."""
        values, unit = self.values("frequency"), self.unit("frequency")
        if not unit:
            self.notes.append("frequency taken to be in Hz")
        return values * {"": 1.0, "Hz": 1.0, "kHz": 1e3, "rad/s": 1 / (2 * np.pi)}[unit]

    def magnitude(self) -> Array:
        """As a ratio."""
        values, unit = self.values("magnitude"), self.unit("magnitude")
        if not unit and (values < 0).any():
            unit = "dB"
        if not unit:
            raise LinearError(
                f"{self.path}: magnitude in dB or absolute? Say so in the header, "
                "magnitude [dB], or give its unit"
            )
        if unit == "abs" and (values < 0).any():
            raise LinearError(f"{self.path}: an absolute magnitude can't be negative; is it in dB?")
        return np.asarray(10 ** (values / 20) if unit == "dB" else values)

    def phase(self) -> Array:
        """In rad."""
        values, unit = self.values("phase"), self.unit("phase")
        if not unit and np.abs(values).max() <= 4 * np.pi:
            raise LinearError(
                f"{self.path}: phase in deg or rad? Say so in the header, phase [deg], "
                "or give its unit"
            )
        return values if unit == "rad" else np.radians(values)
