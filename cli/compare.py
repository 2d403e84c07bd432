"""dualdrive compare: a machine beside measured traces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from rich.table import Table

from dualdrive.compare import Comparison, compare
from dualdrive.files import write_atomically
from dualdrive.identify import FitError
from dualdrive_cli._files import MACHINE, OUTPUT, PICTURE
from dualdrive_cli._shared import (
    FAILED,
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
    replay_options,
    replaying,
    settings_for,
    traces_argument,
)


@click.command(
    epilog="Example: dualdrive compare machine.toml fit.csv held_out.csv --plot compare.png",
)
@click.argument("machine", type=MACHINE)
@traces_argument
@map_option
@part_option
@set_option
@replaying
@click.option("-o", "--output", type=OUTPUT, help="Write measured and simulated channels as CSV.")
@click.option(
    "--plot",
    type=PICTURE,
    help="Draw measured and simulated channels (png, pdf, svg).",
)
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
    mode: str,
    output: Path | None,
    plot: Path | None,
    json_to: str | None,
    overwrite: bool,
    **replay: Any,
) -> None:
    """Compare a machine with measured traces: errors, noise floors, where it fails.

    Nothing about the machine is fitted; what belongs to a record (constants of sensors, the initial
    state) is. Errors are RMS residual over RMS of the mean-free measured signal; the headline
    averages following error, currents or torques, and deflections.
    """
    m = load(machine, settings)
    recorded = read_all(traces, mapping, wanted)
    own = settings_for(m, set_for, recorded)
    options = replay_options(m, recorded, **replay)
    with console(err=True).status("comparing"):
        try:
            found = compare(m, recorded, mode, settings=own, **options)
        except FitError as error:
            give_up(f"{m.name}: {error}", FAILED)
    if output:
        with write_atomically(output) as temporary:
            temporary.write_text(found.to_csv(), "utf-8")
    if plot:
        _draw(found, plot)
    write_json(json_to, found.figures())
    if json_to != "-":
        _report(found, (output, plot))


def _draw(found: Comparison, path: Path) -> None:
    from dualdrive.plots import measured_vs_model

    with write_atomically(path) as temporary:
        measured_vs_model(found).savefig(temporary)


def _report(found: Comparison, written: tuple[Path | None, ...]) -> None:
    head, *rows = found.rows()
    table = Table(box=None, padding=(0, 2, 0, 0))
    for name, side in zip(head, ("left", "left", "right", "right", "right", "left"), strict=True):
        table.add_column(name, justify=side)  # type: ignore[arg-type]
    for row in rows:
        table.add_row(*row, style="bold" if row is rows[-1] else None)
    screen = console()
    screen.print(table)
    for line in found.remarks():
        screen.print(line)
    for path in filter(None, written):
        screen.print(f"written: {path}")
