"""dualdrive optimise: how little tension is enough, and what more of it costs."""

from __future__ import annotations

from pathlib import Path

import click

from dualdrive.files import write_atomically
from dualdrive.machine import Machine
from dualdrive.optimise import ACCURACY, TENSION, Corner, Front, OptimiseError, corners, optimise
from dualdrive.units import parse_values
from dualdrive_cli._files import OUTPUT, PICTURE
from dualdrive_cli._keys import SETTING
from dualdrive_cli._motion import MOTION, motion_of
from dualdrive_cli._shared import (
    FAILED,
    analysis,
    command_line,
    console,
    give_up,
    load,
    pairs,
    write_json,
)


@click.command(
    epilog="Example: dualdrive optimise heavy-table-250t --over controller.T_ten=0:100%:11 "
    "--corner table.J=3e6:9.6e6 --plot front.png",
)
@click.option(
    "--motion", type=MOTION, help="Duty cycle; default: the machine's usual move, there and back."
)
@click.option(
    "--over",
    type=SETTING,
    multiple=True,
    metavar="PATH=VALUES",
    help="Numbers to choose, start:stop:count or a,b,c; repeatable. Default: tension and gain.",
)
@click.option(
    "--corner",
    "spread",
    type=SETTING,
    multiple=True,
    metavar="PATH=LOW:HIGH",
    help="What is not known or changes; repeatable; 80%:120% of the machine's own. Default: "
    "table.J=80%:120% and meshes.gap=70%:130%.",
)
@click.option("--no-corners", is_flag=True, help="The machine as it is, alone.")
@click.option(
    "--accuracy",
    type=click.Choice(sorted(ACCURACY)),
    default="peak_error",
    show_default=True,
    help="What stands for accuracy.",
)
@click.option("-o", "--output", type=OUTPUT, help="Write the machine with the least tension.")
@click.option("--plot", type=PICTURE, help="Draw the front and the flanks' margin.")
@analysis
def command(
    machine: str,
    settings: tuple[str, ...],
    motion: str | None,
    over: tuple[str, ...],
    spread: tuple[str, ...],
    no_corners: bool,
    accuracy: str,
    output: Path | None,
    plot: Path | None,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Find the least tension that keeps every flank closed, and trade heat against accuracy.

    Every design on the grid makes the duty cycle at every corner and counts with its worst; those
    that no other beats in both are printed, and --json has all. Designs whose loop is unstable at a
    corner have no figures; exit code 1 where all are, and where -o asks for a tension and none is
    enough.
    """
    m = load(machine, settings)
    cases = _cases(m, spread, no_corners)
    grid = {path: _values(m, path, text) for path, text in pairs(over)} or None
    duty = motion_of(motion, m)
    with console(err=True).status("optimising") as status:

        def show(done: int, total: int) -> None:
            status.update(f"optimising: {done} of {total} runs")

        try:
            found = optimise(m, duty, over=grid, cases=cases, accuracy=accuracy, progress=show)
        except OptimiseError as error:
            give_up(error, FAILED)
    if plot:
        _draw(found, plot)
    enough = found.least.tension
    if output and enough is not None:
        m.set(TENSION, enough)
        m.note("least tension that keeps every flank closed", command_line())
        m.save(output, overwrite=overwrite)
    write_json(json_to, found.figures())
    if json_to != "-":
        click.echo(found.table())
        for path in filter(None, (plot, output if enough is not None else None)):
            click.echo(f"written: {path}")
    if output and enough is None:
        give_up(f"{m.name}: {output} is not written: {found.least.reason}", FAILED)


def _cases(m: Machine, spread: tuple[str, ...], no_corners: bool) -> list[Corner]:
    if no_corners:
        if spread:
            raise click.UsageError("--no-corners and --corner: give one of them")
        return corners(m, {})
    ends = {}
    for path, text in pairs(spread):
        low, sign, high = text.partition(":")
        if not sign:
            raise click.BadParameter(f"--corner {path}={text}: write {path}=LOW:HIGH")
        ends[path] = (low, high)
    return corners(m, ends or None)


def _values(m: Machine, path: str, text: str) -> list[float]:
    """Percentages of a torque are those of the rated torque."""
    unit = m.parameter(path).unit
    reference = m.get("motor_1.T_rated") if unit == "N*m" else None
    values: list[float] = parse_values(text, unit, key=path, reference=reference).tolist()
    return values


def _draw(found: Front, path: Path) -> None:
    from dualdrive import plots

    with write_atomically(path) as temporary:
        plots.pareto(found).savefig(temporary)
