"""How rare the rarest course without a law is where nothing is missing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from tests.blind.shown import ordered
from tests.blind.shown.ordered import FAMILIES, Order

from dualdrive.compare import evened
from dualdrive.diagnose import whitening
from dualdrive.diagnose.evidence import Evidence, evidence
from dualdrive.diagnose.free_torque import Course, courses_left
from dualdrive.diagnose.loop import ClosedLoop
from dualdrive.diagnose.refit import Fitter, Refit
from dualdrive.diagnose.search import search
from dualdrive.diagnose.work import Clock, Work
from dualdrive.replay import core_of
from dualdrive.replay import records as played

_BUDGET = 120.0  # s for the refit
_OFF = 1.05  # times the real inertia of the table: what the sheet says


def machines(seeds: Sequence[int]) -> Iterator[Order]:
    """One record each, nothing hidden, an inertia slightly off."""
    for family in FAMILIES:
        for seed in seeds:
            order = ordered.drifted(family, seed, _OFF)
            yield replace(order, plans=order.plans[:1])


def rarest(order: Order) -> Course | None:
    """The course that noise would make least often, however often; None where no pulse answers.

    The machine is refitted as a diagnosis does it, other valleys of its numbers among them.
    """
    found = search(
        confronted(order), Work(Clock(_BUDGET, lambda: False), 1, lambda _: None), wanted=[]
    )
    return next(iter(courses_left(found.evidence, found.base, rarer_than=1.0)), None)


def confronted(order: Order) -> ClosedLoop:
    """The machine of the sheet beside its records."""
    traces = {name: evened(trace)[0] for name, trace in order.traces().items()}
    machine = order.machine()
    return ClosedLoop(core_of(machine), played(machine, traces, settings=order.settings()))


def refitted(c: ClosedLoop) -> tuple[Evidence, Refit]:
    """The nominal numbers refitted, under the noise that this leaves."""
    seen, base = evidence(c, whitening.plain(c.series)), None
    for _ in range(4):
        base = Fitter(seen).nominal(c.start if base is None else base.u)
        if base is None:
            raise RuntimeError(f"{c.core.name}: can not be simulated")
        settled, seen = seen, evidence(c, whitening.fitted(c.series, base.left))
    assert base is not None
    return settled, base
