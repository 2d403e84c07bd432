"""Improve: diagnose, add, refit, again, until nothing that can be named is left."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dualdrive.compare import check_records
from dualdrive.diagnose.clocks import evened
from dualdrive.diagnose.confront import Confrontation
from dualdrive.diagnose.diagnose import diagnose
from dualdrive.diagnose.equations import TorqueBalance
from dualdrive.diagnose.loop import ClosedLoop
from dualdrive.diagnose.result import Diagnosis, plain
from dualdrive.diagnose.search import records_alone
from dualdrive.identify import FitError, which_mode
from dualdrive.interrupt import interrupt
from dualdrive.replay import core_of, named, records
from dualdrive.traces import Trace

MOST = 4  # effects that are added one after the other
_WORTH = 0.98  # held-out error of the next step over that of the last, at most


@dataclass(frozen=True, eq=False)
class Step:
    """A rung of the ladder: headline errors on what was fitted and on what was held out."""

    label: str
    fitted: float
    held_out: float
    noise_floor: float
    command: str
    machine: Any


@dataclass(frozen=True, eq=False)
class Ladder:
    """How the error fell, and why it stopped.

    steps:     nominal, refitted, + effect, + second effect ...
    diagnoses: what was found before each step that adds an effect, and the last one
    held:      in words, what the steps were held against
    """

    steps: Sequence[Step]
    diagnoses: Sequence[Diagnosis]
    stopped: str
    held: str
    seconds: float

    @property
    def machine(self) -> Any:
        """The machine of the last step."""
        return self.steps[-1].machine

    @property
    def gap_closed(self) -> float:
        """Share of the refitted machine's held-out error above the floor that went."""
        refitted, last = self.steps[min(1, len(self.steps) - 1)], self.steps[-1]
        gap = refitted.held_out - refitted.noise_floor
        return float((refitted.held_out - last.held_out) / gap) if gap > 0 else 0.0

    def rows(self) -> list[tuple[str, ...]]:
        """Cells of the table, a head first."""
        head = ("step", "fitted", "held out", "noise floor")
        return [
            head,
            *(
                (s.label, *(_percent(x) for x in (s.fitted, s.held_out, s.noise_floor)))
                for s in self.steps
            ),
        ]

    def table(self) -> str:
        """The ladder as lines of text, and why it stopped."""
        rows = self.rows()
        widths = [max(len(row[k]) for row in rows) for k in range(4)]
        lines = ["  ".join(f"{c:<{w}}" for c, w in zip(r, widths, strict=True)) for r in rows]
        return "\n".join([*lines, f"held out: {self.held}", f"stopped: {self.stopped}"])

    def figures(self) -> dict[str, Any]:
        """Plain JSON values; ``None`` where a number is not finite."""
        return dict(
            plain(
                {
                    "steps": [
                        {
                            k: getattr(s, k)
                            for k in ("label", "fitted", "held_out", "noise_floor", "command")
                        }
                        for s in self.steps
                    ],
                    "stopped": self.stopped,
                    "held_out": self.held,
                    "gap_closed": self.gap_closed,
                    "seconds": self.seconds,
                    "diagnoses": [d.figures() for d in self.diagnoses],
                }
            )
        )


