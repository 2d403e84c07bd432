"""dualdrive indexing: positioning tests after ISO 230-2, simulated and measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from rich.table import Table

from dualdrive import indexing
from dualdrive.ensembles.runs import cores
from dualdrive.files import write_atomically
from dualdrive.indexing import IndexingError, Iso230, LostMotion, Verdict
from dualdrive.machine import Machine, presets
from dualdrive.traces import read_parts
from dualdrive.units import conversion, parse, parse_values
from dualdrive_cli._files import PICTURE, Reads
from dualdrive_cli._numbers import Whole
from dualdrive_cli._shared import analysis, console, engine_option, load, write_json
from dualdrive_cli._traces import map_option

#: SI unit -> how targets and deviations are printed
_SHOWN = {"rad": ("deg", "arcsec"), "m": ("mm", "um"), "": ("", "")}


@click.command(
    epilog="Example: dualdrive indexing heavy-table-550t --repeats 5 -o chart.png",
)
@click.option(
    "--targets", help="start:stop:count or a,b,c with units; eight round the circle unless given."
)
@click.option("--travel", help="Over which the axis is tested; else from first to last target.")
@click.option("--repeats", type=Whole(1), help="Approaches from each side.  [default: 5]")
@click.option("--dwell", help="Stay at every target; of a trace, the shortest that is one.")
@click.option("--window", help="End of the dwell over which the position is averaged.")
@click.option("--still", help="By how much the table may move meanwhile: 1 arcsec, 1 µm.")
@click.option("--speed", help="Limit of the moves; like the next two, the default motion's.")
@click.option("--acceleration", help="Limit of the moves.")
@click.option("--jerk", help="Limit of the moves.")
@click.option("--overrun", help="How far beyond the outer targets it turns back.")
@click.option("--unit", default="", help="Of a measured file whose header names none: deg, mm.")
@map_option
@click.option("--pulls", type=Reads(), help="Lost motion of a log, laid out as this says.")
@click.option(
    "--tables", is_flag=True, help="Tables 1 and 2 of the source paper, crossed; takes minutes."
)
@engine_option
@click.option("-o", "--output", type=PICTURE, help="Draw the chart (png, pdf, svg).")
@analysis
def command(
    machine: str,
    settings: tuple[str, ...],
    pulls: Path | None,
    tables: bool,
    output: Path | None,
    json_to: str | None,
    overwrite: bool,
    **test: Any,
) -> None:
    """Test how a machine positions: A, R, E, M and B after ISO 230-2 (GB/T 17421.2).

    MACHINE is a preset or machine file, which is driven to its targets from both sides; or a
    measured file: targets and positions as CSV (one row per approach, or one per target), a trace
    with theta_m and dwells, or the data file of an ecmc acceptance report.

    Ends with 2, and gives no number, where a table hunts or has not settled, where a trace has no
    reversals, or where counts differ between targets.
    """
    if tables:
        return _tables(json_to)
    if pulls:
        return _lost_motion(Path(machine), pulls, json_to)
    result, said = _tested(machine, settings, test)
    if output:
        _draw(result, output)
    write_json(json_to, {**result.to_dict(), "notes": said})
    if json_to != "-":
        _report(result, said, output)
    return None


# --- what is tested -------------------------------------------------------------------------------


def _tested(
    source: str, settings: tuple[str, ...], test: dict[str, Any]
) -> tuple[Iso230, list[str]]:
    """The evaluated test, and what is to be said beside its figures."""
    path = Path(source)
    if source in presets() or path.suffix == ".toml" or not path.is_file():
        result = _simulated(load(source, settings), test)
    elif settings:
        raise click.BadParameter("--set changes a machine; a measured file has none")
    elif indexing.is_report(path):
        report = indexing.read_report(path)
        return report.result, [*report.result.notes, *report.words()]
    else:
        result = _measured(path, test)
    return result, list(result.notes)


def _simulated(machine: Machine, test: dict[str, Any]) -> Iso230:
    if test["unit"]:
        raise ValueError(f"--unit {test['unit']}: of a measured file; a machine has its own")
    angle = machine.unit_of("e", "rad")
    given = {
        name: _number(test[option], unit, option)
        for name, option, unit in (
            ("dwell", "dwell", "s"),
            ("window", "window", "s"),
            ("still", "still", angle),
            ("overrun", "overrun", angle),
            ("v", "speed", f"{angle}/s"),
            ("a", "acceleration", f"{angle}/s^2"),
            ("j", "jerk", f"{angle}/s^3"),
        )
    }
    cycle = indexing.cycle_for(machine, _targets(test, angle), repeats=test["repeats"], **given)
    travel = _number(test["travel"], angle, "travel")
    with console(err=True).status("simulating"):
        return indexing.measure(machine, cycle, travel=travel, engine=test["engine"])


def _measured(path: Path, test: dict[str, Any]) -> Iso230:
    unit = "m" if _is_length(test["unit"]) else "rad"
    travel = _number(test["travel"], unit, "travel")
    if indexing.is_position_table(path):
        return indexing.read_positions(path, unit=test["unit"], travel=travel)
    parts = read_parts(path, test["mapping"])
    if len(parts) > 1:
        raise IndexingError(f"{path}: its mapping splits it into {len(parts)}; test one at a time")
    dwell = _number(test["dwell"], "s", "dwell")
    return indexing.evaluate_trace(
        parts[0],
        _targets(test, unit),
        unit=unit,
        travel=travel,
        window=_number(test["window"], "s", "window"),
        still=_number(test["still"], unit, "still"),
        **({} if dwell is None else {"dwell": dwell}),
    )


def _is_length(unit: str) -> bool:
    try:
        conversion(unit, "m")
    except ValueError:
        return False
    return True


def _number(text: str | None, unit: str, option: str) -> float | None:
    return None if text is None else parse(text, unit, key=f"--{option}")


def _targets(test: dict[str, Any], unit: str) -> Any:
    text = test["targets"]
    return None if text is None else parse_values(text, unit, key="--targets")


# --- what is shown --------------------------------------------------------------------------------


def _draw(result: Iso230, path: Path) -> None:
    from dualdrive import plots

    with write_atomically(path) as temporary:
        plots.indexing(result).savefig(temporary)


def _report(result: Iso230, said: list[str], written: Path | None) -> None:
    """One row per target, the figures, and what is to be said about them."""
    along, across = _SHOWN[result.unit]
    rows = Table(box=None, pad_edge=False)
    titles = ("mean up", "mean down", "B", "s up", "s down", "R")
    rows.add_column(_headed("target", along), justify="right")
    for title in titles:
        rows.add_column(_headed(title, across), justify="right")
    for row in result.rows:
        shown = (row.mean_up, row.mean_down, row.B, row.s_up, row.s_down, row.R)
        place = row.target / conversion(along, result.unit).scale
        rows.add_row(f"{place:.6g}", *(_shown(value, result.unit) for value in shown))
    figures = Table(
        "figure", "", _headed("of both", across), "up", "down", box=None, pad_edge=False
    )
    given = result.figures()
    for name in ("A", "R", "E", "M", "B"):
        sides = [given.get(key) for key in (name, f"{name}_up", f"{name}_down")]
        meaning = indexing.FIGURES[name].removeprefix("bidirectional ")
        figures.add_row(name, meaning, *(_shown(value, result.unit) for value in sides))
    head = f"{result.name}: {result.targets.size} targets, {result.repeats} approaches per side"
    console().print(head, rows, "", figures, sep="\n")
    for line in said:
        click.echo(f"note: {line}")
    if written:
        click.echo(f"written: {written}")


def _headed(title: str, unit: str) -> str:
    """A column's title with its unit."""
    return f"{title} [{unit.replace('um', 'µm')}]" if unit else title


