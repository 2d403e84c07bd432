"""The answer of a diagnosis does not depend on the order in which its records are given."""

from __future__ import annotations

from typing import Any

import pytest

from dualdrive.diagnose import diagnose
from recorded import demo, sheet


@pytest.mark.long
def test_records_may_come_in_any_order_and_on_any_number_of_threads() -> None:
    """To the last bit and word, warnings and all."""
    first, second = demo("fit").between(0.0, 4.0), demo("held_out").between(0.0, 4.0)
    usual: dict[str, Any] = {"effort": "quick", "experiment": False}
    one = diagnose(sheet(), {"first": first, "second": second}, threads=2, **usual)
    other = diagnose(sheet(), {"second": second, "first": first}, threads=1, **usual)
    assert one.warnings
    assert {**one.figures(), "seconds": None} == {**other.figures(), "seconds": None}
