"""What verbs that take measured traces share."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from dualdrive.files import same_file
from dualdrive.identify import Processing, Standstill
from dualdrive.machine import Machine
from dualdrive.traces import Trace, read_parts
from dualdrive.traces.log import Issue
from dualdrive_cli._files import TRACE, Reads
from dualdrive_cli._keys import SETTING
from dualdrive_cli._motion import MOTION, motion_along
from dualdrive_cli._numbers import Real, Whole
from dualdrive_cli._shared import pairs

traces_argument = click.argument("traces", nargs=-1, required=True, type=TRACE, metavar="TRACE...")
map_option = click.option(
    "--map",
    "mapping",
    type=Reads(),
    help="How the columns become channels; the mapping beside a trace unless given.",
)
part_option = click.option(
    "--part",
    "wanted",
    multiple=True,
    metavar="SETTING=VALUE",
    help="Of a trace that its mapping splits, these parts only: --part TestIndex=3",
)
tolerance_option = click.option(
    "--tolerance",
    "tolerances",
    type=SETTING,
    multiple=True,
    metavar="SHARE|KEY=SHARE",
    help="One sigma about the nominal value, for all or one: 0.1, table.J=5%.",
)
mode_option = click.option(
    "--mode",
    type=click.Choice(["auto", "closed_loop", "balance"]),
    default="auto",
    show_default=True,
    help="Simulate the loop, or close the torque balance where the controller is unknown.",
)
motion_option = click.option(
    "--motion",
    type=MOTION,
    help="Commanded motion of traces that carry no theta_ref, on their clock; see dualdrive "
    "simulate.",
)
start_option = click.option(
    "--start",
    type=click.Choice(["auto", "rest", "settled"]),
    default="auto",
    show_default=True,
    help="Were the drives switched on with the first sample, or had they held it for long?",
)
offsets_option = click.option(
    "--offsets",
    type=click.Choice(["all", "encoders", "none"]),
    default="all",
    show_default=True,
    help="Which sensors may read too much by a constant.",
)
interpolation_option = click.option(
    "--interpolation",
    type=click.Choice(["auto", "cubic", "linear", "hold"]),
    default="auto",
    show_default=True,
    help="Of the recorded command between its samples.",
)


_BALANCE = (
    click.option(
        "--cutoff",
        type=Real(0, min_open=True, unit="Hz"),
        metavar="Hz",
        help="Balance: low-pass of angles and torques; unless given a tenth of the sampling rate, "
        "or less where an encoder's noise asks for it.",
    ),
    click.option(
        "--decimate",
        type=Whole(1),
        help="Balance: every n-th sample counts; unless given, as --cutoff needs.",
    ),
    click.option(
        "--standstill",
        type=click.Choice(["mask", "bound", "keep"]),
        help="Balance: drop samples near standstill, where dry friction is open; count what its "
        "limits leave; or keep them.  [default: mask]",
    ),
    click.option(
        "--standstill-share",
        type=Real(0, 1),
        metavar="SHARE",
        help="Balance: standstill is below this share of the highest speed.  [default: 0.01]",
    ),
)


set_for_option = click.option(
    "--set-for",
    "set_for",
    multiple=True,
    metavar="TRACE:KEY=VALUE",
    help="Set while this trace was recorded: --set-for two.csv:controller.T_ten=0",
)


def balancing(function: Callable[..., Any]) -> Callable[..., Any]:
    """How records were taken and are filtered: settings of single traces, filters, standstill."""
    for option in reversed((set_for_option, *_BALANCE)):
        function = option(function)
    return function


def replaying(function: Callable[..., Any]) -> Callable[..., Any]:
    """How a machine meets recordings: mode, command, start, sensors, filters."""
    shared = (mode_option, motion_option, start_option, offsets_option, interpolation_option)
    function = balancing(function)
    for option in reversed(shared):
        function = option(function)
    return function


def read_all(
    paths: Sequence[Path], mapping: Path | None, wanted: Sequence[str] = ()
) -> dict[str, Trace]:
    """Every trace, or every part of it, under the shortest name that tells it from the others.

    wanted: settings SETTING=VALUE that a part must have been recorded under

    Raises TraceError naming file, rows, rule and way out.
    """
    return _read(_names(paths), mapping, wanted)


def read_apart(
    paths: Sequence[Path], held_out: Sequence[Path], mapping: Path | None, wanted: Sequence[str]
) -> tuple[dict[str, Trace], dict[str, Trace]]:
    """What is fitted, as `read_all` has it, and what is held out, no name of one in the other.

    Raises click.BadParameter where a record, or a copy of it, is on both sides; else as there.
    """
    for path in held_out:
        if any(same_file(path, other) for other in paths):
            raise click.BadParameter(f"--held-out {path}: is fitted too; {_APART}")
    names = _names([*paths, *held_out])
    recorded = _read({name: path for name, path in names.items() if path in paths}, mapping, wanted)
    unseen = _read({name: path for name, path in names.items() if path in held_out}, mapping)
    for name, trace in unseen.items():
        for other, fitted in recorded.items():
            if trace.same_samples(fitted):
                copied = f"holds the samples of {other}, which is fitted"
                raise click.BadParameter(f"--held-out {name}: {copied}; {_APART}")
    return recorded, unseen


_APART = "a test needs a record of its own"


def _names(paths: Sequence[Path]) -> dict[str, Path]:
    """The shortest names that tell files from each other. Raises click.BadParameter."""
    stems = [path.stem for path in paths]
    names = stems if len(set(stems)) == len(stems) else [str(path) for path in paths]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise click.BadParameter(f"{twice} is named twice; name every trace once")
    return dict(zip(names, paths, strict=True))


def _read(
    files: Mapping[str, Path], mapping: Path | None, wanted: Sequence[str] = ()
) -> dict[str, Trace]:
    found = {
        name + part.name.removeprefix(path.stem): part
        for name, path in files.items()
        for part in read_parts(path, mapping)
    }
    for setting, value in pairs(tuple(wanted)):
        found = _recorded_under(found, setting, value)
    _tell_repairs(found)
    return found


def _tell_repairs(parts: dict[str, Trace], most: int = 6) -> None:
    """On stderr, what was amiss in the recordings and how it was met."""
    found: dict[str, dict[str, Issue]] = {}  # kind -> name of a part -> the first of that kind
    for name, part in parts.items():
        for issue in (*part.log.troubles, *part.log["unmapped"]):
            found.setdefault(issue.kind, {}).setdefault(name, issue)
    told = [_once(kind, issues) for kind, issues in found.items()]
    for line in told[:most]:
        click.echo(line, err=True)
    if len(told) > most:
        click.echo(f"... and {len(told) - most} more; see trace.log in Python", err=True)


def _once(kind: str, issues: Mapping[str, Issue]) -> str:
    """A kind of trouble in a line: the first part's in full, the others by name."""
    (first, issue), *others = issues.items()
    names = [name for name, _ in others[:3]] + (["..."] if len(others) > 3 else [])
    more = f"; {kind} in {len(others)} more: {', '.join(names)}" if others else ""
    return f"{first}: {issue}{more}"


