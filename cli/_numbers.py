"""Numbers on the command line: finite, and written as people write them, units and all."""

from __future__ import annotations

import math
from typing import Any

import click

from dualdrive.units import UnitError, parse


def _plain(value: Any) -> bool:
    """Neither nan nor inf, nor digits grouped as in a program: 1_000."""
    try:
        return "_" not in str(value) and math.isfinite(float(value))
    except ValueError:
        return True  # no number at all: click says so


class Real(click.FloatRange):
    """A finite number in a range, in SI or with a unit that measures the same as `unit`.

    nan would pass every range, for no comparison with it is true.
    """

    name = "number"

    def __init__(
        self,
        low: float | None = None,
        high: float | None = None,
        *,
        min_open: bool = False,
        unit: str = "",
    ) -> None:
        super().__init__(low, high, min_open=min_open)
        self.unit = unit

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Refuse what is no finite number, or has a unit of something else."""
        if not _plain(value):
            self.fail(f"{value} is not a finite number", param, ctx)
        key = max(param.opts, key=len) if param else "value"
        try:
            number = parse(value, self.unit, key=key)
        except UnitError as error:
            raise click.UsageError(str(error), ctx) from None
        return float(super().convert(number, param, ctx))

    def _describe_range(self) -> str:
        return _described(self, super()._describe_range())


class Whole(click.IntRange):
    """A whole number in a range."""

    name = "integer"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Refuse what is no plain whole number."""
        if not _plain(value):
            self.fail(f"{value} is not a whole number", param, ctx)
        return int(super().convert(value, param, ctx))

    def _describe_range(self) -> str:
        return _described(self, super()._describe_range())


def _described(kind: click.FloatRange | click.IntRange, range_: str) -> str:
    """A range for the help; nothing where there is no limit."""
    return "" if kind.min is None and kind.max is None else range_
