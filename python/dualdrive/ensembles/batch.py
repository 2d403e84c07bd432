"""ensemble(machine, motion, values) -> Ensemble: what differs between runs, checked and begun."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dualdrive import _core
from dualdrive.figures import Reduction, reductions
from dualdrive.machine import Machine, MachineError
from dualdrive.motion import Motion
from dualdrive.simulation import Signal, driven

from .runs import Ensemble, cores

__all__ = ["ensemble"]

Floats = NDArray[np.float64]
Inputs = Mapping[str, Signal]


def ensemble(
    machine: Machine,
    motion: Motion | list[Motion] | None = None,
    values: Mapping[str, ArrayLike] | None = None,
    *,
    load: Signal | list[Signal] | None = None,
    inputs: Inputs | list[Inputs] | None = None,
    initial: Mapping[str, float] | None = None,
    end: float | None = None,
    start: float = 0.0,
    output_step: float = 1e-3,
    times: ArrayLike | None = None,
    measures: Mapping[str, Reduction | tuple[Any, ...]] | None = None,
    keep: Iterable[str] = (),
    jobs: int | None = None,
    ordered: bool = False,
    **options: Any,
) -> Ensemble:
    """Begin many runs of one machine with other numbers, motions, loads or inputs.

    values:   parameter path, tie group or initial.<state> -> SI values, one per run, shape (n,), or
              one for all
    motion, load, inputs: as of `simulate`; or a list of them, one per run
    end:      s; default: when the last motion ends. All runs share their output times
    measures: name -> (signal, measure[, begin, end]): what is summed up of every run beside its
              figures; min, max, range, peak, mean, rms or final over the output times from begin to
              end, s
    keep:     signals that every run hands over whole
    jobs:     threads; all cores without it. Results do not depend on it
    ordered:  hand runs over by number, not as they finish
    options:  of `simulate`: engine, rtol, method, longest_step, max_steps, energy

    A run that is refused or fails carries that as its status and stops no other. Memory does not
    grow with the number of runs, but for their figures. Raises MachineError for what makes no
    sense in any run.
    """
    columns = {path: np.asarray(given, float) for path, given in (values or {}).items()}
    count = _count(columns, motion, load, inputs)
    for path, given in columns.items():
        _check_path(machine, path)
        columns[path] = np.ascontiguousarray(np.broadcast_to(given, count))
    cases = [driven(machine, *case) for case in _cases(motion, load, inputs)]
    t, end = _times(times, start, end, output_step, [made for made, _ in cases])
    wanted = {name: Reduction(*given) for name, given in (measures or {}).items()}
    keep = list(dict.fromkeys(keep))
    _check_signals(machine, cases[0][1], [*keep, *(r.signal for r in wanted.values())])
    summed_up = [{**reductions(machine, made, end), **wanted} for made, _ in cases]
    try:
        core = _core.Ensemble(
            machine.core,
            [
                _core.Scenario(
                    given,
                    start=start,
                    end=end,
                    initial=dict(initial or {}),
                    reductions=list(summed.values()),
                    **{name: value for name, value in options.items() if value is not None},
                )
                for (_, given), summed in zip(cases, summed_up, strict=True)
            ],
            paths=list(columns),
            values=np.column_stack(list(columns.values())) if columns else np.empty((count, 0)),
            times=t,
            signals=keep,
            threads=cores() if jobs is None else jobs,
            ordered=ordered,
        )
    except ValueError as error:
        raise MachineError(f"{machine.name}: {error}") from None
    return Ensemble(core, machine.copy(), columns, t, keep, wanted, list(summed_up[0]), count)


def _count(columns: Mapping[str, Floats], *cases: object) -> int:
    """The number of runs, on which all that differs must agree; one where nothing does."""
    counts = {path: column.size for path, column in columns.items() if column.ndim}
    for name, given in zip(("motion", "load", "inputs"), cases, strict=True):
        if isinstance(given, list):
            counts[name] = len(given)
    for path, column in columns.items():
        if column.ndim > 1:
            raise MachineError(f"{path}: {column.ndim} dimensions; give one value per run")
    if len(set(counts.values())) > 1:
        each = ", ".join(f"{name}: {count}" for name, count in counts.items())
        raise MachineError(f"{each} values; give as many of each, or a single one for all runs")
    return next(iter(counts.values()), 1)


def _cases(
    motion: Motion | list[Motion] | None,
    load: Signal | list[Signal] | None,
    inputs: Inputs | list[Inputs] | None,
) -> list[tuple[Motion | None, Signal | None, Inputs | None]]:
    """What each run is driven by; a single entry where that is the same for all."""
    lists = [given for given in (motion, load, inputs) if isinstance(given, list)]
    count = len(lists[0]) if lists else 1

    def each(given: Any) -> Sequence[Any]:
        return given if isinstance(given, list) else [given] * count

    return list(zip(each(motion), each(load), each(inputs), strict=True))


def _times(
    times: ArrayLike | None,
    start: float,
    end: float | None,
    output_step: float,
    motions: Sequence[Motion | None],
) -> tuple[Floats, float]:
    """Output times and end as `simulate` has them."""
    if times is not None:
        t = np.array(times, float)
        return t, float(t[-1]) if end is None else end
    if end is None:
        ends = [motion.end for motion in motions if motion is not None]
        if not ends:
            raise MachineError("end: missing; without a motion nothing says when to stop")
        end = max(ends)
    if not (output_step > 0 and end > start):
        raise MachineError(f"end = {end}, output_step = {output_step}: must be after the start")
    count = int(np.floor((end - start) / output_step * (1 + 1e-12)))
    return np.asarray(start + np.arange(count + 1) * output_step, np.float64), end


def _check_path(machine: Machine, path: str) -> None:
    """A number that no law reads would be a variation without consequence."""
    if path.startswith("initial."):
        return
    machine.parameter(path)
    idle = machine.core.unread(path)
    if idle:
        raise MachineError(f"{machine.name}: {path}: nothing reads it, for {idle}; leave it out")


def _check_signals(
    machine: Machine, inputs: Mapping[str, _core.Waveform], names: Sequence[str]
) -> None:
    known = [*(name for name, _, _ in machine.core.signals()), *(f"in.{name}" for name in inputs)]
    for name in names:
        if name not in known:
            near = " or ".join(get_close_matches(name, known)) or ", ".join(known)
            raise MachineError(f"{machine.name}: no signal {name!r}; take {near}")
