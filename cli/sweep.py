"""`dualdrive sweep`: one motion on a grid of machines, summed up run by run in one file."""

from __future__ import annotations

import json
import math
import shlex
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import NoReturn

import click

from dualdrive import sweeps
from dualdrive.machine import Machine
from dualdrive.units import human, parse

OUTPUT = Path("sweep.h5")


class Axes(click.Command):
    """Takes every ``--NAME VALUES`` that is no option of its own as an axis of the grid."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Set the axes aside before the options are read: values such as -1:1:5 look like one."""
        ctx.meta["command"] = shlex.join([*ctx.command_path.split(), *args])
        own = {name for option in self.get_params(ctx) for name in option.opts}
        axes: list[tuple[str, str]] = []
        rest: list[str] = []
        words = iter(args)
        for word in words:
            name, given, values = word.partition("=")
            if not name.startswith("--") or name == "--" or name in own:
                rest.append(word)
                continue
            check_axis(name, own)
            if not given:
                values = next(words, "")
            if not values or values.startswith("--") or values in own:
                refuse(f"{name}: needs values: start:stop:count or a,b,c, e.g. {name} 0:1e-3:20")
            axes.append((name.removeprefix("--"), values))
        ctx.meta["axes"] = axes
        return super().parse_args(ctx, rest)


class Refusal(click.ClickException):
    """One line on the error stream, and an exit code."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.exit_code = code  # type: ignore[misc]  # click means it to be set


def refuse(message: str, code: int = 2) -> NoReturn:
    """End with one line: 2 for what was asked for, 1 for what could not be computed."""
    raise Refusal(message, code)


def check_axis(name: str, options: set[str]) -> None:
    """A parameter has a point in its name: anything else is a slip."""
    if "." in name or name.removeprefix("--") in sweeps.ALIASES:
        return
    near = get_close_matches(name, [*options, *(f"--{alias}" for alias in sweeps.ALIASES)], 1)
    hint = f"did you mean {near[0]}?" if near else "parameters are such as --controller.K_v"
    refuse(f"{name}: no such option, nor a parameter; {hint}")


@click.command(cls=Axes, options_metavar="[OPTIONS] --PARAMETER VALUES...")
@click.argument("machine", required=False)
@click.option("--motion", metavar="TEXT", help="What the table is told to do, e.g. move:0.02,...")
@click.option("--load", metavar="TORQUE", help="Constant torque against positive motion.")
@click.option("--end", metavar="TIME", help="When a run ends, instead of the motion's own end.")
@click.option("--set", "changes", multiple=True, metavar="KEY=VALUE", help="Change the machine.")
@click.option("-o", "--output", type=click.Path(path_type=Path), default=OUTPUT, show_default=True)
@click.option("--resume", is_flag=True, help="Complete a sweep that was stopped.")
@click.option("--overwrite", is_flag=True, help="Replace the file if it is there already.")
@click.option("--jobs", type=int, metavar="N", help="Threads; default: all cores.")
@click.option(
    "--keep",
    is_flag=False,
    flag_value="all",
    metavar="[SIGNALS]",
    help="Store whole trajectories: all signals, or those named (e,T_1).",
)
@click.option("--rtol", type=float, default=1e-10, show_default=True, help="Solver's tolerance.")
@click.option("--max-steps", type=int, metavar="N", help="Give a run up after so many steps.")
@click.option("--json", "json_file", metavar="FILE|-", help="Write axes and figures as JSON.")
@click.option("--plot", type=click.Path(path_type=Path), help="Draw lines or a map to this file.")
@click.pass_context
def command(
    ctx: click.Context,
    machine: str | None,
    motion: str | None,
    load: str | None,
    end: str | None,
    changes: tuple[str, ...],
    output: Path,
    resume: bool,
    overwrite: bool,
    jobs: int | None,
    keep: str | None,
    rtol: float,
    max_steps: int | None,
    json_file: str | None,
    plot: Path | None,
) -> None:
    r"""Run one motion on a grid of machines and store the figures of every run.

    Any parameter or tie group of the machine is an axis; several make a grid. VALUES are
    start:stop:count (ends included) or a,b,c, in SI or with units. --delta is the half-gap of every
    mesh. MACHINE is a file or a preset.

    \b
    dualdrive sweep --delta 0:1e-3:20
    dualdrive sweep bench --delta 0,5mrad,10mrad --controller.T_ten 0:0.2:11 -o tension.h5
    dualdrive sweep --resume                       (completes sweep.h5)

    Killed or stopped at any moment, the file opens and --resume completes it. A run that fails
    carries its status and stops no other. Exit codes: 2 for what cannot be asked, 1 when the disk
    refuses or no run succeeded, 130 after Ctrl-C.
    """
    axes = dict_of(ctx.meta["axes"])
    if output.exists() and not (resume or overwrite):
        ways = "--resume completes it, --overwrite replaces it, -o names another"
        refuse(f"{output}: exists already; {ways}")
    with one_line_errors(), progress_bar() as progress, stopped_by_ctrl_c(output):
        if resume and not axes:
            if any((machine, motion, load, end, keep, changes)):
                refuse("--resume: give what the file holds again, axes too, or nothing but -o")
            result = sweeps.resume(output, jobs=jobs, progress=progress)
        else:
            result = sweeps.sweep(
                changed(Machine.load(machine) if machine else Machine.load(), changes, axes),
                axes,
                motion=motion,
                load=parse(load, "N*m", key="load") if load else 0.0,
                end=parse(end, "s", key="end") if end else None,
                rtol=rtol,
                max_steps=max_steps,
                jobs=jobs,
                output=output,
                resume=resume,
                overwrite=overwrite,
                keep=keep.split(",") if keep else (),
                progress=progress,
                command=ctx.meta["command"],
            )
    with one_line_errors(), result:
        report(result, json_file)
        if plot is not None:
            result.plot().savefig(plot)
            click.echo(f"{plot}: picture", err=True)
        judge(result)


def dict_of(pairs: list[tuple[str, str]]) -> dict[str, str]:
    """Axes by name; one given twice is refused, not replaced."""
    axes: dict[str, str] = {}
    for name, values in pairs:
        if name in axes:
            refuse(f"--{name}: given twice; give all its values at once")
        axes[name] = values
    return axes


def changed(machine: Machine, changes: tuple[str, ...], axes: dict[str, str]) -> Machine:
    """The machine with --set applied; what an axis sets cannot be set besides."""
    for change in changes:
        key, equals, value = (part.strip() for part in change.partition("="))
        if not equals:
            refuse(f"--set {change}: write KEY=VALUE, e.g. --set meshes.gap=20arcsec")
        machine.set(key, value)
        for axis in sweeps.lay_out(machine, axes).axes:
            if set(axis.members) & set(machine.core.members(key)):
                refuse(f"--set {change}: the axis {axis.path} sets it too; give one of them")
    return machine


@contextmanager
def one_line_errors() -> Iterator[None]:
    """What the package refuses ends the command in one line with the right code."""
    try:
        yield
    except sweeps.DiskError as error:
        refuse(str(error), 1)
    except (ValueError, OSError) as error:
        refuse(str(error))


@contextmanager
def stopped_by_ctrl_c(output: Path) -> Iterator[None]:
    """Let a first Ctrl-C end the sweep in good order, a second one at once."""
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)  # a kill does the file no harm
    try:
        yield
    except KeyboardInterrupt:
        with sweeps.load_sweep(output) as partial:
            total = math.prod(partial.shape)
            done = total - partial.pending
        again = f"'dualdrive sweep --resume -o {output}' completes it"
        refuse(f"{output}: stopped with {done} of {total} runs done; {again}", 130)
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def progress_bar() -> Iterator[sweeps.Progress | None]:
    """A bar with the time left on a terminal's error stream; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task("runs", total=None)

        def show(done: int, total: int, _: object) -> None:
            bar.update(task, completed=done, total=total)

        yield show


