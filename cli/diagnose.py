"""dualdrive diagnose: where a machine fails, which effect is missing, what to measure next."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from dualdrive import diagnose
from dualdrive.diagnose import Diagnosis
from dualdrive.files import write_atomically
from dualdrive.identify import FitError
from dualdrive.interrupt import interrupt
from dualdrive.machine import Machine
from dualdrive_cli._diagnosis import (
    budget_option,
    confronting,
    end,
    how,
    save,
    show,
    told,
)
from dualdrive_cli._files import MACHINE, OUTPUT, PICTURE
from dualdrive_cli._shared import (
    FAILED,
    STOPPED,
    console,
    give_up,
    json_option,
    load,
    overwrite_option,
    set_option,
    verb,
    write_json,
)
from dualdrive_cli._traces import (
    map_option,
    part_option,
    read_all,
    settings_for,
    traces_argument,
)


@click.command(
    epilog="Example: dualdrive diagnose machine.toml fit.csv -o improved.toml",
)
@click.argument("machine", type=MACHINE)
@traces_argument
@map_option
@part_option
@set_option
@confronting
@budget_option
@click.option(
    "-o", "--output", type=OUTPUT, help="The machine with the best explanation in it, fitted."
)
@click.option("--plot", type=PICTURE, help="Draw what was found on one sheet (png, pdf, svg).")
@json_option
@overwrite_option
@verb
def command(
    machine: str,
    traces: tuple[Path, ...],
    mapping: Path | None,
    wanted: tuple[str, ...],
    settings: tuple[str, ...],
    set_for: tuple[str, ...],
    budget: float,
    output: Path | None,
    plot: Path | None,
    json_to: str | None,
    overwrite: bool,
    **replay: Any,
) -> None:
    """Say where a machine fails, which effect is missing, and what to measure next.

    The numbers of the data sheet are refitted under every explanation, so that a drifted inertia
    does not pose as an effect. What the record can't tell apart is named as a group, with the
    experiment that would. Ctrl-C ends the search with what is known so far,
    and exit code 130.
    """
    m = load(machine, settings)
    recorded = read_all(traces, mapping, wanted)
    own = settings_for(m, set_for, recorded)
    options = how(m, recorded, **replay)
    with console(err=True).status("diagnosing") as status, interrupt() as stop:
        try:
            found = diagnose.diagnose(
                m,
                recorded,
                settings=own,
                budget=budget,
                progress=told(status),
                **options,
            )
        except FitError as error:
            give_up(f"{m.name}: {error}", STOPPED if stop.is_set() else FAILED)
    drawn = bool(plot and _draw(found, plot))
    change = _save(found, output, m, overwrite=overwrite) if output and found.refitted else ""
    write_json(json_to, found.figures())
    if json_to != "-":
        show(found)
        if change:
            click.echo(f"written: {output}: {change}")
        if drawn:
            click.echo(f"written: {plot}")
    end(stop, found)


def _save(found: Diagnosis, path: Path, known: Machine, *, overwrite: bool) -> str:
    """Write the improved machine, or the refitted one where nothing is named; says which."""
    if found.improved is not None and found.best is not None:
        change = f"added {found.best.label}, {found.fitted_to}"
        save(found.improved, path, change, known=known, overwrite=overwrite)
    else:
        change = found.fitted_to
        save(found.refitted, path, change, known=known, overwrite=overwrite)
    return change


def _draw(found: Diagnosis, path: Path) -> bool:
    """Draw what was found; whether there was anything."""
    from dualdrive.plots import PlotError, diagnosed

    try:
        figure = diagnosed(found)
    except PlotError as error:  # an answer without anything to draw is one all the same
        click.echo(f"{path} was not drawn: {error}", err=True)
        return False
    with write_atomically(path) as temporary:
        figure.savefig(temporary)
    return True
