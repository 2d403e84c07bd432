"""Diagnose: is the model good enough, where does it fail, what is missing, what to measure next."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from threadpoolctl import threadpool_limits

from dualdrive.compare import RecordWarning, check_records, evened
from dualdrive.diagnose.closed_loop import Job, diagnose_closed_loop
from dualdrive.diagnose.data_sheet import wrong_guesses
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.paragraph import paragraph
from dualdrive.diagnose.printed import Printed
from dualdrive.diagnose.result import Diagnosis
from dualdrive.diagnose.selection import EFFORTS
from dualdrive.diagnose.torque_balance import diagnose_torque_balance
from dualdrive.diagnose.work import Clock, Work
from dualdrive.echo import once
from dualdrive.estimation.thresholds import threshold
from dualdrive.identify import FitError, Processing, Standstill, refuse_filters, which_mode
from dualdrive.interrupt import interrupt
from dualdrive.replay import core_of, named, records
from dualdrive.traces import Trace

MODES = ("auto", "closed_loop", "balance")
#: warnings that would make any name a guess, though a comparison may live with them
SPOILT = ("scale", "sign", "swapped", "ratio")
#: of the simulated loop's error: a machine whose balance leaves less has another loop
_FOREIGN = 0.5


def diagnose(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    *,
    settings: Mapping[str, Mapping[str, float]] | None = None,
    mode: str = "auto",
    motion: Any = None,
    interpolation: str = "auto",
    start: str = "auto",
    processing: Processing | None = None,
    standstill: Standstill | None = None,
    tolerance: float | Mapping[str, float] | None = None,
    effort: str = "normal",
    budget: float = math.inf,
    threads: int | None = None,
    experiment: bool = True,
    checks: bool | Sequence[RecordWarning] = True,
    trust: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Say what records tell of a machine.

    The machine is confronted with the records: by its innovations, or by its torque balance where
    the controller is unknown. Its nominal numbers are refitted within the tolerances of data sheets
    under every hypothesis; every effect of the library is tried at every place, the best are
    refitted, alone and several at once, and judged by their likelihood. See
    docs/theory/innovations.md, and docs/theory/diagnosis.md for the balance.

    Args:
        machine: a machine, or the core's.
        traces: one trace, several, or name -> trace; taken by name, whatever their order.
        settings: name of a trace -> parameter path -> SI value that held while it was recorded.
        mode: ``closed_loop``, ``balance``, or ``auto``: closed loop where the machine has a
            controller and every trace a commanded motion.
        motion: commanded motion where the traces carry none.
        interpolation: how recorded inputs are read, see :func:`dualdrive.replay.records`.
        start: how the machine stood before, see there.
        processing: filters and decimation of the torque balance, as in `compare`.
        standstill: what its errors do near standstill; the search leaves standstill out, unless it
            is kept.
        tolerance: relative one-sigma tolerance of the nominal numbers, for all or by path; what
            `fit` takes unless given. A guess in the machine file wants a wide one.
        effort: ``quick``, ``normal`` or ``thorough``: how many replays are worth it. A torque
            balance, which replays nothing, ignores it.
        budget: seconds after which the search is stopped; the answer is then `unfinished`. No
            search reads a clock unless it is given.
        threads: records checked and simulations run side by side; as many as there are cores
            unless given.
        experiment: whether to plan the next experiment where names are left.
        checks: whether to look for swapped, flipped, clipped or foreign channels first; or what
            :func:`dualdrive.compare.check_records` found in the records that these are parts of.
        trust: records that are kept whatever the checks say; others in which a check finds what no
            machine could do are left out by name, and the rest goes on.
        progress: told in words what is being tried; Ctrl-C ends the search and keeps what is known.

    Raises:
        ValueError: unknown mode or path, or a trace that can not be held against this machine.
        FitError: the machine itself can not be simulated on the records.

    """
    for name, value, known in (("mode", mode, MODES), ("effort", effort, tuple(EFFORTS))):
        if value not in known:
            raise ValueError(f"{name} = {value!r}; choose one of {', '.join(known)}")
    tell = progress or (lambda _: None)
    # by name: no sum over records, and no list of warnings, depends on the order they were given in
    core, recorded = core_of(machine), dict(sorted(named(traces).items()))
    if stray := set(trust) - set(recorded):
        raise ValueError(
            f"trust: no trace {', '.join(sorted(stray))}; there are {', '.join(recorded)}"
        )
    chosen = mode
    if mode == "auto":
        mode = which_mode(core, recorded, motion)
    own = dict(settings or {})
    if stray := set(own) - set(recorded):
        raise ValueError(
            f"settings: no trace {', '.join(sorted(stray))}; there are {', '.join(recorded)}"
        )
    # simulations run side by side: BLAS threads beside them would only wait for one another
    with interrupt() as stop, threadpool_limits(1, "blas"):
        clock, names = Clock(budget, stop.is_set), list(recorded)
        warnings, late, clipped = list[str](), False, False
        if checks is not False:
            tell("checking the records")
            found = (
                check_records(machine, recorded, mode, threads) if checks is True else list(checks)
            )
            warnings = [f"{w.trace}: {w.message.removeprefix(f'{w.trace}: ')}" for w in found]
            bad = unfit(found) - set(trust)
            recorded = {name: trace for name, trace in recorded.items() if name not in bad}
            if not recorded:
                return _unfit(core, mode, tuple(bad), once(warnings, names), clock)
            warnings += [f"{name}: left out; --trust {name} overrules" for name in sorted(bad)]
            warnings = once(warnings, names)
            own = {name: values for name, values in own.items() if name in recorded}
            late = any(w.code == "skew" for w in found if w.trace in recorded)
            clipped = any(w.code == "clipped" for w in found if w.trace in recorded)
        even = {name: evened(trace) for name, trace in recorded.items()}
        uneven = [
            f"{name}: its stamps jitter by {1e6 * jitter:.3g} us about an even clock, which was "
            "used instead."
            for name, (_, jitter) in even.items()
            if jitter > 0.0
        ]
        warnings += once(uneven, names)
        recorded = {name: trace for name, (trace, _) in even.items()}
        if mode == "closed_loop":
            refuse_filters(processing, standstill)
            reading = {"motion": motion, "interpolation": interpolation, "start": start}
            played = records(machine, recorded, settings=own, **reading)
            cores = threads or os.cpu_count() or 1
            job = Job(own, reading, tolerance, effort, experiment, cores, tell, clock.stop)
            looped = diagnose_closed_loop(machine, played, recorded, warnings, job)
            driven = all(_driven(core, trace) for trace in recorded.values())
            asked = chosen == "auto" and looped.verdict == "unknown" and driven
            if not asked or drives_close(looped) or stop.is_set():
                return replace(looped, seconds=clock.used)
            tell("the torque balance")
            try:
                balanced = diagnose(
                    machine,
                    recorded,
                    settings=own,
                    mode="balance",
                    tolerance=tolerance,
                    budget=max(budget - clock.used, 1.0),
                    threads=threads,
                    experiment=experiment,
                    checks=False,
                    progress=progress,
                )
            except (ValueError, FitError):  # the records allow none: what the loop says stands
                return replace(looped, seconds=clock.used)
            why = foreign_loop(looped, balanced)
            if not why:
                return replace(looped, seconds=clock.used)
            return _minding(balanced, warnings, why, clock)
        c = TorqueBalance(
            core, recorded, own, processing, standstill, apart=not late, tolerance=tolerance
        )
        printed = Printed(recorded, own, processing, standstill)
        work = Work(clock, threads or os.cpu_count() or 1, tell)
        told = diagnose_torque_balance(machine, c, printed, warnings, work, clipped, experiment)
        if tolerance is not None or told.verdict != "unknown" or told.cut or clock.stop():
            return told
        tell("the same, the machine file's numbers taken for guesses")
        free = diagnose(
            machine,
            traces,
            settings=settings,
            mode="balance",
            processing=processing,
            standstill=standstill,
            tolerance=threshold("guessed"),
            budget=max(budget - clock.used, 1.0),
            threads=threads,
            experiment=experiment,
            checks=checks and found,
            trust=trust,
            progress=progress,
        )
        if not (why := wrong_guesses(core, told, free)):
            return replace(told, seconds=clock.used)
        return _minding(free, free.warnings, why, clock)


