"""What the verbs diagnose, improve and report share: settings of single traces, and tables."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.markup import escape
from rich.table import Table

from dualdrive.compare import Condition
from dualdrive.diagnose import VERDICTS, Diagnosis, Experiment, Ladder
from dualdrive.diagnose.selection import EFFORTS
from dualdrive.files import write_atomically
from dualdrive.machine import Machine
from dualdrive.readable import interval
from dualdrive.report.remedies import EXPLAINS, in_order, sizes
from dualdrive.traces import Trace
from dualdrive_cli._motion import motion_along
from dualdrive_cli._numbers import Real
from dualdrive_cli._shared import FAILED, STOPPED, USAGE, command_line, console, give_up
from dualdrive_cli._traces import (
    balancing,
    filters,
    interpolation_option,
    mode_option,
    motion_option,
    start_option,
    tolerance_of,
    tolerance_option,
)

budget_option = click.option(
    "--budget",
    type=Real(0, min_open=True, unit="s"),
    callback=lambda _ctx, _option, seconds: math.inf if seconds is None else seconds,
    show_default="none",
    metavar="s",
    help="Stop the search after so long, 2min say; one that was cut is no answer: it is called "
    "unfinished, and ends with exit code 1.",
)


effort_option = click.option(
    "--effort",
    type=click.Choice(list(EFFORTS)),
    default="normal",
    show_default=True,
    help="How much is tried, counted in replays: the same on a slow or busy computer.",
)


trust_option = click.option(
    "--trust",
    multiple=True,
    metavar="RECORD",
    help="Keep this record whatever the checks find in it.",
)


def confronting(function: Callable[..., Any]) -> Callable[..., Any]:
    """How a machine meets recordings while it is diagnosed; see `how`."""
    function = balancing(function)
    shared = (
        tolerance_option,
        mode_option,
        motion_option,
        start_option,
        interpolation_option,
        effort_option,
        trust_option,
    )
    for option in reversed(shared):
        function = option(function)
    return function


def how(
    machine: Machine,
    recorded: Mapping[str, Trace],
    *,
    mode: str,
    motion: str | None,
    start: str,
    interpolation: str,
    tolerances: tuple[str, ...],
    effort: str,
    trust: tuple[str, ...],
    cutoff: float | None,
    decimate: int | None,
    standstill: str | None,
    standstill_share: float | None,
) -> dict[str, Any]:
    """Keywords that diagnose and improve take alike."""
    return {
        "mode": mode,
        "motion": motion_along(motion, machine, recorded),
        "start": start,
        "interpolation": interpolation,
        "tolerance": tolerance_of(tolerances),
        "effort": effort,
        "trust": trust,
        **filters(cutoff, decimate, standstill, standstill_share),
    }


_MOST = 8  # rows of a table


def told(status: Any) -> Callable[[str], None]:
    """Show what is being tried, a line that replaces the one before."""
    return lambda what: status.update(escape(what))


def end(stop: threading.Event, *found: Diagnosis) -> None:
    """Leave with the exit code of what cut the search; all that is known is written.

    found: the last diagnosis, if there is one
    """
    sys.stdout.flush()
    if stop.is_set():
        give_up("stopped: this is what was known until then", STOPPED)
    refuse_unjudged(*found)
    if any(d.verdict == "unfinished" for d in found):
        give_up("unfinished: --budget cut the search; a longer one, or none, ends it", FAILED)


def refuse_unjudged(*found: Diagnosis) -> None:
    """Fail where no record could be judged, as with any other input that makes no sense."""
    for d in found:
        if not d.judged:
            give_up(f"{d.machine}: the records can't be judged: {' '.join(d.warnings)}", USAGE)


def refuse_no_step(ladder: Ladder, machine: Machine, stop: threading.Event) -> None:
    """Fail where an improvement has no step: its records can't be judged, or it was stopped."""
    if not ladder.steps:
        if not stop.is_set():
            refuse_unjudged(*ladder.diagnoses)
        give_up(f"{machine.name}: {ladder.stopped}", STOPPED if stop.is_set() else FAILED)


# --- tables ---------------------------------------------------------------------------------------


def show(d: Diagnosis) -> None:
    """A diagnosis as a person reads it."""
    screen = console()
    for line in d.warnings:
        screen.print(f"warning: {line}", style="yellow")
    best = f": {d.best.label}" if d.best else ""
    screen.print(f"{d.verdict}{best}", style="bold")
    screen.print(f"{d.paragraph or VERDICTS[d.verdict]}\n")
    if d.error:
        screen.print(_errors(d))
    if d.candidates:
        screen.print(_candidates(d))
    for line in _remarks(d):
        screen.print(line)


