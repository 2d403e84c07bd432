"""Numbers on the command line: finite, and written as people write them."""

from __future__ import annotations

import math
from typing import Any

import click


def _plain(value: Any) -> bool:
    """Neither nan nor inf, nor digits grouped as in a program: 1_000."""
    try:
        return "_" not in str(value) and math.isfinite(float(value))
    except ValueError:
        return True  # no number at all: click says so


class Real(click.FloatRange):
    """A finite number in a range; nan would pass every range, for no comparison with it is true."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Refuse what is no finite number."""
        if not _plain(value):
            self.fail(f"{value} is not a finite number", param, ctx)
        return float(super().convert(value, param, ctx))


class Whole(click.IntRange):
    """A whole number in a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Refuse what is no plain whole number."""
        if not _plain(value):
            self.fail(f"{value} is not a whole number", param, ctx)
        return int(super().convert(value, param, ctx))
