"""dualdrive sweep: one motion on a grid of machines, summed up run by run in one file."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from pathlib import Path

import click
from click.core import ParameterSource
from click.shell_completion import CompletionItem
from rich.table import Table

from dualdrive import sweeps
from dualdrive.files import FileError, write_atomically
from dualdrive.machine import Machine
from dualdrive.units import human, parse
from dualdrive_cli._files import PICTURE, Writes
from dualdrive_cli._keys import keys
from dualdrive_cli._motion import MOTION, is_file, motion_of
from dualdrive_cli._numbers import Whole
from dualdrive_cli._shared import (
    FAILED,
    STOPPED,
    USAGE,
    analysis,
    command_line,
    console,
    engine_option,
    give_up,
    load,
    method_option,
    pairs,
    rtol_option,
    scheduler_option,
    write_json,
)


class Axes(click.Command):
    """Takes every ``--NAME VALUES`` that is no option of its own as an axis of the grid."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Set the axes aside before the options are read: values such as -1:1:5 look like one."""
        if ctx.resilient_parsing:  # the shell completes a line that is not finished
            return super().parse_args(ctx, [word for word in args if not word.startswith("--")])
        own = {name for option in self.get_params(ctx) for name in option.opts}
        axes: dict[str, str] = {}
        rest: list[str] = []
        words = iter(args)
        for word in words:
            name, given, values = word.partition("=")
            if not name.startswith("--") or name == "--" or name in own:
                rest.append(word)
                continue
            _check_axis(name, own)
            values = values if given else next(words, "")
            if not values or values.startswith("--") or values in own:
                text = "needs values: start:stop:count or a,b,c"
                give_up(f"{name}: {text}, e.g. {name} 0:1e-3:20", USAGE)
            if name.removeprefix("--") in axes:
                give_up(f"{name}: given twice; give all its values at once", USAGE)
            axes[name.removeprefix("--")] = values
        ctx.obj = axes
        return super().parse_args(ctx, rest)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Options, and every parameter as one."""
        own = super().shell_complete(ctx, incomplete)
        if not incomplete.startswith("--"):
            return own
        axes = (f"--{key}" for key in (*sweeps.ALIASES, *keys(ctx)))
        return own + [CompletionItem(axis) for axis in axes if axis.startswith(incomplete)]


def _check_axis(name: str, options: set[str]) -> None:
    """A parameter has a point in its name: anything else is a slip."""
    if "." in name or name.removeprefix("--") in sweeps.ALIASES:
        return
    near = get_close_matches(name, [*options, *(f"--{alias}" for alias in sweeps.ALIASES)], 1)
    hint = f"did you mean {near[0]}?" if near else "parameters are such as --controller.K_v"
    give_up(f"{name}: no such option, nor a parameter; {hint}", USAGE)


@click.command(
    cls=Axes,
    options_metavar="[OPTIONS] --PARAMETER VALUES...",
    epilog="Example: dualdrive sweep --delta 0:1e-3:20 --controller.T_ten 0:60%:13",
)
@click.option(
    "--motion",
    type=MOTION,
    help="As of dualdrive simulate; default: a move that suits the machine.",
)
@click.option("--end", help="When a run stops, s; else the motion says.")
@click.option("--load", "load_torque", help="Constant load on the table, against positive motion.")
@click.option("--output-step", default="1ms", show_default=True, help="Time between samples.")
@click.option("--keep", is_flag=False, flag_value="all", metavar="[NAME,NAME]", help="Store whole "
              "signals too: those named, or all.")  # fmt: skip
@rtol_option
@engine_option
@method_option
@click.option("--energy/--no-energy", default=True, help="Keep the balance of energy of every run.")
@click.option("--max-steps", type=Whole(), help="Give a run up after so many integration steps.")
@click.option("--jobs", type=Whole(), help="Threads; default: all cores.")
@scheduler_option
@click.option("-o", "--output", type=Writes(resumed=True), default="sweep.h5", show_default=True)
@click.option("--resume", is_flag=True, help="Complete a sweep that was stopped.")
@click.option("--plot", type=PICTURE, help="Draw lines (one axis) or a map into a picture.")
@analysis
@click.pass_context
def command(
    ctx: click.Context,
    machine: str,
    motion: str | None,
    settings: tuple[str, ...],
    end: str | None,
    load_torque: str | None,
    output_step: str,
    keep: str | None,
    rtol: float,
    engine: str,
    method: str,
    energy: bool,
    max_steps: int | None,
    jobs: int | None,
    scheduler: str | None,
    output: Path,
    resume: bool,
    plot: Path | None,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Run one motion on a grid of machines and store the figures of every run.

    Every parameter or tie group of the machine can be an axis (--controller.K_v 2:10:9), several
    make a grid. VALUES are start:stop:count (ends included) or a,b,c, SI or with units. --delta is
    the half-gap of every mesh.

    Killed or stopped at any moment, the file opens, and --resume completes it; dualdrive sweep
    --resume -o FILE needs no more than that. A run that fails carries its status and stops no
    other; exit code 1 only if none succeeded.
    """
    axes: dict[str, str] = ctx.obj
    again = f"'dualdrive sweep --resume -o {output}'"
    if motion is not None and is_file(motion):  # the swept file holds no samples of it
        again = "the same command with --resume"
    with _progress_bar() as progress, _resumable(output, again):
        if resume and not axes:
            _refuse_anything_else(ctx)
            result = sweeps.resume(output, jobs=jobs, scheduler=scheduler, progress=progress)
        else:
            m = load(machine, settings)
            _refuse_double(m, settings, axes)
            unit = m.unit_of("T_load", "N*m")
            result = sweeps.sweep(
                m,
                axes,
                motion=motion_of(motion, m),
                load=parse(load_torque, unit, key="--load") if load_torque is not None else 0.0,
                end=parse(end, "s", key="--end") if end is not None else None,
                output_step=parse(output_step, "s", key="--output-step"),
                engine=engine,
                rtol=rtol,
                method=method,
                max_steps=max_steps,
                energy=energy,
                jobs=jobs,
                scheduler=scheduler,
                output=output,
                resume=resume,
                overwrite=overwrite,
                keep=keep.split(",") if keep else (),
                progress=progress,
                command=command_line(),
            )
    with result:
        if plot:
            with write_atomically(plot) as temporary:
                result.plot().savefig(temporary)
        _report(result, json_to, plot)
        _judge(result)


