"""Conditions on rows, as a mapping states them: ``TestIndex == 0``."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from .log import Recorder
from .mapping import RowRule
from .table import Table, find_column, numbers

__all__ = ["select_rows"]

_OPERATORS: Final[dict[str, Callable[[Any, Any], Any]]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
_CONDITION: Final = re.compile(r"\s*(.+?)\s*(==|!=|<=|>=|<|>)\s*(.+?)\s*")


def select_rows(table: Table, rule: RowRule, recorder: Recorder) -> None:
    """Leave out the rows the mapping does not want. Conditions see the raw numbers of the file."""
    wanted = np.ones(len(table.rows), dtype=bool)
    for text in rule.keep:
        wanted &= _condition(table, text, "rows.keep", recorder)
    for text in rule.drop:
        wanted &= ~_condition(table, text, "rows.drop", recorder)
    if wanted.all():
        return
    if not wanted.any():
        raise recorder.error("mapping", "[rows] leaves no row", "relax keep or drop")
    conditions = ", ".join([*rule.keep, *(f"not {text}" for text in rule.drop)])
    recorder.add("selected", f"only {conditions}", table.rows[~wanted])
    table.take(wanted)


def _condition(table: Table, text: str, key: str, recorder: Recorder) -> NDArray[np.bool_]:
    match = _CONDITION.fullmatch(text)
    if match is None:
        rule = f"{key} = {text!r}: not a condition"
        raise recorder.error("mapping", rule, 'write e.g. "TestIndex == 0"')
    name = find_column(table, match[1].strip("\"'"), recorder, why=f"{key} uses column")
    compare, wanted = _OPERATORS[match[2]], match[3].strip("\"'")
    column = table.columns[name]
    try:
        number = float(wanted)
    except ValueError:
        if match[2] not in ("==", "!=") or column.dtype != object:
            rule = f"{key} = {text!r}: {wanted!r} is not a number"
            raise recorder.error("mapping", rule, "compare with a number") from None
        same = np.array([cell == wanted for cell in column])
        return same if match[2] == "==" else ~same
    return np.asarray(compare(numbers(column)[0], number), dtype=bool)
