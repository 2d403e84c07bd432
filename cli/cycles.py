"""dualdrive cycles: limit cycles of a machine at standstill: predicted, exact, followed, mapped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from rich.progress import Progress
from rich.table import Table

from dualdrive import cycles, sweeps
from dualdrive.files import write_atomically
from dualdrive.machine import Machine
from dualdrive.units import human, parse
from dualdrive_cli._files import PICTURE
from dualdrive_cli._keys import SETTING
from dualdrive_cli._numbers import Whole
from dualdrive_cli._shared import analysis, console, load, write_json
from dualdrive_cli.sweep import Axes


@click.command(
    cls=Axes,
    options_metavar="[OPTIONS] [--PARAMETER VALUES...]",
    epilog="Example: dualdrive cycles heavy-table-550t --set controller.T_ten=0 --plot hunting.png",
)
@click.option("--guess", type=click.Choice(["simulation", "describing function"]),
              default="simulation", show_default=True, help="Where the search begins.")  # fmt: skip
@click.option("--kick", default="1e-3", show_default=True, help="Speed of the table from which a "
              "simulation starts.")  # fmt: skip
@click.option("--settle", default="60s", show_default=True, help="How long it may settle.")
@click.option("--branch", type=SETTING, metavar="PARAMETER=STOP",
              help="Follow the cycle as this number changes, through folds.")  # fmt: skip
@click.option("--points", type=Whole(3, 1000), default=30, show_default=True,
              help="Orbits of a branch, at most.")  # fmt: skip
@click.option("--plot", type=PICTURE, help="Draw it into a picture.")
@analysis
@click.pass_context
def command(
    ctx: click.Context,
    machine: str,
    settings: tuple[str, ...],
    guess: str,
    kick: str,
    settle: str,
    branch: str | None,
    points: int,
    plot: Path | None,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Find the limit cycle of a machine whose command stands still.

    Prints what the describing function foretells (without tension) beside the exact orbit, found
    by shooting, with its Floquet multipliers. With --PARAMETER VALUES (start:stop:count or a,b,c;
    one or several) the orbits over a grid: --controller.K_v 2:10:9 --controller.T_ten 0:30:7.
    """
    m = load(machine, settings)
    start = {
        "kick": parse(kick, m.unit_of("omega_m", "rad/s"), key="--kick"),
        "settle": parse(settle, "s", key="--settle"),
    }
    if ctx.obj and branch:
        raise ValueError("--branch: follows one orbit; leave the grid's axes out")
    if ctx.obj:
        _map(m, ctx.obj, start, plot, json_to)
    elif branch:
        _branch(m, branch, guess, start, points, plot, json_to)
    else:
        _one(m, guess, start, plot, json_to)


def _one(
    m: Machine, guess: str, start: dict[str, float], plot: Path | None, json_to: str | None
) -> None:
    predicted, why_not = _predicted(m)
    orbit = cycles.shooting(m, guess, **start)
    if plot:
        from dualdrive import plots

        with write_atomically(plot) as temporary:
            plots.cycle(orbit, predicted).savefig(temporary)
    write_json(
        json_to, {"orbit": orbit.figures(), "predicted": [one.figures() for one in predicted]}
    )
    if json_to == "-":
        return
    angle = m.unit_of("theta_m", "rad")
    table = Table("", "frequency", "peak to peak", "", box=None, pad_edge=False)
    largest = abs(orbit.multipliers[0])
    kind = "attracts" if orbit.stable else "repels"
    table.add_row("orbit", human(orbit.frequency_hz, "Hz", digits=6),
                  human(orbit.peak_to_peak, angle, digits=5),
                  f"{kind}, largest multiplier {largest:.4f}; closes within {orbit.residual:.0e}; "
                  f"{len(orbit.switches)} switches")  # fmt: skip
    for one in predicted:
        trust = "" if one.trusted else ", too little to rely on"
        words = "; ".join(filter(None, (f"N/K {one.n_over_k:.3f}{trust}", one.note)))
        table.add_row("describing function", human(one.frequency_hz, "Hz", digits=6),
                      human(2 * one.amplitude, angle, digits=5), words)  # fmt: skip
    console().print(table)
    if why_not:
        click.echo(f"describing function: {why_not}")
    if plot:
        click.echo(f"written: {plot}")


