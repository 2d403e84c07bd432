"""Improve: diagnose, add, refit, again, until nothing that can be named is left."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from dualdrive.compare import RecordWarning, check_records, evened
from dualdrive.diagnose.decision import objection, takes_too_little
from dualdrive.diagnose.diagnosis import diagnose, unfit
from dualdrive.diagnose.ladder import Ladder, Step
from dualdrive.diagnose.phrases import beyond_noise
from dualdrive.diagnose.printed import Printed
from dualdrive.diagnose.result import Diagnosis
from dualdrive.diagnose.simulated_errors import simulated_error
from dualdrive.identify import which_mode
from dualdrive.interrupt import interrupt
from dualdrive.replay import core_of, named, records
from dualdrive.traces import Trace

MOST = 4  # effects that are added one after the other
_LAST = 0.1  # of the time: with less left nothing is begun
_BY_HAND = "by hand"
_BARE = 2  # rungs without an effect: nominal and refitted
_WORTH = 0.98  # held-out error of the next step over that of the last, at most


def improve(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    held_out: Trace | Sequence[Trace] | Mapping[str, Trace] | None = None,
    *,
    settings: Mapping[str, Mapping[str, float]] | None = None,
    mode: str = "auto",
    budget: float = math.inf,
    ambiguous: bool = False,
    most: int = MOST,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Ladder:
    """Add what is missing, one effect after the other, and hold every step against other data.

    Args:
        machine: a machine, or the core's.
        traces: what is fitted.
        held_out: what every step is held against; unless given, every stretch of the traces is
            predicted from the others (cross-validation).
        settings: as for :func:`dualdrive.diagnose.diagnose`, of both kinds of trace.
        mode: as there; what the first diagnosis is judged by holds for every step.
        budget: seconds in all, after which the climb is stopped; no search reads a clock unless
            it is given.
        ambiguous: whether to add the leader of a group that these records can't part.
        most: effects added at most.
        progress: told in words what is being tried.
        options: further ones of :func:`dualdrive.diagnose.diagnose`.

    Raises:
        ValueError: as there.

    """
    begun = time.monotonic()
    own = dict(settings or {})
    # by name, as a diagnosis takes them
    given = dict(sorted(named(traces).items()))
    apart = dict(sorted(named(held_out).items())) if held_out is not None else {}
    whole = dict(sorted({**given, **apart}.items()))
    if stray := set(options.get("trust", ())) - set(whole):
        raise ValueError(
            f"trust: no trace {', '.join(sorted(stray))}; there are {', '.join(whole)}"
        )
    likely = which_mode(core_of(machine), whole, options.get("motion")) if mode == "auto" else mode
    checked: bool | list[RecordWarning] = options.pop("checks", True)
    if checked is True:
        (progress or (lambda _: None))("checking the records")
        checked = check_records(machine, whole, likely, options.get("threads"))
    fitting = {n: evened(t)[0] for n, t in given.items()}
    other = {n: evened(t)[0] for n, t in apart.items()}
    held = ", ".join(other) or "cross-validated over stretches of time"
    if isinstance(checked, list):
        bad = unfit(checked) - set(options.get("trust", ()))
        if lost := sorted(bad & set(other) - set(fitting)):
            other = {name: trace for name, trace in other.items() if name not in lost}
            held += f" (left out: {', '.join(lost)}; --trust overrules)"
    options["trust"] = [name for name in options.get("trust", ()) if name in fitting]
    options["checks"] = checked
    climb = _Climb(machine, fitting, other, own, mode, budget, progress, options)
    with interrupt() as stop:
        stopped = climb.up(most, ambiguous, stop.is_set)
    return Ladder(climb.steps, climb.found, stopped, held, time.monotonic() - begun)


class _Climb:
    """The ladder as it grows: the machine so far, its steps and the diagnoses before them."""

    def __init__(
        self,
        machine: Any,
        fitting: Mapping[str, Trace],
        other: Mapping[str, Trace],
        settings: Mapping[str, Mapping[str, float]],
        mode: str,
        budget: float,
        progress: Callable[[str], None] | None,
        options: Mapping[str, Any],
    ) -> None:
        self.machine, self.fitting, self.other = machine, fitting, other
        self.settings, self.mode, self.options = settings, mode, options
        self.progress, self.tell = progress, progress or (lambda _: None)
        self.budget, self.end = budget, time.monotonic() + budget
        self.steps: list[Step] = []
        self.found: list[Diagnosis] = []

    def up(self, most: int, ambiguous: bool, stop: Callable[[], bool]) -> str:
        """Add what is missing; why it stopped, in words."""
        for count in range(most + 1):
            left = self.end - time.monotonic()
            if stop() or (math.isfinite(left) and left < _LAST * self.budget):
                return _BY_HAND if stop() else "the time is used up"
            d = self._diagnosed(left / 1.5, plan=count == 0)
            if not self.steps and not self._begin(d):
                return "the records can not be judged"
            if stop():
                return _BY_HAND
            if count < most and (why := self._step(d, ambiguous)):
                return why
        return f"{most} effects were added"

    def _diagnosed(self, budget: float, *, plan: bool) -> Diagnosis:
        mine = {n: s for n, s in self.settings.items() if n in self.fitting}
        d = diagnose(
            self.machine,
            self.fitting,
            settings=mine,
            mode=self.mode,
            budget=budget,
            progress=self.progress,
            **{"experiment": plan, **self.options},
        )
        self.found.append(d)
        self.mode = d.mode  # where its loop is not the recorded one, the balance's from here on
        return d

    def _begin(self, d: Diagnosis) -> bool:
        """The first two rungs, the machine as it came and refitted; whether there are any."""
        if d.refitted is None:
            return False
        self.tell("holding the machine as it stands against what was held out")
        floor = d.error.get("noise_floor", float("nan"))
        for label, key, foretold, machine in (
            ("nominal", "nominal", "nominal", self.machine),
            ("refitted", "refitted", "held_out_refitted", d.refitted),
        ):
            held = self._held_out(machine, d.error[foretold])
            self.steps.append(Step(label, d.error[key], held, floor, "", machine))
        self.machine = d.refitted
        return True

    def _step(self, d: Diagnosis, ambiguous: bool) -> str:
        """One rung more, or why there is none."""
        named_ = d.verdict == "effect" or (ambiguous and d.verdict == "ambiguous")
        if not named_ or d.improved is None:
            return self._denied(d) or _why(d)
        label, before = d.candidates[0].label, self.steps[-1].held_out
        self.tell(f"holding {label} against what was held out")
        held = self._held_out(d.improved, d.error["held_out_best"])
        if not math.isfinite(held):
            return f"with {label} the machine can not be simulated on what was held out"
        if held > _WORTH * before:
            return (
                f"{label} fits, but what was held out does not get better "
                f"({100 * before:.3g} % to {100 * held:.3g} %)"
            )
        if hasattr(d.improved, "note"):
            d.improved.note(f"added {label}, fitted to {', '.join(self.fitting)}")
        floor = d.error.get("noise_floor", float("nan"))
        self.steps.append(Step(f"+ {label}", d.error["best"], held, floor, d.command, d.improved))
        self.machine = d.improved
        return ""

    def _denied(self, d: Diagnosis) -> str:
        """Why laws that were added are taken back; empty where they stay, or there are none.

        Those rules of a diagnosis that need no statistics, of what was held out: the fitted records
        show nothing more, but these are missed by more than any adequate machine misses, and all
        laws together took little of it.
        """
        if len(self.steps) <= _BARE or not self.other:
            return ""
        before, last = self.steps[_BARE - 1], self.steps[-1]
        left = {"noise_floor": last.noise_floor, "refitted": before.held_out, "best": last.held_out}
        denied = objection(d.verdict, {"refitted": last.held_out})
        if not (denied and takes_too_little("effect", left)):
            return ""
        added = ", ".join(step.label.removeprefix("+ ") for step in self.steps[_BARE:])
        why = (
            f"{added} would leave {100 * last.fitted:.3g} % of what was fitted but "
            f"{100 * last.held_out:.3g} % of what was held out: taken back, and nothing is named"
        )
        self.machine = before.machine
        self.steps[_BARE:], first = [], self.found[0]
        unnamed = replace(
            first, verdict="unknown", groups=(), command="", improved=None, after=None
        )
        told = f"Something is missing, but {why}."
        self.found[:] = [replace(unnamed, paragraph=told, warnings=[*first.warnings, why])]
        return why

    def _held_out(self, machine: Any, foretold: float) -> float:
        """Error on the held-out records; not a number where the machine does not run there."""
        if not self.other:
            return foretold
        mine = {n: s for n, s in self.settings.items() if n in self.other}
        core, keywords = core_of(machine), ("motion", "interpolation", "start")
        if self.mode == "closed_loop":
            known = {k: self.options[k] for k in keywords if k in self.options}
            return simulated_error(core, records(machine, self.other, settings=mine, **known))
        filters = {k: self.options.get(k) for k in ("processing", "standstill")}
        return Printed(self.other, mine, **filters).error(machine)


def _why(d: Diagnosis) -> str:
    if d.verdict == "ambiguous":
        names = ", ".join(d.groups[0]) if d.groups else d.candidates[0].label
        return f"these records can not tell apart what is left: {names}"
    if d.verdict == "unfinished":
        return "the search was stopped before every law had its turn"
    if d.verdict == "unknown":
        return "something is left that no effect of the library explains"
    if beyond_noise(d.error, "refitted"):
        left, floor = d.error["refitted"], d.error["noise_floor"]
        return (
            f"nothing more can be named: {100 * left:.3g} % is left, the sensors alone leave "
            f"{100 * floor:.3g} %"
        )
    return "nothing is left that these records could show"
