"""Attempts from the command line: every option and argument of every verb with hostile values."""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import click

from .attempt import Attempt
from .commands import Line, lines, replaced

#: what nobody should be able to hang, crash or confuse the tool with
VALUES: Final = (
    "",
    " ",
    "-1",
    "0",
    "1_0",
    "٣",
    "1e400",
    "-1e308",
    "1e-308",
    "9" * 400,
    "9" * 5000,
    "a" * 3000,
    "kg^9^9^9^9",
    "1 kg^9^9^9^9",
    "1e9 1/s",
    "0:1:1000000000000",
    "0:1:" + "9" * 30,
    "1,2,,3",
    "a=b=c",
    "=",
    "table.J=",
    "table.J=1e308",
    "table.J=1e-12",
    "table.J=9^9^9^9 kg",
    "=1",
    "x:y:z",
    ":::",
    "../../../etc/passwd",
    "/dev/null",
    "/dev/full",
    "/proc/self/mem",
    ".",
    "/",
    "n" * 300,
    "record.csv/none",
    "\udcff\udcfe",
    "💥",
    "%s%n%x",
    "{0.__class__}",
    "[/red]",
    "$(id)",
    "-o",
    "--help",
    "line\nbreak",
    "move:1,v=0,a=0",
    "sine:1e308,f=1e308",
    "step:,at=",
)
NO_NUMBERS: Final = ("nan", "NaN", "-nan", "+nan")
NUMBERS: Final = (
    click.FloatRange,
    click.IntRange,
    click.types.FloatParamType,
    click.types.IntParamType,
)
#: options whose honest value may take minutes, or talks to a network
LEFT_OUT: Final = {"budget", "scheduler", "tables", "jobs", "starts", "most"}


def _options(line: Line) -> Iterator[click.Option]:
    for option in line.parameters:
        if isinstance(option, click.Option) and not option.is_flag:
            yield option


def _is_output(option: click.Parameter) -> bool:
    name = str(option.name)
    return (
        name.startswith(("output", "plot", "json", "page", "table", "pictures"))
        or "-o" in option.opts
    )


def options(chance: random.Random) -> Iterator[Attempt]:
    """Each option with hostile values."""
    for line in lines():
        for option in _options(line):
            if option.name in LEFT_OUT or option.name == "output":
                continue
            for value in chance.sample(VALUES, 3):
                yield _command(replaced(line, option.opts[0], value))


def numbers(chance: random.Random) -> Iterator[Attempt]:
    """Each option that takes a number, with what is none."""
    for line in lines():
        for option in _options(line):
            if isinstance(option.type, NUMBERS):
                for value in chance.sample(NO_NUMBERS, 2):
                    arguments = replaced(line, option.opts[0], value)
                    yield Attempt(_shown(arguments), arguments, allowed=(2,))


def arguments(chance: random.Random) -> Iterator[Attempt]:
    """Each argument with hostile values."""
    for line in lines():
        named = [p for p in line.parameters if isinstance(p, click.Argument)]
        for place, _ in enumerate(named):
            for value in chance.sample(VALUES, 5):
                rest = list(line.rest)
                rest[place : place + 1] = [value]
                yield _command([*line.verb.split(), *rest])


def outputs(_: random.Random) -> Iterator[Attempt]:
    """Each option that names an output, on files that are read, with and without --overwrite."""
    for line in lines():
        inputs = [
            word
            for word in line.rest
            if Path(word).suffix in (".toml", ".csv") and "new" not in word
        ]
        flags = [[]] + [["--overwrite"] for p in line.parameters if "--overwrite" in p.opts]
        for option in filter(_is_output, _options(line)):
            for name in inputs or ["record.csv"]:
                for more in flags:
                    if name in line.rest or not more:
                        yield _command([*replaced(line, option.opts[0], name), *more])


def places(_: random.Random) -> Iterator[Attempt]:
    """Outputs and inputs at links in circles, folders, devices, names too long."""

    def links() -> None:
        Path("circle").symlink_to("circle")
        Path("circle.png").symlink_to("circle.png")
        Path("nowhere.csv").symlink_to("folder/that/is/not")
        Path("folder").mkdir()

    for place in ("circle", "folder", "/dev/full", "none/x.toml", "n" * 300, "x\udcff.toml", "."):
        for verb in (["add", "bench", "coulomb@table", "-o"], ["simulate", "bench", "--end", "0.05", "-o"],
                     ["simulate", "bench", "--end", "0.05", "--json"]):  # fmt: skip
            for more in ([], ["--overwrite"]):
                yield Attempt(_shown([*verb, place, *more]), [*verb, place, *more], prepare=links)
    for name in (
        "circle",
        "circle.png",
        "nowhere.csv",
        "folder",
        "/dev/null",
        "/proc/self/mem",
        "n" * 300,
    ):
        for verb in (["compare", "machine.toml"], ["play"], ["machine", "show"],
                     ["compare", "machine.toml", "record.csv", "--map"]):  # fmt: skip
            yield Attempt(_shown([*verb, name]), [*verb, name], prepare=links)


def memory(chance: random.Random) -> Iterator[Attempt]:
    """Every verb with little more memory than what the process has mapped when it begins."""
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    for line in lines():
        for _ in range(5):
            spare = int(2 ** chance.uniform(19, 28))  # 0.5 to 256 MB
            arguments = [*line.verb.split(), *line.rest]
            what = f"{_shown(arguments)} with {spare / 1e6:.1f} MB to spare"
            yield Attempt(what, arguments, memory=mapped + spare)


def interrupts(chance: random.Random) -> Iterator[Attempt]:
    """Ctrl-C at random moments of every verb that writes a file."""
    for line in lines():
        if "-o" in line.rest or line.verb in ("simulate", "compare"):
            for _ in range(4):
                arguments = [*line.verb.split(), *line.rest]
                after = chance.uniform(0.0, 1.5)
                what = f"{_shown(arguments)} with Ctrl-C after {after:.2f} s"
                yield Attempt(what, arguments, interrupt=after, allowed=(0, 1, 2, 130))


def interrupts_early(chance: random.Random) -> Iterator[Attempt]:
    """Ctrl-C while modules load, from the first line of the project on."""
    for _ in range(60):
        after = 0.8 * chance.random() ** 2
        arguments = ["simulate", "bench", "--end", "5"]
        what = f"{_shown(arguments)}, started anew, with Ctrl-C after {after:.2f} s"
        yield Attempt(what, arguments, interrupt=after, allowed=(0, 130), cold=True)


def _command(arguments: list[str]) -> Attempt:
    return Attempt(_shown(arguments), arguments)


def _shown(arguments: list[str]) -> str:
    return " ".join(a if len(a) < 40 else f"{a[:20]!r}...({len(a)})" for a in arguments)
