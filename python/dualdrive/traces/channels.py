"""From a column's raw numbers to a channel in SI."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dualdrive.units import UnitError, conversion, parse

from .log import Recorder
from .mapping import ColumnRule, FileLayout
from .names import CHANNELS, is_canonical
from .table import Table, current_kind, numbers

__all__ = ["Channel", "read_channel"]

Floats = NDArray[np.float64]

# The units an extra channel may end up in; the first that fits is taken.
_SI: Final = (
    *("rad", "rad/s", "rad/s^2", "N*m", "N", "m", "m/s", "m/s^2", "A", "V", "ohm", "H", "s"),
    *("Hz", "1/s", "K", "W", "Pa", "kg", "kg*m^2", "N*m/rad", "N*m*s/rad", ""),
)
# Model current of a synchronous motor over its phase current: I = sqrt(3) I_rms, because the model
# sets K_d = C_e = k_T / sqrt(3), which keeps torque and energy right (docs/theory).
_CURRENT: Final = {"rms": math.sqrt(3.0), "peak": math.sqrt(1.5)}
_LIKE: Final = 0.8  # of the letters that two names share: one is a slip of the other
_LARGEST: Final = math.sqrt(np.finfo(np.float64).max)  # what can still be squared
_SMALLEST: Final = float(np.finfo(np.float64).tiny)


@dataclass
class Channel:
    """One channel being read. `turn` is the SI size of one period of the raw count, if stated."""

    name: str
    column: str
    values: Floats
    unit: str
    long_name: str
    rule: ColumnRule
    turn: float | None = None

    @property
    def is_extra(self) -> bool:
        """True when no canonical name was given."""
        return not is_canonical(self.name)


def read_channel(
    table: Table, column: str, rule: ColumnRule, layout: FileLayout, recorder: Recorder
) -> Channel | None:
    """Return the channel of one column, or None (and a note) when it holds only text.

    Empty cells stay NaN here. Raises TraceError for a unit that does not fit or a column that is
    needed but not numeric.
    """
    name = rule.channel or column
    needed = is_canonical(name) or bool(rule.channel)
    if rule.channel and (near := _meant(name)):
        message = f"column {column!r} -> {name}: a channel of your own, which no machine has"
        recorder.add("unmapped", f"{message}; did you mean {near}?")
    raw, bad = numbers(table.columns[column])
    cells = np.count_nonzero(~np.isnan(raw)) + np.count_nonzero(bad)
    if cells == 0 or 2 * np.count_nonzero(bad) > cells:
        what = "is empty" if cells == 0 else "is not numeric"
        if needed:
            way_out = "map another column, or list it in [file] ignore"
            rows = table.rows[bad] if cells else ()
            raise recorder.error("non_numeric", f"column {column!r} {what}", way_out, rows)
        recorder.add("text_column", f"column {column!r} {what}, not used")
        return None
    if bad.any():
        example = table.columns[column][np.argmax(bad)]
        message = f"{column}: cells such as {example!r} taken as missing"
        recorder.add("non_numeric", message, table.rows[bad])
    raw = _clean(raw, column, layout, table.rows, recorder)
    if rule.sign_bit >= 0:
        raw = _signed(raw, rule.sign_bit, column, table.rows, recorder)
    scale = float(Fraction(rule.scale)) if isinstance(rule.scale, str) else rule.scale
    given = rule.unit or table.units.get(column, "")
    try:
        to_si, unit = _to_si(name, column, given, rule, recorder)
    except UnitError as error:
        way_out = f'correct the unit in the header or in [columns."{column}"]'
        raise recorder.error("unit", f"{column} -> {name}: {error}", way_out) from None
    with np.errstate(over="ignore", invalid="ignore"):  # told below
        values = to_si(rule.sign * (scale * raw + rule.offset))
    if (np.abs(values) > _LARGEST).any() or np.isnan(values[~np.isnan(raw)]).any():
        rule_text = f"{column} -> {name}: in {unit or 'SI'} beyond {_LARGEST:.0e}"
        raise recorder.error("unit", rule_text, "correct scale, offset or unit")
    long_name = rule.long_name or table.long_names.get(column, "")
    if not long_name:
        long_name = CHANNELS[name].long_name if name in CHANNELS else column
    turn = None
    if not isinstance(rule.wrap, bool):
        turn = abs(float(to_si(np.array([scale * rule.wrap]))[0] - to_si(np.zeros(1))[0]))
    return Channel(name, column, values, unit, long_name, rule, turn)


def _meant(name: str) -> str:
    """The canonical name that one of no channel is nearest to; empty where it is near to none."""
    close = difflib.get_close_matches(name, CHANNELS, n=1, cutoff=_LIKE)
    return "" if is_canonical(name) or not close else close[0]


def _clean(
    raw: Floats, column: str, layout: FileLayout, rows: NDArray[np.int64], recorder: Recorder
) -> Floats:
    """Take out what is no measured number: stated stand-ins, infinities, denormals."""
    raw = raw.copy()
    for stand_in in layout.missing:
        raw[raw == stand_in] = np.nan
    infinite = np.abs(raw) > _LARGEST
    if infinite.any():
        message = f"{column}: infinite or beyond {_LARGEST:.0e}, taken as missing"
        recorder.add("not_finite", message, rows[infinite])
        raw[infinite] = np.nan
    denormal = (raw != 0) & (np.abs(raw) < _SMALLEST)
    if denormal.any():
        recorder.add("denormal", f"{column}: set to zero", rows[denormal])
        raw[denormal] = 0.0
    return raw


def _signed(
    raw: Floats, bit: int, column: str, rows: NDArray[np.int64], recorder: Recorder
) -> Floats:
    """Counts whose sign stands in one bit above the magnitude (not two's complement)."""
    known = ~np.isnan(raw)
    wrong = known & ((raw < 0) | (raw != np.floor(raw)) | (raw >= 2.0 ** (bit + 1)))
    if wrong.any():
        rule = f"{column}: no count with its sign in bit {bit}, e.g. {raw[wrong][0]:g}"
        raise recorder.error("sign_bit", rule, "correct sign_bit", rows[wrong])
    negative = known & (raw >= 2.0**bit)
    return np.where(negative, 2.0**bit - raw, raw)


def _to_si(
    name: str, column: str, given: str, rule: ColumnRule, recorder: Recorder
) -> tuple[Callable[[Floats], Floats], str]:
    """The function that turns numbers in the given unit into SI, and the SI unit. UnitError."""
    target = CHANNELS[name].unit if name in CHANNELS else None
    if given in ("%", "percent"):
        return _percent(column, rule, target)
    if rule.of:
        raise UnitError(f"of = {rule.of!r} says what 100 % are, and the unit is {given or 'SI'}")
    given, kind = current_kind(given)
    if rule.current and (target or given) not in ("A", "mA", "kA"):
        raise UnitError(f"current = {rule.current!r} is of a phase current, in A")
    kind = rule.current or kind
    factor = 1.0
    if kind and name.startswith("I_"):
        factor = _CURRENT[kind]
        message = f"{column}: {kind} phase current times {factor:.4f} is the model's {name}"
        recorder.add("converted", message)
    if rule.radius:
        factor, given = _about_axis(given, parse(rule.radius, "m", key="radius"), factor)
    if target is None:
        target = _si_of(given, column, recorder)
    if not given:
        return lambda x: factor * x, target
    change = conversion(given, target)
    return lambda x: factor * (change.scale * x + change.offset), target


def _percent(
    column: str, rule: ColumnRule, target: str | None
) -> tuple[Callable[[Floats], Floats], str]:
    if not rule.of:
        if target:
            raise UnitError(f'% of what? state of = "100 {target}" for {column}')
        return lambda x: x / 100.0, ""
    full = next((u for u in ((target,) if target else _SI) if _fits(rule.of, u)), None)
    if full is None:
        raise UnitError(f"of = {rule.of!r} does not measure {target}")
    reference = parse(rule.of, full, key="of")
    return lambda x: x / 100.0 * reference, full


def _fits(text: str, unit: str) -> bool:
    try:
        parse(text, unit)
    except UnitError:
        return False
    return True


def _about_axis(given: str, radius: float, factor: float) -> tuple[float, str]:
    """A length on a radius as an angle (also per time), a force on it as a torque."""
    for linear, turning, power in (
        ("m", "rad", -1),
        ("m/s", "rad/s", -1),
        ("m/s^2", "rad/s^2", -1),
        ("N", "N*m", 1),
    ):
        try:
            return factor * radius**power * conversion(given, linear).scale, turning
        except UnitError:
            continue
    raise UnitError(f"radius needs a length, speed or force, not {given or 'a plain number'}")


def _si_of(given: str, column: str, recorder: Recorder) -> str:
    """SI unit of an extra channel; a unit nobody knows stays as it is, with a note."""
    for unit in _SI if given else ("",):
        try:
            conversion(given, unit)
        except UnitError:
            continue
        return unit
    recorder.add("foreign_unit", f"{column}: kept in {given!r}")
    return given
