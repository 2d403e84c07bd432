"""dualdrive effects: the physical effects that can be added to a machine."""

from __future__ import annotations

from typing import Any

import click
from rich.table import Table

from dualdrive import describe
from dualdrive_cli._shared import console, json_option, overwrite_option, verb, write_json


@click.command(
    epilog="Example: dualdrive effects coulomb",
)
@click.argument("name", required=False)
@json_option
@overwrite_option
@verb
def command(name: str | None, json_to: str | None, overwrite: bool) -> None:
    """Show what can be added: equation, parameters, units, source, what it is confused with.

    Without a NAME all effects are listed. Add one with `dualdrive add`.
    """
    found: Any = describe.effect(name) if name else describe.effects()
    write_json(json_to, found)
    if json_to == "-":
        return
    console().print(_all(found) if name is None else _one(found))


def _all(effects: list[dict[str, Any]]) -> Table:
    table = Table("effect", "acts on", "places", "equation", "parameters", box=None)
    for effect in effects:
        names = ", ".join(f"{p['name']} [{p['unit'] or '1'}]" for p in effect["parameters"])
        places = ", ".join(effect["places"])
        table.add_row(effect["name"], effect["acts_on"], places, effect["equation"], names)
    return table


def _one(effect: dict[str, Any]) -> Table:
    table = Table.grid(padding=(0, 2))
    for key in ("name", "equation", "acts_on", "places"):
        value = effect[key]
        text = ", ".join(value) if isinstance(value, list) else value
        table.add_row(key.replace("_", " "), text)
    for p in effect["parameters"]:
        table.add_row("parameter", f"{p['name']} [{p['unit'] or '1'}]: {p['doc']}")
        default = "no limit" if p["default"] is None else f"{p['default']:g}"
        table.add_row("", f"{_bounds(p)}, default {default}, usual size {p['typical']:g}")
    for key, meaning in effect["keys"].items():
        table.add_row("key", f"{key}: {meaning}")
    table.add_row("valid", effect["validity"])
    table.add_row("confused with", ", ".join(effect["confused_with"]) or "-")
    table.add_row("source", effect["source"])
    return table


def _bounds(p: dict[str, Any]) -> str:
    low = "any" if p["low"] is None else f"{'>' if p['low_excluded'] else '>='} {p['low']:g}"
    return low if p["high"] is None else f"{low}, <= {p['high']:g}"