def report(result: sweeps.Sweep, json_file: str | None) -> None:
    """The figures in words, or as JSON."""
    if json_file == "-":
        click.echo(json.dumps(result.to_dict()))
        return
    if json_file:
        Path(json_file).write_text(json.dumps(result.to_dict()))
    click.echo("\n".join(summary(result)))


def summary(result: sweeps.Sweep) -> Iterator[str]:
    """Lines: what was swept, then the range of every figure and where its ends lie."""
    total = math.prod(result.shape)
    yield f"{result.path}: {total} runs of {result.attributes['machine_name']}"
    yield f"motion  {result.attributes['motion']}"
    for path, values in result.axes.items():
        first, last = (result.words(path, float(value)) for value in (values[0], values[-1]))
        yield f"axis    {path}: {first} to {last}, {len(values)} values"
    rows = [("figure", "lowest", "at", "highest", "at")]
    for name in result.figures:
        if ends := result.range(name):
            rows.append((name, *extreme(result, name, ends[0]), *extreme(result, name, ends[1])))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip()


def extreme(result: sweeps.Sweep, figure: str, run: int) -> tuple[str, str]:
    """A figure's value in a run, and where in the grid that run lies."""
    value = human(float(result.dataset[figure].values.flat[run]), result.unit(figure))
    return value, ", ".join(result.words(*item) for item in result.point(run).items())


def judge(result: sweeps.Sweep) -> None:
    """Say what failed; a sweep in which nothing succeeded has failed."""
    failed = result.failed
    if not failed:
        return
    point, status, message = failed[0]
    where = ", ".join(f"{path} = {result.words(path, value)}" for path, value in point.items())
    text = f"{len(failed)} of {math.prod(result.shape)} runs failed; first at {where}: {status}"
    text = f"{result.path}: {text}{': ' * bool(message)}{message}"
    if len(failed) == math.prod(result.shape):
        refuse(text, 1)
    click.echo(text, err=True)
