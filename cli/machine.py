"""dualdrive machine: list, show and write machine files."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import click
from rich.console import Group
from rich.table import Table

from dualdrive import describe
from dualdrive.files import claim
from dualdrive.machine import DEFAULT, Machine, presets
from dualdrive_cli._files import MACHINE, OUTPUT
from dualdrive_cli._shared import (
    command_line,
    console,
    json_option,
    load,
    machine_argument,
    overwrite_option,
    set_option,
    verb,
    write_json,
)


@click.group(epilog="Example: dualdrive machine show heavy-table-100t")
def command() -> None:
    """List, show and write machines. A MACHINE is a file or a preset's name."""


@command.command("list", epilog="Example: dualdrive machine list --json -")
@json_option
@overwrite_option
@verb
def list_(json_to: str | None, overwrite: bool) -> None:
    """Show the machines that come with dualdrive."""
    machines = [Machine.load(name) for name in presets()]
    keys = ("name", "title", "axis", "drive_train")
    write_json(json_to, [{key: getattr(m, key) for key in keys} for m in machines])
    if json_to == "-":
        return
    table = Table("name", "title", "axis", "drive train", box=None)
    for m in machines:
        name = f"{m.name} (default)" if m.name == DEFAULT else m.name
        table.add_row(name, m.title, m.axis, m.drive_train)
    console().print(table)


@command.command(epilog="Example: dualdrive machine show bench --set meshes.gap=2mrad")
@machine_argument
@set_option
@click.option("--toml", is_flag=True, help="Print the machine file instead.")
@json_option
@overwrite_option
@verb
def show(
    machine: str, settings: tuple[str, ...], toml: bool, json_to: str | None, overwrite: bool
) -> None:
    """Show every number of a machine with its unit, meaning and bounds."""
    m = load(machine, settings)
    write_json(json_to, describe.machine(m))
    if toml:
        click.echo(m.toml(), nl=False)
    elif json_to != "-":
        console().print(_page(m))


def _page(m: Machine) -> Group:
    head = Table.grid(padding=(0, 2))
    head.add_row("machine", f"{m.name}: {m.title}")
    head.add_row("axis", f"{m.axis}, {m.drive_train}")
    kinds = (f"{part} {m.core.kind(part)}" for part in (*m.core.connections, *m.core.motors))
    head.add_row("parts", ", ".join(kinds))
    choices = (f"{key} {value}" for key, value in m.core.controller_options.items())
    head.add_row("controller", ", ".join(choices))
    head.add_row("effects", ", ".join(m.effects) or "none")
    for entry in m.history:
        told = (value for key, value in entry.items() if key != "undo")
        head.add_row("history", "  ".join(told))
    numbers = Table("parameter", "value", "SI", "bounds", "meaning", box=None)
    for p in describe.tied(m):
        si = f"{p.value:.10g} {p.unit}".rstrip()
        numbers.add_row(p.path, describe.reading(p), si, describe.bounds(p), describe.meaning(m, p))
    return Group(head, "", numbers)


@command.command(
    epilog="Example: dualdrive machine new --preset bench --set table.J=0.3 -o rig.toml"
)
@click.option(
    "--preset",
    type=MACHINE,
    default=DEFAULT,
    show_default=True,
    metavar="NAME|FILE",
    help="What to begin with: a preset or a machine file.",
)
@click.option("--name", help="Name of the new machine; else the file's.")
@set_option
@click.option("-o", "--output", type=OUTPUT, required=True, help="The machine file to write.")
@json_option
@overwrite_option
@verb
def new(
    preset: str,
    name: str | None,
    settings: tuple[str, ...],
    output: Path,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Write a machine file that stands on its own, to be edited."""
    m = load(preset, settings)
    m.name = name or output.stem
    m.note(f"made from {preset}" + "".join(f", {text}" for text in settings), command_line())
    m.save(output, overwrite=overwrite)
    change = m.history[-1]["change"]
    write_json(json_to, {"machine": m.name, "file": str(output), "change": change})
    if json_to != "-":
        click.echo(f"{output}: {m.title}")


@command.command(epilog="Example: dualdrive machine history rig.toml")
@click.argument("machine", type=MACHINE)
@json_option
@overwrite_option
@verb
def history(machine: str, json_to: str | None, overwrite: bool) -> None:
    """Show what was changed in a machine file, when and by which command, oldest first."""
    m = load(machine)
    write_json(json_to, list(m.history))
    if json_to == "-":
        return
    if not m.history:
        click.echo(f"{m.name}: no history")
        return
    table = Table("step", "date", "change", "command", "", box=None)
    for number, entry in enumerate(m.history, 1):
        way_back = "" if "undo" in entry else "can't be undone"
        cells = (entry.get(key, "") for key in ("date", "change", "command"))
        table.add_row(str(number), *cells, way_back)
    console().print(table)


@command.command(epilog="Example: dualdrive machine undo rig.toml -o rig-before.toml")
@click.argument("machine", type=MACHINE)
@click.option("-o", "--output", type=OUTPUT, help="Write here; else the file itself is replaced.")
@json_option
@overwrite_option
@verb
def undo(machine: str, output: Path | None, json_to: str | None, overwrite: bool) -> None:
    """Take back the last change of a machine file: numbers, effects and choices as they were."""
    path = Path(machine)
    with nullcontext() if output else claim(path):
        m = Machine.load(path)
        change = m.undo()
        m.save(output or path, overwrite=overwrite or output is None)
    write_json(json_to, {"machine": m.name, "file": str(output or path), "undone": change})
    if json_to != "-":
        click.echo(f"{output or path}: without {change!r}")