def improve(
    machine: Any,
    traces: Trace | Sequence[Trace] | Mapping[str, Trace],
    held_out: Trace | Sequence[Trace] | Mapping[str, Trace] | None = None,
    *,
    settings: Mapping[str, Mapping[str, float]] | None = None,
    mode: str = "auto",
    budget: float = 180.0,
    ambiguous: bool = False,
    most: int = MOST,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Ladder:
    """Add what is missing, one effect after the other, and hold every step against other data.

    Args:
        machine: a machine, or the core's.
        traces: what is fitted.
        held_out: what every step is held against; unless given, the second half of every trace,
            and the first half is fitted.
        settings: as for :func:`dualdrive.diagnose.diagnose`, of both kinds of trace.
        mode: as there.
        budget: seconds in all.
        ambiguous: whether to add the leader of a group that these records can't part.
        most: effects added at most.
        progress: told in words what is being tried.
        options: further ones of :func:`dualdrive.diagnose.diagnose`.

    Raises:
        ValueError: as there, or a trace too short to be halved.

    """
    begun, tell = time.monotonic(), progress or (lambda _: None)
    own, held = dict(settings or {}), ""
    fitting = {n: evened(t)[0] for n, t in named(traces).items()}
    other: dict[str, Trace] = {}
    if held_out is None and not _both_ways(machine, fitting, mode):
        held = "each stretch of time, foretold by the others (no half holds both directions)"
    elif held_out is None:
        halves = {name: _halved(trace) for name, trace in fitting.items()}
        fitting = {name: half[0] for name, half in halves.items()}
        other = {name: half[1] for name, half in halves.items()}
        held = "the second half of every trace"
    else:
        other = {n: evened(t)[0] for n, t in named(held_out).items()}
        held = ", ".join(other)
    if mode == "auto":
        mode = which_mode(core_of(machine), {**fitting, **other}, options.get("motion"))

    def error(m: Any, foretold: float) -> float:
        if not other:
            return foretold
        mine = {n: s for n, s in own.items() if n in other}
        c = confrontation(m, other, mine, mode, options)
        try:
            return c.headline(records_alone(c).left)
        except FitError:
            return float("nan")  # it does not even run there

    steps: list[Step] = []
    found: list[Diagnosis] = []
    stopped = f"{most} effects were added"
    current = machine
    with interrupt() as stop:
        for count in range(most + 1):
            left = budget - (time.monotonic() - begun)
            if left < 0.1 * budget:
                stopped = "the time is used up"
                break
            mine = {n: s for n, s in own.items() if n in fitting}
            d = diagnose(
                current,
                fitting,
                settings=mine,
                mode=mode,
                budget=left / 1.5,
                progress=progress,
                **{"experiment": count == 0, **options},
            )
            found.append(d)
            if stop.is_set():
                stopped = "stopped by hand"
            floor = d.error.get("noise_floor", float("nan"))
            if not steps:
                if d.refitted is None:
                    return Ladder([], found, "the records can not be judged", held, 0.0)
                tell("holding the machine as it stands against what was held out")
                e = d.error
                steps = [
                    Step("nominal", e["nominal"], error(machine, e["nominal"]), floor, "", machine),
                    Step(
                        "refitted",
                        e["refitted"],
                        error(d.refitted, e["held_out_refitted"]),
                        floor,
                        "",
                        d.refitted,
                    ),
                ]
                current = d.refitted
            if count == most or stop.is_set():
                break
            named_ = d.verdict == "effect" or (ambiguous and d.verdict == "ambiguous")
            if not named_ or d.improved is None:
                stopped = _why(d)
                break
            label = d.candidates[0].label
            tell(f"holding {label} against what was held out")
            step = Step(
                f"+ {label}",
                d.error["best"],
                error(d.improved, d.error["held_out_best"]),
                floor,
                d.command,
                d.improved,
            )
            if not math.isfinite(step.held_out):
                stopped = f"with {label} the machine can not be simulated on what was held out"
                break
            if step.held_out > _WORTH * steps[-1].held_out:
                stopped = (
                    f"{label} fits, but what was held out does not get better "
                    f"({100 * steps[-1].held_out:.3g} % to {100 * step.held_out:.3g} %)"
                )
                break
            if hasattr(d.improved, "note"):
                d.improved.note(f"added {label}, fitted to {', '.join(fitting)}")
            steps.append(step)
            current = d.improved
    return Ladder(steps, found, stopped, held, time.monotonic() - begun)


def confrontation(
    machine: Any,
    traces: Mapping[str, Trace],
    settings: Mapping[str, Mapping[str, float]],
    mode: str,
    options: Mapping[str, Any],
) -> Confrontation:
    """A machine and records, in the given mode."""
    if mode == "balance":
        return TorqueBalance(core_of(machine), traces, settings)
    known = {k: options[k] for k in ("motion", "interpolation", "start") if k in options}
    return ClosedLoop(core_of(machine), records(machine, traces, settings=settings, **known))


def _both_ways(machine: Any, traces: Mapping[str, Trace], mode: str) -> bool:
    """Whether the first half of every trace still moves both ways, if the whole does."""
    for name, trace in traces.items():
        codes = [
            {w.code for w in check_records(machine, {name: part}, mode)}
            for part in (trace, _halved(trace)[0])
        ]
        if "one_way" in codes[1] - codes[0] or "short" in codes[1] - codes[0]:
            return False
    return True


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %" if math.isfinite(share) else "–"


def _why(d: Diagnosis) -> str:
    if d.verdict == "ambiguous":
        names = ", ".join(d.groups[0]) if d.groups else d.candidates[0].label
        return f"these records can not tell apart what is left: {names}"
    if d.verdict == "unknown":
        return "something is left that no effect of the library explains"
    if d.mode == "balance":
        return (
            "what is left is too near the sensors' noise, as far as it can be reckoned, for a name"
        )
    return "nothing is left that these records could show"


def _halved(trace: Trace) -> tuple[Trace, Trace]:
    """Two halves, cut where the motion rests if it does anywhere near the middle."""
    t = trace.t
    if len(t) < 200:
        raise ValueError(f"{trace.name}: {len(t)} samples are too few to halve; give held-out data")
    middle = len(t) // 2
    name = next((n for n in ("theta_ref", "theta_m", "theta_1") if n in trace), None)
    if name is not None:
        speed = np.abs(np.gradient(trace[name], t))
        near = np.arange(int(0.4 * len(t)), int(0.6 * len(t)))
        calm = near[speed[near] <= 1e-3 * np.max(speed)]
        if len(calm):
            middle = int(calm[np.argmin(np.abs(calm - middle))])
    first = trace.between(float(t[0]), float(t[middle - 1]))
    second = trace.between(float(t[middle]), float(t[-1]))
    return first, second