def _errors(d: Diagnosis) -> Table:
    table = Table(title="Error (RMS residual / RMS signal)", title_justify="left")
    table.add_column("machine")
    table.add_column("fitted", justify="right")
    table.add_column("cross-validated", justify="right")
    rows = [("as given", "nominal", ""), ("refitted", "refitted", "held_out_refitted")]
    if d.best is not None:
        rows.append((f"with {d.best.label}", "best", "held_out_best"))
    for label, fitted, held_out in rows:
        if fitted in d.error:
            numbers = _share(d.error[fitted]), _share(d.error.get(held_out, math.nan))
            table.add_row(label, *numbers)
    if d.best is None and d.candidates and math.isfinite(d.candidates[0].fitted):
        first = d.candidates[0]  # what the table below lists first, and has no name
        label = f"with {first.label}, not named"
        table.add_row(label, _share(first.fitted), _share(first.held_out))
    if "noise_floor" in d.error:
        # noise of an angle counts as often as the machine's inertia multiplies it
        whose = f"with {d.best.label}" if d.best is not None else "refitted"
        table.add_row(f"noise floor, {whose}", _share(d.error["noise_floor"]), "")
    return table


def _candidates(d: Diagnosis) -> Table:
    stopped = d.verdict == "unfinished"
    title = f"What could explain it{', none of it judged yet' if stopped else ''}"
    caption = f"explains: {EXPLAINS}"
    table = Table(title=title, title_justify="left", caption=caption, caption_justify="left")
    for head, side in (
        ("effect", "left"),
        ("probability", "right"),
        ("cross-validated", "right"),
        ("explains", "right"),
        ("gain", "right"),
        ("size", "left"),
    ):
        table.add_column(head, justify=side)  # type: ignore[arg-type]
    for c in in_order(d)[:_MOST]:
        chance = f"{c.probability:.2f}" if c.resolved and not stopped else "–"
        shares = (chance, _share(c.held_out), _share(c.explained), f"{c.gain:.0f}")
        size = "; ".join(filter(None, (*sizes(c)[:1], c.note)))
        table.add_row(c.label, *shares, size)
    return table


def _remarks(d: Diagnosis) -> list[str]:
    lines = [f"can't be told apart here: {', '.join(group)}" for group in d.groups]
    if d.equation is not None:
        lines.append(
            f"the equation that fails: {d.equation.name} ({d.equation.probability:.0%} sure)"
        )
    worst = sorted((c for c in d.where if _stands_out(c)), key=lambda c: -c.excess)[:4]
    if worst:
        found = "; ".join(f"{c.condition} ×{c.excess:.2g}" for c in worst)
        lines.append(f"where it fails most: {found}")
    if d.moved:
        found = "; ".join(
            f"{path} {interval(v.value, v.low, v.high, v.unit)}"
            for path, v in list(d.moved.items())[:_MOST]
        )
        lines.append(f"numbers that moved: {found}")
    if d.next_experiment is not None:
        lines += _experiment(d.next_experiment)
    lines += [f"Skipped: {line}" for line in d.cut]
    return lines


def _stands_out(c: Condition) -> bool:
    return c.excess > 1.2 if math.isnan(c.p) else c.excess > 1.0 and c.significant


def _experiment(best: Experiment) -> list[str]:
    apart = " from ".join(best.separates)
    head = f"next: {best.name}, to tell {apart} (expected distance {best.expected_distance:.3g})"
    return [head, *(f"  {command}" for command in best.commands)]


def show_ladder(found: Ladder) -> None:
    """The steps of an improvement, their errors, and why it stopped."""
    table = Table(title="Error (RMS residual / RMS signal)", title_justify="left")
    table.add_column("model")
    for head in ("fitted", "held out", "noise floor"):
        table.add_column(head, justify="right")
    for step in found.steps:
        shares = (step.fitted, step.held_out, step.noise_floor)
        table.add_row(step.label, *map(_share, shares))
    screen = console()
    for line in found.diagnoses[0].warnings:
        screen.print(f"warning: {line}", style="yellow")
    screen.print(table)
    screen.print(f"held out: {found.held}")
    screen.print(f"stopped: {found.stopped}")


def _share(value: float) -> str:
    return f"{value:.2%}" if math.isfinite(value) else "–"


# --- files ----------------------------------------------------------------------------------------


def save(machine: Machine, path: Path, change: str, *, known: Machine, overwrite: bool) -> None:
    """Write a machine file; what its history tells since `known` gets the command.

    change: what the history says where nothing was noted on the way
    """
    if len(machine.history) == len(known.history):
        machine.note(change)
    old, new = machine.history[: len(known.history)], machine.history[len(known.history) :]
    machine.history = (*old, *({**entry, "command": command_line()} for entry in new))
    machine.save(path, overwrite=overwrite)


def save_page(
    path: Path, d: Diagnosis, ladder: Ladder | None, machine: Machine, files: Sequence[Path]
) -> None:
    """Write the report of a diagnosis; machine: as it was given, files: of the records."""
    from dualdrive.report import Provenance, page

    improved = ladder.machine if ladder and ladder.steps else d.improved
    origin = Provenance.of(machine, files, improved=improved, commands=(command_line(),))
    text = page(d, ladder=ladder, provenance=origin)
    with write_atomically(path) as temporary:
        temporary.write_text(text, "utf-8")
