"""dualdrive demo: the whole story on a shipped trace with a hidden effect."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dualdrive.demo import sheet, shipped, tell
from dualdrive.files import write_atomically
from dualdrive.interrupt import interrupt
from dualdrive_cli._diagnosis import budget_option, end, save, save_page, show, show_ladder, told
from dualdrive_cli._files import WritesInto
from dualdrive_cli._shared import (
    FAILED,
    STOPPED,
    console,
    give_up,
    json_option,
    overwrite_option,
    verb,
    write_json,
)

if TYPE_CHECKING:
    from dualdrive.diagnose import Ladder

MACHINE, REPORT = "improved.toml", "report.html"
PICTURES = ("ladder", "refitted", "improved", "where_it_fails")


def _kept(no_pictures: bool) -> list[str]:
    return [MACHINE] if no_pictures else [MACHINE, REPORT, *(f"{p}.png" for p in PICTURES)]


@click.command(epilog="Example: dualdrive demo -o demo --json demo/figures.json")
@click.option(
    "-o",
    "--output",
    type=WritesInto(lambda given: _kept(given["no_pictures"])),
    default="dualdrive-demo",
    show_default=True,
    help="Folder for pictures, report and the improved machine file.",
)
@click.option("--no-pictures", is_flag=True, help="Tables only.")
@budget_option
@json_option
@overwrite_option
@verb
def command(
    output: Path, no_pictures: bool, budget: float, json_to: str | None, overwrite: bool
) -> None:
    """Compare a machine with its trace, find the missing effect, add it, watch the error fall.

    A heavy table was recorded; its data sheet is a few per cent off and one effect is missing. The
    record was made by a program of its own, so nothing here knows the answer. It is what
    `dualdrive improve` and `dualdrive report` do with any machine and trace.
    """
    screen, began = console(), time.monotonic()
    with console(err=True).status("starting") as status, interrupt() as stop:
        found = tell(told(status), budget=budget)
        if not found.steps:
            give_up(f"the demo: {found.stopped}", STOPPED if stop.is_set() else FAILED)
        if not no_pictures:
            status.update("drawing")
            _draw(found, output)
            with shipped() as (_, *files):
                save_page(output / REPORT, found.diagnoses[0], found, sheet(), files)
    save(found.machine, output / MACHINE, "improved", known=sheet(), overwrite=overwrite)
    write_json(json_to, found.figures())
    if json_to != "-":
        show(found.diagnoses[0])
        show_ladder(found)
        kept = ", ".join(_kept(no_pictures))
        screen.print(f"\nIn {output}/: {kept}   ({time.monotonic() - began:.0f} s)")
    end(stop, *found.diagnoses)


def _draw(found: Ladder, folder: Path) -> None:
    from dualdrive.compare import compare
    from dualdrive.demo import records
    from dualdrive.plots import ladder, measured_vs_model, residuals

    _, held_out = records()
    before = compare(found.diagnoses[0].refitted, held_out)
    figures = {
        "ladder": ladder(found.steps, noise_floor=found.steps[-1].noise_floor),
        "refitted": measured_vs_model(before),
        "improved": measured_vs_model(compare(found.machine, held_out)),
        "where_it_fails": residuals(before),
    }
    for name in PICTURES:
        with write_atomically(folder / f"{name}.png") as temporary:
            figures[name].savefig(temporary)
