"""Fit a machine to measured traces: through its closed loop, or through its torque balance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dualdrive.distributed import mapper_for
from dualdrive.estimation.unknowns import (
    default_free,
    default_tolerances,
    seen_in_balance,
    unknowns,
)
from dualdrive.identify.balance import torque_balance
from dualdrive.identify.closed_loop import Problem, channels_to_fit
from dualdrive.identify.evaluation import state_unknowns
from dualdrive.identify.filtering import Processing
from dualdrive.identify.fit_summary import summary
from dualdrive.identify.initial_estimate import initial_estimates
from dualdrive.identify.parts import sizes_of_part
from dualdrive.identify.passivity import torque_notes, torque_warnings
from dualdrive.identify.search import Progress, Search
from dualdrive.identify.standstill import Standstill
from dualdrive.replay import RTOL, Record, core_of, named, ratio_to_table, records
from dualdrive.traces import Trace

if TYPE_CHECKING:
    from distributed import Client

MODES = ("auto", "closed_loop", "balance")


def fit(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    free: Sequence[str] | None = None,
    mode: str = "auto",
    *,
    tolerance: float | Mapping[str, float] | None = None,
    offsets: str = "all",
    channels: Sequence[str] | None = None,
    motion: Any = None,
    interpolation: str = "auto",
    start: str = "auto",
    starts: int = 1,
    seed: int = 0,
    confidence: float = 0.95,
    max_simulations: int = 1000,
    rtol: float = RTOL,
    processing: Processing | None = None,
    standstill: Standstill | None = None,
    settings: Mapping[str, Mapping[str, float]] | None = None,
    scheduler: str | Client | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Any:
    """Fit parameters of a machine to traces.

    Closed loop (controller and commanded motion known): the loop is simulated along each record,
    and parameters, sensor constants and initial states move until simulated and measured agree
    (trust-region reflective least squares, SciPy; exact sensitivities from the solver). It begins
    at the data sheet, or at numbers that predict the records a sample ahead where their simulation
    comes nearer: from afar a simulated error hardly tells which way to go. Torque
    balance (controller unknown): see :func:`dualdrive.identify.torque_balance`.

    Args:
        machine: a machine, or the core's.
        traces: one trace, several, or name -> trace; each is a record with constants of its own.
        free: parameter paths or tie groups. Left out: inertias, friction, stiffness and play that
            the machine has, and every number of its effects; in the torque balance no asymmetry
            of friction beside a constant torque per record, since the two are the same there.
        mode: ``closed_loop``, ``balance``, or ``auto``: closed loop where the machine has a
            controller and every trace a commanded motion.
        tolerance: relative one-sigma width of the prior about each nominal value, for all or by
            path; unless told 0.1 for inertias, 0.2 for stiffness and play, 0.5 for viscous
            friction. An effect's number that stands at zero has no prior, others 1.0. In the
            torque balance what ``free`` names has no prior unless told.
        offsets: which sensors may have a constant: ``all`` headline channels but the following
            error, ``encoders`` of the drives, ``none``.
        channels: compared channels to fit; those of the headline error unless given.
        motion: commanded motion where the traces carry none.
        interpolation: see :func:`dualdrive.replay.records`.
        start: see :func:`dualdrive.replay.records`.
        starts: number of starting points; the first is the best of the above, others are drawn from
            the priors (effects between a tenth and ten times their usual size).
        seed: of those draws.
        confidence: of the intervals.
        max_simulations: limit on simulated records of each start; the best point so far is
            returned.
        rtol: local tolerance of the simulations.
        processing: filters and decimation of the torque balance.
        standstill: what the torque balance does near standstill.
        settings: name of a trace -> parameter path -> SI value that held while it was recorded.
        scheduler: address of a Dask scheduler (``tcp://HOST:8786``) or a connected
            distributed.Client, whose workers take a start each, or a record each where there is
            one start. One start with one record has nothing to spread and is computed here.
        progress: told where the fit stands after each simulation of all records (on a scheduler
            with several starts: after each start); whatever it raises ends the fit,
            KeyboardInterrupt with the best point so far, if there is one.

    Returns:
        :class:`Fit`, or :class:`~dualdrive.identify.BalanceFit` from the torque balance.

    Raises:
        ValueError: unknown path or option, or a trace that can't be played.
        FitError: the simulation fails at every starting point.
        SchedulerError: nobody answers at the scheduler, or its workers can't do the work.

    """
    if mode not in MODES:
        raise ValueError(f"mode = {mode!r}; choose one of {', '.join(MODES)}")
    core, recorded = core_of(machine), named(traces)
    if mode == "auto":
        mode = which_mode(core, recorded, motion)
    if mode == "balance":
        if scheduler is not None:
            raise ValueError("scheduler: a torque balance has nothing to spread; leave it out")
        paths, prior = _balance_free(core, free, tolerance, offsets)
        driven = {name: with_torques(core, trace) for name, trace in recorded.items()}
        found = torque_balance(
            machine,
            driven,
            free=paths,
            prior=prior,
            offsets=offsets != "none",
            processing=processing,
            standstill=standstill,
            confidence=confidence,
            settings=settings,
        )
        warnings, notes = torque_warnings(core, driven), torque_notes(core, driven)
        return replace(found, warnings=tuple(warnings), notes=tuple(notes))
    refuse_filters(processing, standstill)
    played = records(
        machine,
        recorded,
        motion=motion,
        interpolation=interpolation,
        start=start,
        settings=settings,
    )
    paths = default_free(core) if free is None else list(free)
    if not paths:
        raise ValueError("free: nothing to fit; name parameters or add an effect")
    with mapper_for(scheduler) as mapper:
        problem = Problem(
            core,
            played,
            unknowns(core, paths, tolerance, _sizes(core, played)),
            state_unknowns(core, played),
            channels=channels_to_fit(played, channels),
            offsets=offsets,
            rtol=rtol,
            mapper=mapper,
        )
        search = Search(problem, max_simulations, progress)
        search.begin_near(initial_estimates(core, played, problem.parameters))
        search.run(starts, seed)
        return summary(machine, problem, search, confidence)


def which_mode(core: Any, traces: Mapping[str, Trace], motion: Any) -> str:
    """Closed loop where controller and commanded motion are known, else the balance."""
    return "balance" if why_balance(core, traces, motion) else "closed_loop"


def why_balance(core: Any, traces: Mapping[str, Trace], motion: Any) -> str:
    """What a simulation of the loop lacks, in words; nothing where it lacks nothing."""
    if core.controller_options["kind"] == "none":
        return f"{core.name} has no controller"
    silent = [name for name, trace in traces.items() if "theta_ref" not in trace]
    if motion is not None or not silent:
        return ""
    whose = f"{silent[0]} has" if len(silent) == 1 else f"{silent[0]} and others have"
    return f"{whose} no theta_ref"


def refuse_filters(processing: Processing | None, standstill: Standstill | None) -> None:
    """A closed loop is simulated as it is: raise ValueError if told to filter."""
    if processing is not None or standstill is not None:
        raise ValueError(
            "filters and standstill belong to the torque balance, and this is a closed loop; "
            "choose mode balance or leave them out"
        )


def _balance_free(
    core: Any,
    free: Sequence[str] | None,
    tolerance: float | Mapping[str, float] | None,
    offsets: str,
) -> tuple[list[str], float | Mapping[str, float] | None]:
    """What a torque balance fits, and the tolerance of each nominal value."""
    if free is not None:
        return list(free), tolerance
    paths = [path for path in default_free(core) if seen_in_balance(core, path)]
    if offsets != "none":
        paths = [path for path in paths if not path.endswith(".asymmetry")]
    if isinstance(tolerance, int | float):
        return paths, tolerance
    return paths, {**default_tolerances(core, paths), **(tolerance or {})}


def with_torques(core: Any, trace: Trace) -> Trace:
    """The trace with motor torques from its currents where only those were recorded."""
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        if f"I_{n}" in trace and f"T_{n}" not in trace:
            trace = trace.with_channel(f"T_{n}", core.get(f"{motor}.K_d") * trace[f"I_{n}"])
    return trace


def _sizes(core: Any, played: Sequence[Record]) -> dict[str, float]:
    """Path -> usual size of each effect's numbers on these records, where units tell.

    Torques: a tenth of the drives' mean-free torque, seen at the effect's place; what grows with
    speed, that over the speed there. Constants of recorders: a tenth of their channel's spread.
    A drive's limit: a little less than the most that was recorded of what it limits.
    """
    at_table = max((_torque_at_table(core, record) for record in played), default=0.0)
    speed = max(float(np.std(np.gradient(r.reference, r.t))) for r in played)
    sizes: dict[str, float] = {}
    for effect in core.effects:
        place = effect["members"][0]
        if effect["structural"]:
            sizes |= sizes_of_part(core, effect, played)
            continue
        ratio = ratio_to_table(core, place)
        for p in core.parameters():
            if not p.path.startswith(f"{effect['label']}."):
                continue
            if p.unit == "N*m" and at_table > 0:
                sizes[p.path] = 0.1 * at_table / ratio
            elif p.unit == "N*m*s/rad" and at_table > 0 and speed > 0:
                sizes[p.path] = 0.1 * at_table / speed / ratio**2
            elif effect["effect"] == "sensor_offset" and place in played[0].trace:
                sizes[p.path] = 0.1 * float(np.std(played[0].trace[place]))
    return sizes


def _torque_at_table(core: Any, record: Record) -> float:
    """Spread of the largest motor torque that was recorded, carried to the table."""
    found = 0.0
    for motor in core.motors:
        n = motor.rpartition("_")[2]
        for name, factor in ((f"T_{n}", 1.0), (f"I_{n}", core.get(f"{motor}.K_d"))):
            if name in record.trace:
                spread = factor * float(np.std(record.trace[name]))
                found = max(found, ratio_to_table(core, motor) * spread)
    return found
