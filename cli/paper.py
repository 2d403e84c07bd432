"""dualdrive paper: the source paper's figures and tables, computed anew beside what it prints."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.table import Table as Grid
from rich.text import Text

from dualdrive.files import write_atomically
from dualdrive.paper import EXHIBITS, Exhibit, Table, page, reproduce, shown
from dualdrive_cli._files import OUTPUT, WritesInto
from dualdrive_cli._numbers import Whole
from dualdrive_cli._shared import console, json_option, overwrite_option, verb, write_json


def _named(exhibits: Sequence[str]) -> list[str]:
    return [name for name in EXHIBITS if name in exhibits or not exhibits or "all" in exhibits]


def _pictures(given: Mapping[str, Any]) -> list[str]:
    return [f"{name}.{given['kind']}" for name in _named(given["exhibits"])]


@click.command(epilog="Example: dualdrive paper fig3 fig5 -o pictures")
@click.argument("exhibits", nargs=-1, type=click.Choice(["all", *EXHIBITS]), metavar="[EXHIBIT]...")
@click.option(
    "-o",
    "--output",
    type=WritesInto(_pictures),
    metavar="DIR",
    help="Draw each into this folder, as NAME.png.",
)
@click.option(
    "--format",
    "kind",
    type=click.Choice(["png", "svg", "pdf"]),
    default="png",
    show_default=True,
    help="Of the pictures.",
)
@click.option(
    "--page", "page_to", type=OUTPUT, metavar="FILE", help="Write everything as Markdown; needs -o."
)
@click.option("--jobs", type=Whole(1), help="Threads; default: all cores.")
@json_option
@overwrite_option
@verb
def command(
    exhibits: tuple[str, ...],
    output: Path | None,
    kind: str,
    page_to: Path | None,
    jobs: int | None,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Reproduce figures and tables of the paper, each beside the printed one.

    EXHIBIT is fig1, fig2, fig3, fig4, fig5, fig6, table1, table2, or all, the default. Each says
    what the paper leaves open and was chosen here, what deviates and why, and which of the paper's
    sentences hold.
    """
    names = _named(exhibits)
    pictures = {name: output / f"{name}.{kind}" for name in names} if output else {}
    if page_to and output is None:
        raise click.UsageError("--page shows pictures: say with -o where they go")
    begin = time.perf_counter()
    found = []
    for name in names:
        found.append(_one(name, pictures.get(name), jobs or os.cpu_count() or 1))
        if json_to != "-":
            _show(found[-1])
    seconds = time.perf_counter() - begin
    if page_to:
        _write_page(page_to, found, pictures)
    content = {"exhibits": [exhibit.to_dict() for exhibit in found], "seconds": seconds}
    write_json(json_to, content)
    if json_to != "-":
        for path in [*pictures.values(), *filter(None, [page_to])]:
            click.echo(f"written: {path}")
        click.echo(f"{seconds:.1f} s")


def _one(name: str, picture: Path | None, jobs: int) -> Exhibit:
    """Compute an exhibit and draw it."""
    with console(err=True).status(f"computing {name}"):
        exhibit = reproduce(name, jobs=jobs)
        if picture:
            from dualdrive.plots.paper import draw

            with write_atomically(picture) as temporary:
                draw(exhibit).savefig(temporary)
    return exhibit


def _show(exhibit: Exhibit) -> None:
    screen = console()
    screen.print(Text.assemble((exhibit.title, "bold"), f"  {exhibit.seconds:.1f} s"))
    screen.print(exhibit.about)
    for line in exhibit.chosen:
        screen.print(f"  chosen: {line}")
    for sheet in exhibit.sheets():
        if sheet.title:
            screen.print(f"\n{sheet.title}")
        screen.print(_grid(sheet))
    for line in exhibit.notes:
        screen.print(f"  {line}")
    screen.print()


def _grid(sheet: Table) -> Grid:
    grid = Grid(*sheet.columns, box=None)
    for row in sheet.rows:
        grid.add_row(*map(shown, row))
    return grid


def _write_page(path: Path, exhibits: list[Exhibit], pictures: dict[str, Path]) -> None:
    """The page, its pictures linked from where it lies."""
    links = {
        name: Path(os.path.relpath(picture, path.parent)).as_posix()
        for name, picture in pictures.items()
    }
    folder = Path(os.path.relpath(next(iter(pictures.values())).parent)).as_posix()
    names = " ".join(e.name for e in exhibits) if len(exhibits) < len(EXHIBITS) else "all"
    line = f"dualdrive paper {names} -o {folder} --page {path.as_posix()}"
    with write_atomically(path) as temporary:
        temporary.write_text(page(exhibits, links, line), "utf-8")
