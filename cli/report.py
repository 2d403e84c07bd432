"""dualdrive report: a diagnosis as one self-contained HTML page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from dualdrive import diagnose
from dualdrive.identify import FitError
from dualdrive.interrupt import interrupt
from dualdrive_cli._diagnosis import (
    budget_option,
    confronting,
    end,
    how,
    refuse_no_step,
    save_page,
    told,
)
from dualdrive_cli._files import MACHINE, OUTPUT, TRACE
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
    epilog="Example: dualdrive report machine.toml fit.csv --held-out held_out.csv -o report.html",
)
@click.argument("machine", type=MACHINE)
@traces_argument
@click.option("--held-out", type=TRACE, multiple=True, help="A trace to test on.")
@click.option("--no-ladder", is_flag=True, help="Diagnose only: add nothing, diagnose not again.")
@map_option
@part_option
@set_option
@confronting
@budget_option
@click.option(
    "-o", "--output", type=OUTPUT, default="report.html", show_default=True, help="The page."
)
@json_option
@overwrite_option
@verb
def command(
    machine: str,
    traces: tuple[Path, ...],
    held_out: tuple[Path, ...],
    no_ladder: bool,
    mapping: Path | None,
    wanted: tuple[str, ...],
    settings: tuple[str, ...],
    set_for: tuple[str, ...],
    budget: float,
    output: Path,
    json_to: str | None,
    overwrite: bool,
    **replay: Any,
) -> None:
    """Diagnose a machine against measured traces and write it all into one HTML page.

    Measured and simulated before and after, where it fails, what is missing and what could explain
    it, the ladder of errors, the next experiment, and all it takes to make the page again. The
    page opens without a network and prints well. Without --held-out every stretch of the traces is
    predicted from the others. Ctrl-C ends the search; the page tells what is known so far, and the
    exit code is 130.
    """
    m = load(machine, settings)
    recorded, unseen = read_apart(traces, held_out, mapping, wanted)
    own = settings_for(m, set_for, [*recorded, *unseen])
    options = how(m, {**recorded, **unseen}, **replay)
    given: dict[str, Any] = {"settings": own, "budget": budget, **options}
    steps = None
    with console(err=True).status("diagnosing") as status, interrupt() as stop:
        given["progress"] = told(status)
        try:
            if no_ladder:
                found = diagnose.diagnose(m, recorded, **given)
            else:
                steps = diagnose.improve(m, recorded, unseen or None, **given)
                found = steps.diagnoses[0]
        except FitError as error:
            give_up(f"{m.name}: {error}", STOPPED if stop.is_set() else FAILED)
    with console(err=True).status("drawing"):
        save_page(output, found, steps, m, [*traces, *held_out])
    climbed = steps if steps is not None and steps.steps else None
    write_json(json_to, (climbed or found).figures())
    if json_to != "-":
        best = f": {found.best.label}" if found.best else ""
        click.echo(f"{found.verdict}{best}")
        click.echo(f"written: {output}")
    if steps is not None:
        refuse_no_step(steps, m, stop)
    end(stop, *(steps.diagnoses if steps else [found]))
