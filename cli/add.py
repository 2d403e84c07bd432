"""dualdrive add: one physical effect into a machine file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from dualdrive_cli._files import MACHINE, OUTPUT
from dualdrive_cli._shared import (
    command_line,
    json_option,
    load,
    overwrite_option,
    pairs,
    set_option,
    verb,
    write_json,
)


@click.command(
    epilog="Example: dualdrive add heavy-table-100t coulomb@motors --set torque=2N*m -o rig.toml",
)
@click.argument("machine", type=MACHINE)
@click.argument("effect", metavar="EFFECT[@PLACE]")
@set_option
@click.option("--formula", help="Of the effect 'expression': a torque over named signals.")
@click.option(
    "--curve",
    "curves",
    multiple=True,
    metavar="NAME=LOW:HIGH:KNOTS",
    help="Of the effect 'spline': a coordinate, its range, its knots; ':periodic' behind; twice "
    "for a surface. All values are 0.",
)
@click.option("-o", "--output", type=OUTPUT, required=True, help="The new machine file.")
@json_option
@overwrite_option
@verb
def command(
    machine: str,
    effect: str,
    settings: tuple[str, ...],
    formula: str | None,
    curves: tuple[str, ...],
    output: Path,
    json_to: str | None,
    overwrite: bool,
) -> None:
    """Write a new machine file that has one more effect, and says so in its history.

    --set takes the effect's own parameters (torque=300) or any path of the machine. Without a
    place the effect goes where it usually sits. See `dualdrive effects`.
    """
    m = load(machine)
    own, others = _sorted(settings)
    for path, value in others:
        m.set(path, value)
    if formula is not None:
        own = {"formula": formula, "parameters": own}
    label = m.add(effect, **own, **_axes(curves))
    m.note(f"added {label}", command_line())
    m.save(output, overwrite=overwrite)
    added = [p for p in m.parameters() if p.path.startswith(f"{label}.")]
    numbers = {p.path: {"value": p.value, "unit": p.unit} for p in added}
    written = {"machine": m.name, "file": str(output), "effect": label, "parameters": numbers}
    write_json(json_to, written)
    if json_to != "-":
        click.echo(f"{output}: {m.name} with {label}")


def _axes(curves: tuple[str, ...]) -> dict[str, list[Any]]:
    """The axes of a spline: ``speed=-0.05:0.05:9``, ``angle=0:2 pi:36:periodic``."""
    axes: dict[str, list[Any]] = {}
    for curve in curves:
        name, equals, rest = curve.partition("=")
        low, high, knots, *periodic = [*rest.split(":"), "", ""][: max(3, rest.count(":") + 1)]
        if not (equals and re.fullmatch("[0-9]{1,18}", knots) and periodic in ([], ["periodic"])):
            raise ValueError(
                f"--curve {curve}: write NAME=LOW:HIGH:KNOTS, or with :periodic behind"
            )
        values = {"coordinate": name, "low": low, "high": high, "knots": int(knots)}
        for key, value in (values | {"periodic": bool(periodic)}).items():
            axes.setdefault(key, []).append(value)
    return axes


def _sorted(settings: tuple[str, ...]) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """The effect's own parameters, and those of the machine, which have a dot."""
    given = pairs(settings)
    return {k: v for k, v in given if "." not in k}, [(k, v) for k, v in given if "." in k]