def _shown(value: float | None, unit: str) -> str:
    """A deviation in the unit it is printed in; a dash where there is none."""
    if value is None:
        return "-"
    size = value / conversion(_SHOWN[unit][1], unit).scale
    return f"{round(size, 4) + 0.0:.4f}"  # + 0.0: no minus before zero


def _tables(json_to: str | None) -> None:
    with console(err=True).status("simulating both tables") as status:

        def progress(done: int, of: int) -> None:
            status.update(f"simulating both tables: {done} of {of}")

        result = indexing.crossed(jobs=cores(), progress=progress)
    found = list(indexing.verdicts(result))
    cells = indexing.rows(result)
    content = {"draws": result.draws, "cells": cells, "verdicts": [v.to_dict() for v in found]}
    write_json(json_to, content)
    if json_to == "-":
        return
    for name in indexing.LOADS:
        console().print(_paper(name, [v for v in found if v.cell.load == name]), "")
    for name in indexing.PAIR:
        own = [cell for cell in cells if cell["column"] == name]
        of = result.draws * len(own)
        unread, moved = (sum(cell[key] for cell in own) for key in ("unread", "moved"))
        click.echo(
            f"{name}: of {of} tests {unread} had a target without reading, {moved} one that was "
            "read while the table moved by more than 1 arcsec"
        )
    click.echo(f"median (least to most) of {result.draws} draws; all cells with --json FILE")


def _paper(weight: str, found: list[Verdict]) -> Table:
    """The cells of one load at once the presets' gap and grade 5."""
    table = Table(title=f"{weight}, arc seconds", box=None, pad_edge=False, title_justify="left")
    for name in ("encoder", "reading", "figure", "printed", *indexing.PAIR, "better", "contrast"):
        table.add_column(name)
    for v in found:
        if (v.cell.gap, v.cell.grade) != (1.0, 5.0):
            continue
        printed = " / ".join(f"{indexing.PRINTED[weight, c][v.figure]:g}" for c in indexing.PAIR)
        gain = "-" if v.gain is None else f"{100 * v.gain:.0f} %"
        table.add_row(
            v.cell.sensor, f"{v.cell.reading:g} s", v.figure, printed, v.old.text, v.new.text,
            gain, "comes out" if v.contrast else "no",
        )  # fmt: skip
    return table


def _lost_motion(log: Path, layout: Path, json_to: str | None) -> None:
    found = indexing.read_lost_motion(log, layout)
    write_json(json_to, {"log": str(log), "shafts": [one.to_dict() for one in found]})
    if json_to != "-":
        for one in found:
            click.echo(_words(one))


def _words(one: LostMotion) -> str:
    loaded = " / ".join(f"{mean:.2f}" for mean in one.means[0])
    return (
        f"{one.name}: lost motion {one.loaded:.2f} under load (means {loaded}), "
        f"{one.released:.2f} released; {one.pulls[0]} and {one.pulls[1]} pulls"
    )
