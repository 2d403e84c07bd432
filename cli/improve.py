"""dualdrive improve: diagnose, add, refit, again, until nothing nameable is left."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from dualdrive import diagnose
from dualdrive.diagnose import Ladder
from dualdrive.diagnose.improvement import MOST
from dualdrive.files import write_atomically
from dualdrive.identify import FitError
from dualdrive.interrupt import interrupt
from dualdrive_cli._diagnosis import (
    budget_option,
    confronting,
    end,
    how,
    refuse_no_step,
    save,
    show_ladder,
    told,
)
from dualdrive_cli._files import MACHINE, OUTPUT, PICTURE, TRACE
from dualdrive_cli._numbers import Whole
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
    read_apart,
    settings_for,
    traces_argument,
)


@click.command(
    epilog="Example: dualdrive improve machine.toml fit.csv --held-out held_out.csv "
    "-o improved.toml",
)
@click.argument("machine", type=MACHINE)
@traces_argument
@click.option("--held-out", type=TRACE, multiple=True, help="A trace to test on.")
@click.option("--ambiguous", is_flag=True, help="Add the leader of a group that stays unparted.")
@click.option("--most", type=Whole(0), default=MOST, show_default=True, help="Effects.")
@map_option
@part_option
@set_option
@confronting
@budget_option
@click.option("-o", "--output", type=OUTPUT, help="The improved machine file.")
@click.option("--plot", type=PICTURE, help="Draw the ladder (png, pdf, svg).")
@json_option
@overwrite_option
@verb
def command(
    machine: str,
    traces: tuple[Path, ...],
    held_out: tuple[Path, ...],
    ambiguous: bool,
    most: int,
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
    """Diagnose, add the missing effect, refit, and again, until nothing nameable is left.

    Prints the ladder: the error of every step beside the noise floor, on the records fitted and on
    those held out; without --held-out every stretch is predicted from the others. Every step stands
    in the machine file's history and can be taken back. Ctrl-C ends with the steps so far and exit
    code 130.
    """
    m = load(machine, settings)
    recorded, unseen = read_apart(traces, held_out, mapping, wanted)
    own = settings_for(m, set_for, [*recorded, *unseen])
    options = how(m, {**recorded, **unseen}, **replay)
    with console(err=True).status("improving") as status, interrupt() as stop:
        try:
            found = diagnose.improve(
                m,
                recorded,
                unseen or None,
                settings=own,
                budget=budget,
                ambiguous=ambiguous,
                most=most,
                progress=told(status),
                **options,
            )
        except FitError as error:
            give_up(f"{m.name}: {error}", STOPPED if stop.is_set() else FAILED)
    refuse_no_step(found, m, stop)
    if plot:
        _draw(found, plot)
    if output:
        change = found.diagnoses[-1].fitted_to
        save(found.machine, output, change, known=m, overwrite=overwrite)
    write_json(json_to, found.figures())
    if json_to != "-":
        show_ladder(found)
        for path in filter(None, (output, plot)):
            click.echo(f"written: {path}")
    end(stop, *found.diagnoses)


def _draw(found: Ladder, path: Path) -> None:
    from dualdrive.plots import ladder

    with write_atomically(path) as temporary:
        ladder(found.steps, noise_floor=found.steps[-1].noise_floor).savefig(temporary)