def _recorded_under(parts: dict[str, Trace], setting: str, value: str) -> dict[str, Trace]:
    there = {part.labels[setting] for part in parts.values() if setting in part.labels}
    if not there:
        known = sorted({name for part in parts.values() for name in part.labels})
        splits = f"parts differ in {', '.join(known)}" if known else "the mapping splits nothing"
        raise click.BadParameter(f"--part {setting}={value}: no such setting; {splits}")
    kept = {n: p for n, p in parts.items() if f"{p.labels.get(setting, math.nan):g}" == value}
    if not kept:
        values = ", ".join(f"{v:g}" for v in sorted(there))
        raise click.BadParameter(f"--part {setting}={value}: no such part; {setting} is {values}")
    return kept


def settings_for(
    machine: Machine, texts: Sequence[str], traces: Iterable[str]
) -> dict[str, dict[str, float]]:
    """Trace -> parameter path -> SI value, from TRACE:KEY=VALUE; TRACE with or without its ending.

    Raises click.BadParameter for a trace that is not there, MachineError for a path or value.
    """
    names, found = list(traces), dict[str, dict[str, float]]()
    for text in texts:
        trace, colon, setting = text.rpartition(":")
        path, sign, value = setting.partition("=")
        if not colon or not sign or not trace:
            rule = "is not TRACE:KEY=VALUE, e.g. two.csv:controller.T_ten=0"
            raise click.BadParameter(f"--set-for {text!r} {rule}")
        name = next((n for n in (trace, Path(trace).stem) if n in names), None)
        if name is None:
            there = ", ".join(names)
            raise click.BadParameter(f"--set-for {text!r}: no trace {trace}; there are {there}")
        trial = machine.copy()
        trial.set(path.strip(), value.strip())
        found.setdefault(name, {})[path.strip()] = trial.get(path.strip())
    return found


def replay_options(
    machine: Machine,
    recorded: Mapping[str, Trace],
    *,
    motion: str | None,
    start: str,
    offsets: str,
    interpolation: str,
    cutoff: float | None,
    decimate: int | None,
    standstill: str | None,
    standstill_share: float | None,
) -> dict[str, Any]:
    """Keywords that compare and fit take alike."""
    return {
        "motion": motion_along(motion, machine, recorded),
        "start": start,
        "offsets": offsets,
        "interpolation": interpolation,
        **filters(cutoff, decimate, standstill, standstill_share),
    }


def filters(
    cutoff: float | None,
    decimate: int | None,
    standstill: str | None,
    standstill_share: float | None,
) -> dict[str, Any]:
    """Keywords of a torque balance's filters: what was given of them, None where nothing was."""
    return {
        "processing": _told(Processing, cutoff=cutoff, decimate=decimate),
        "standstill": _told(Standstill, treatment=standstill, share=standstill_share),
    }


def _told(kind: Callable[..., Any], **given: Any) -> Any:
    """An object with what was given, or None where nothing was."""
    own = {name: value for name, value in given.items() if value is not None}
    return kind(**own) if own else None


def tolerance_of(texts: tuple[str, ...]) -> float | dict[str, float] | None:
    """What --tolerance says: one share for all, or by path; None where it was not given."""
    plain = [text for text in texts if "=" not in text]
    if plain and len(texts) > 1:
        raise click.BadParameter("--tolerance: one number for all, or key=share for some, not both")
    if plain:
        return _share(plain[0])
    return {path: _share(text, path) for path, text in pairs(texts)} or None


def _share(text: str, path: str = "") -> float:
    from dualdrive.units import parse

    return parse(text, "", key=f"--tolerance {path}".strip())
