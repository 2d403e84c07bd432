"""dualdrive workbench: compare, diagnose, add and refit as a page in the browser."""

from __future__ import annotations

import webbrowser
from pathlib import Path

import click

from dualdrive import workbench
from dualdrive_cli._failures import USAGE, give_up
from dualdrive_cli._files import JSON, ReadsMachine, ReadsTrace, WorksIn
from dualdrive_cli._numbers import Whole
from dualdrive_cli._shared import overwrite_option, verb, write_json


@click.command(epilog="Example: dualdrive workbench machine.toml fit.csv held_out.csv")
@click.argument("machine", type=ReadsMachine(), required=False)
@click.argument("traces", nargs=-1, type=ReadsTrace(), metavar="[TRACE]...")
@click.option(
    "--project",
    type=WorksIn(),
    default=Path("dualdrive-workbench"),
    show_default=True,
    help="Folder that keeps everything: recordings, models, results, undo.",
)
@click.option("--port", type=Whole(0, 65535), default=0, help="Of this computer; a free one.")
@click.option("--no-browser", is_flag=True, help="Only print the address.")
@click.option(
    "--json",
    "json_to",
    type=JSON,
    metavar="FILE|-",
    help="Write the address and the project's folder as JSON; - for standard output.",
)
@overwrite_option
@verb
def command(
    machine: str | None,
    traces: tuple[Path, ...],
    project: Path,
    port: int,
    no_browser: bool,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Compare, diagnose, add and refit on a page in the browser, served to this computer only.

    Drop recordings and a machine file on it, or begin with the demo. Everything stays in the
    project folder, so that a reload, a second tab and a restart find it again. Who has the address
    may use the page: it carries a token. Ctrl-C ends it; a computation under way goes on, and the
    next start finds its result.
    """

    def ready(address: str) -> None:
        told = {"address": address, "project": str(project.absolute())}
        write_json(json_to, told)
        if json_to != "-":
            click.echo(f"the workbench is at {address}\nits project is in {told['project']}")
            click.echo("Ctrl-C ends it")
        if not no_browser:
            webbrowser.open(address)

    try:
        workbench.serve(project, machine, traces, port=port, ready=ready)
    except ModuleNotFoundError as error:
        if error.name not in ("starlette", "uvicorn", "websockets"):
            raise
        give_up(f"{error.name} is missing: pip install 'dualdrive[workbench]'", USAGE)
