"""The answer of a diagnosis does not depend on the order in which its records are given."""

from __future__ import annotations

from dualdrive.diagnose import Diagnosis, diagnose
from dualdrive.traces import Trace
from recorded import demo, sheet


def answer(traces: dict[str, Trace], threads: int) -> Diagnosis:
    return diagnose(sheet(), traces, effort="quick", experiment=False, threads=threads)


def test_records_may_come_in_any_order_and_on_any_number_of_threads() -> None:
    first, second = demo("fit").between(0.0, 4.0), demo("held_out").between(0.0, 4.0)
    one = answer({"first": first, "second": second}, threads=2)
    other = answer({"second": second, "first": first}, threads=1)
    assert one.error == other.error
    assert one.verdict == other.verdict
    assert {p: x.value for p, x in one.numbers.items()} == {
        p: x.value for p, x in other.numbers.items()
    }
    assert one.effort == other.effort