def _refuse_anything_else(ctx: click.Context) -> None:
    """A bare --resume takes all from the file; what would be ignored is refused."""
    about_the_file = {"output", "resume", "jobs", "scheduler", "plot", "json_to", "overwrite"}
    for option in ctx.command.params:
        source = ctx.get_parameter_source(str(option.name))
        if source is ParameterSource.COMMANDLINE and option.name not in about_the_file:
            rule = "the file says it already; give the whole command again, or --resume and -o"
            give_up(f"{option.opts[0]}: {rule}", USAGE)


def _refuse_double(m: Machine, settings: tuple[str, ...], axes: dict[str, str]) -> None:
    """What an axis sets cannot be set besides."""
    for key, value in pairs(settings):
        if "." not in key:
            continue
        for axis in sweeps.lay_out(m, axes).axes:
            if set(axis.members) & set(m.core.members(key)):
                rule = f"the axis {axis.path} sets it too; give one of them"
                give_up(f"--set {key}={value}: {rule}", USAGE)


@contextmanager
def _resumable(output: Path, again: str) -> Iterator[None]:
    """Say, where Ctrl-C has left runs to be done, that the command `again` does them later."""
    try:
        yield
    except KeyboardInterrupt:
        with suppress(FileError), sweeps.load_sweep(output) as partial:
            total, left = math.prod(partial.shape), partial.pending
            if left:
                done = f"{total - left} of {total} runs done"
                give_up(f"{output}: stopped with {done}; {again} completes it", STOPPED)
        raise


@contextmanager
def _progress_bar() -> Iterator[sweeps.Progress | None]:
    """A bar with the time left on a terminal's error stream; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), "runs, left", TimeRemainingColumn())
    with Progress(*columns, console=console(err=True)) as bar:
        task = bar.add_task("runs", total=None)

        def show(done: int, total: int, _: object) -> None:
            bar.update(task, completed=done, total=total)

        yield show


def _report(result: sweeps.Sweep, json_to: str | None, plot: Path | None) -> None:
    """What was swept, the range of every figure, and where its ends lie."""
    if json_to:
        write_json(json_to, result.to_dict())
    if json_to == "-":
        return
    about = Table.grid(padding=(0, 2))
    about.add_row("machine", str(result.attributes["machine_name"]))
    about.add_row("motion", str(result.attributes["motion"]))
    for path, values in result.axes.items():
        first, last = (result.words(path, float(value)) for value in (values[0], values[-1]))
        about.add_row(path, f"{first} to {last}, {len(values)} values")
    for written in filter(None, (result.path, plot)):
        about.add_row("written", str(written))
    steady = dict[str, str]()
    ranges = Table("figure", "lowest", "at", "highest", "at", box=None, pad_edge=False)
    for name in result.figures:
        if ends := result.range(name):
            low, high = (_extreme(result, name, run) for run in ends)
            if low[0] == high[0]:  # in the digits that are shown
                steady[name] = low[0]
            else:
                ranges.add_row(name, *low, *high)
    console().print(about, *([ranges] if ranges.row_count else []))
    if steady:
        named = ", ".join(f"{name} {value}" for name, value in steady.items())
        console().print(f"do not change over the grid: {named}")


def _extreme(result: sweeps.Sweep, figure: str, run: int) -> tuple[str, str]:
    """A figure's value in a run, and where in the grid that run lies."""
    value = human(float(result.dataset[figure].values.flat[run]), result.unit(figure))
    return value, ", ".join(result.words(*item) for item in result.point(run).items())


def _judge(result: sweeps.Sweep) -> None:
    """Say what failed; a sweep in which nothing succeeded has failed."""
    failed, total = result.failed, math.prod(result.shape)
    if not failed:
        return
    point, status, message = failed[0]
    where = ", ".join(f"{path} = {result.words(path, value)}" for path, value in point.items())
    text = f"{result.path}: {len(failed)} of {total} runs failed; first at {where}: {status}"
    text = f"{text}: {message}" if message else text
    if len(failed) == total:
        give_up(text, FAILED)
    click.echo(f"dualdrive: {text}", err=True)