def _minding(d: Diagnosis, warnings: Sequence[str], why: str, clock: Clock) -> Diagnosis:
    """The same with a reason to mind why it was given beside what was asked first."""
    said = f"{d.paragraph} Mind: {why}."
    return replace(d, warnings=[*warnings, why], paragraph=said, seconds=clock.used)


def foreign_loop(looped: Diagnosis, balanced: Diagnosis) -> str:
    """Why a loop can't be the one that was recorded, in words; empty where it may be.

    A machine that closes the torque balance, which needs recorded motion and torque alone, while
    nothing explains the loop that makes that motion from the command: controller or command fail.
    """
    closes, left = balanced.error.get("best", math.nan), looped.error.get("refitted", math.nan)
    if balanced.verdict in ("unknown", "unfinished") or not closes < _FOREIGN * left:
        return ""
    return (
        f"the torque balance closes to {100 * closes:.3g} %, but no law makes the simulated loop "
        f"follow ({100 * left:.3g} %): the controller or the command is not the one that was "
        "recorded. Judged by torque balance, which needs neither; --mode closed_loop keeps to the "
        "loop"
    )


def drives_close(looped: Diagnosis) -> bool:
    """Whether the loop is the one that was recorded: no drive asks for torque beside the loop's.

    What another controller or a force that nobody told would give is missing at the drives.
    """
    shares = [m.share for body, m in looped.missing_torque.items() if body != "table"]
    return bool(shares) and max(shares) <= threshold("unexplained torque")


def _driven(core: Any, trace: Trace) -> bool:
    """Whether every motor's torque, or current, is recorded."""
    numbers = [motor.rpartition("_")[2] for motor in core.motors]
    return all(f"T_{n}" in trace or f"I_{n}" in trace for n in numbers)


def unfit(found: Sequence[RecordWarning]) -> set[str]:
    """Names of records in which a check found what would make any name a guess."""
    return {w.trace for w in found if w.fatal or w.code in SPOILT}


def _unfit(
    core: Any, mode: str, traces: Sequence[str], warnings: Sequence[str], clock: Clock
) -> Diagnosis:
    """Records from which nothing could be concluded name nothing."""
    blank = Diagnosis(
        machine=core.name,
        mode=mode,
        records=tuple(traces),
        verdict="unknown",
        candidates=(),
        groups=(),
        error={},
        warnings=list(warnings),
        seconds=clock.used,
    )
    return replace(blank, paragraph=paragraph(blank))
