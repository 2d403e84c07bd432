"""dualdrive map: a proposal how to read a recording whose columns have names of their own."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click
from rich.table import Table

from dualdrive.files import write_atomically
from dualdrive.traces import ColumnGuess, Proposal, propose, write_mapping
from dualdrive_cli._files import OUTPUT, PICTURE, TRACE
from dualdrive_cli._shared import (
    console,
    json_option,
    overwrite_option,
    verb,
    write_json,
)


@click.command(
    "map",
    epilog="Example: dualdrive map scope.csv -o scope.map.toml --plot scope.png",
)
@click.argument("file", type=TRACE)
@click.option("-o", "--output", type=OUTPUT, metavar="MAP.toml", help="Write the mapping here.")
@click.option("--plot", type=PICTURE, help="Draw every channel as it is read.")
@click.option(
    "--drives",
    metavar="N[,N]",
    help="Numbers in the columns' names that are drive 1 (and 2): 3 takes axis 3 of a robot.",
)
@json_option
@overwrite_option
@verb
def command(
    file: Path,
    output: Path | None,
    plot: Path | None,
    drives: str | None,
    json_to: str | None,
    **_: Any,
) -> None:
    """Propose which column of FILE is which channel, in which unit, and why.

    Reads words of the header, units, and values: angles must be the integrals of their speeds.
    Columns that get no channel are named. Check every line, signs above all; the mapping written
    has the reasons as comments and is read by every verb that takes traces (`--map`, or by itself
    beside the recording as NAME.map.toml).
    """
    proposal = propose(file, _numbers(drives))
    write_json(json_to, _figures(proposal))
    if output is not None:
        write_mapping(proposal.mapping, output)
    if plot is not None:
        from dualdrive import plots

        with write_atomically(plot) as temporary:
            plots.mapping(proposal).savefig(temporary)
    if json_to == "-":
        return
    _show(proposal)
    for written in filter(None, (plot, output)):
        click.echo(f"written: {written}")
    if output is None:
        click.echo(f"nothing written; -o {file.with_suffix('.map.toml')} puts it beside the file")


def _numbers(text: str | None) -> tuple[int, ...] | None:
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    if not (1 <= len(parts) <= 2 and all(part.isdecimal() for part in parts)):
        raise click.BadParameter(f"--drives {text}: write one number or two, e.g. 3 or 1,2")
    return tuple(int(part) for part in parts)


def _show(proposal: Proposal) -> None:
    table = Table("column", "channel", "unit", "lowest", "highest", "why", box=None)
    ordered = [g for g in proposal.columns if g.channel] + list(proposal.unmapped)
    for guess in ordered:
        cells = (guess.column, guess.channel or "-", guess.unit or "-", _number(guess.low),
                 _number(guess.high), guess.reason)  # fmt: skip
        table.add_row(*cells)
    screen = console()
    screen.print(table)
    for note in proposal.notes:
        screen.print(f"note: {note}")
    mapped = len(ordered) - len(proposal.unmapped)
    click.echo(f"{mapped} of {len(ordered)} columns mapped; check units, and signs above all")


def _number(value: float) -> str:
    return f"{value:.5g}" if math.isfinite(value) else "-"


def _figures(proposal: Proposal) -> dict[str, Any]:
    return {
        "file": proposal.path.name,
        "mapping": proposal.mapping.as_dict(),
        "columns": [_plain(guess) for guess in proposal.columns],
        "notes": list(proposal.notes),
    }


def _plain(guess: ColumnGuess) -> dict[str, Any]:
    finite = math.isfinite(guess.low)
    return {
        "column": guess.column,
        "channel": guess.channel or None,
        "unit": guess.unit,
        "low": guess.low if finite else None,
        "high": guess.high if finite else None,
        "reason": guess.reason,
    }
