"""A machine held against records as it stands: only what no data sheet knows is fitted.

Sensor constants and initial states belong to a record, not to the machine. A machine fitted to one
record meets another with constants and initial states of that record, its parameters untouched:
that is what held-out means here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dualdrive.estimation.unknowns import StateUnknown
from dualdrive.identify.closed_loop import Problem, channels_to_fit
from dualdrive.identify.search import Search
from dualdrive.replay import (
    RTOL,
    Record,
    Replay,
    best_offsets,
    core_of,
    errors,
    headline,
    named,
    play_all,
    records,
)
from dualdrive.traces import Trace

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """How a machine with given parameters meets records.

    errors:   compared channel -> relative error, all records together
    offsets:  (record, channel) -> what the sensor adds, SI
    initial:  (record, state) -> initial value, SI
    """

    errors: Mapping[str, float]
    error: float
    offsets: Mapping[tuple[str, str], float]
    initial: Mapping[tuple[str, str], float]
    replays: Sequence[Replay]

    def residual(self, record: str, channel: str) -> Array:
        """Simulated plus constant minus measured, shape (n,)."""
        replay = next(r for r in self.replays if r.record.name == record)
        left: Array = replay.residual(channel) + self.offsets.get((record, channel), 0.0)
        return left


def evaluate(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    *,
    offsets: str = "all",
    motion: Any = None,
    interpolation: str = "auto",
    start: str = "auto",
    rtol: float = RTOL,
    settings: Mapping[str, Mapping[str, float]] | None = None,
) -> Evaluation:
    """Error of a machine on traces it was not fitted to, through its closed loop.

    Args and errors as for :func:`dualdrive.identify.fit`; FitError where the simulation fails.
    """
    played = records(
        machine,
        named(traces),
        motion=motion,
        interpolation=interpolation,
        start=start,
        settings=settings,
    )
    return evaluate_records(machine, played, offsets=offsets, rtol=rtol)


def evaluate_records(
    machine: Any, played: Sequence[Record], *, offsets: str = "all", rtol: float = RTOL
) -> Evaluation:
    """The same for records that are ready."""
    core = core_of(machine)
    problem = Problem(
        core,
        played,
        [],
        state_unknowns(core, played),
        channels=channels_to_fit(played, None),
        offsets=offsets,
        rtol=rtol,
    )
    search = Search(problem, precision=1e-3, rounds=2)
    search.run()
    if search.status == "interrupted":  # half of a comparison is none
        raise KeyboardInterrupt
    return at_point(problem, search.best)


def at_point(problem: Problem, u: Array, *, flanks: bool = True) -> Evaluation:
    """Errors at one point of a problem."""
    replays = play_all(
        problem.machine_at(u),
        problem.records,
        (),
        problem.initial(u),
        rtol=problem.rtol,
        flanks=flanks,
    )
    constants = {**best_offsets(replays, problem.granted), **problem.constants(u)}
    by_channel = errors(replays, constants)
    return Evaluation(
        by_channel,
        headline(by_channel, [c for r in problem.records for c in r.channels]),
        constants,
        {
            (problem.records[k].name, state): value
            for k, states in enumerate(problem.initial(u))
            for state, value in states.items()
        },
        replays,
    )


def state_unknowns(core: Any, played: Sequence[Record]) -> list[StateUnknown]:
    """What is not known of the state in which each record begins, and how well it is known.

    The angle within its sensor's noise, speeds within 5 %, twists within a third of the play. A
    loop that had time to settle has forgotten its initial state, but for how long ago that began.
    """
    found = []
    units = dict(core.states())
    for k, record in enumerate(played):
        for state in units if record.start == "rest" else ():
            known = record.initial.get(state, 0.0)
            if state == "theta_m" and "theta_m" in record.trace:
                sigma = _noise(record.trace["theta_m"])
            elif state.endswith(".twist"):
                sigma = 0.3 * core.get(f"{state.removesuffix('.twist')}.gap")
            elif state.startswith("omega_"):
                sigma = 0.05 * abs(known)
            else:
                continue
            if sigma > 0.0:
                found.append(StateUnknown(k, state, units[state], known, sigma))
    return found


def _noise(angle: Array) -> float:
    """Spread of the second differences over the first samples, and no less than rounding."""
    rough = float(np.std(np.diff(angle[:12], n=2))) / math.sqrt(6.0)
    return max(rough, 1e-7 * float(np.ptp(angle)))