def _predicted(m: Machine) -> tuple[list[cycles.Predicted], str]:
    """What the describing function has, or why it has nothing."""
    try:
        found = cycles.describing_function(m)
    except cycles.CycleError as error:
        return [], str(error)
    return found, "" if found else "predicts no cycle"


def _branch(
    m: Machine,
    text: str,
    guess: str,
    start: dict[str, float],
    points: int,
    plot: Path | None,
    json_to: str | None,
) -> None:
    path, sign, end = text.partition("=")
    if not sign:
        raise ValueError(f"--branch {text}: is not PARAMETER=STOP, e.g. controller.T_ten=20")
    unit = m.parameter(path).unit
    stop = parse(end, unit, key=f"--branch {path}")
    orbit = cycles.shooting(m, guess, **start)
    with Progress(console=console(err=True), transient=True) as bar:
        task = bar.add_task("orbits", total=points)
        found = cycles.branch(
            orbit, path, stop, points=points,
            progress=lambda done, _: bar.update(task, completed=done),
        )  # fmt: skip
    if plot:
        from dualdrive import plots

        with write_atomically(plot) as temporary:
            plots.cycle_branch(found, unit=unit).savefig(temporary)
    write_json(json_to, found.figures())
    if json_to == "-":
        return
    angle = m.unit_of("theta_m", "rad")
    table = Table(path, "frequency", "peak to peak", "", box=None, pad_edge=False)
    for value, one in zip(found.values.tolist(), found.orbits, strict=True):
        kind = "attracts" if one.stable else "repels"
        table.add_row(human(value, unit), human(one.frequency_hz, "Hz", digits=5),
                      human(one.peak_to_peak, angle), kind)  # fmt: skip
    console().print(table)
    for fold in found.folds:
        click.echo(f"fold at {path} = {human(fold, unit)}: beyond it this cycle does not exist")
    click.echo(f"ends: {found.ended}")
    if plot:
        click.echo(f"written: {plot}")


def _map(
    m: Machine,
    axes: dict[str, str],
    start: dict[str, float],
    plot: Path | None,
    json_to: str | None,
) -> None:
    grid = sweeps.lay_out(m, axes)
    if plot and len(grid.axes) > 2:
        raise ValueError(f"--plot: a map of {len(grid.axes)} axes can't be drawn; give two at most")
    with Progress(console=console(err=True), transient=True) as bar:
        task = bar.add_task("grid points", total=grid.size)
        found = cycles.survey(
            m, {axis.path: axis.values for axis in grid.axes}, **start,
            progress=lambda done, _: bar.update(task, completed=done),
        )  # fmt: skip
    if plot:
        from dualdrive import plots

        with write_atomically(plot) as temporary:
            plots.cycle_map(found, [axis.unit for axis in grid.axes]).savefig(temporary)
    write_json(json_to, found.figures())
    if json_to != "-":
        console().print(_points(m, grid.axes, found))
        if plot:
            click.echo(f"written: {plot}")


def _points(m: Machine, axes: Any, found: cycles.Survey) -> Table:
    """One row per point of the grid; failures without the machine's name before them."""
    table = Table(*(axis.path for axis in axes), "frequency", "peak to peak", "", box=None,
                  pad_edge=False)  # fmt: skip
    angle = m.unit_of("theta_m", "rad")
    for index in sorted({*found.orbits, *found.reasons}):
        at = [human(float(a.values[k]), a.unit) for a, k in zip(axes, index, strict=True)]
        if orbit := found.orbits.get(index):
            table.add_row(*at, human(orbit.frequency_hz, "Hz", digits=6),
                          human(orbit.peak_to_peak, angle, digits=5),
                          "attracts" if orbit.stable else "repels")  # fmt: skip
        else:
            reason = found.reasons[index].removeprefix(f"{m.name}: ")
            table.add_row(*at, "", "", reason.partition(";")[0])
    return table
