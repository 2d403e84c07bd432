"""Figures into a page of the documentation: each benchmark owns what lies between its markers."""

from __future__ import annotations

import argparse
from pathlib import Path

import report
from surroundings import ROOT

PAGE = ROOT / "docs" / "performance.md"


def command_line(doc: str) -> argparse.ArgumentParser:
    """That of a benchmark which can write into the page."""
    parser = report.command_line(doc)
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.name}")
    return parser


def told(parser: argparse.ArgumentParser, *parts: str) -> argparse.Namespace:
    """What was asked for; an error where a part of a table would go into the page for all of it.

    parts: options that choose some of the rows
    """
    given = parser.parse_args()
    chosen = [f"--{name}" for name in parts if getattr(given, name) != parser.get_default(name)]
    if given.write and chosen:
        parser.error(f"--write puts whole tables into {PAGE.name}: leave out {', '.join(chosen)}")
    return given


def between(text: str, name: str, content: str) -> str:
    """The text with other content between the markers of that name; raises ValueError if none."""
    begin, end = (f"<!-- {name}: {where} -->" for where in ("begin", "end"))
    if text.count(begin) != 1 or text.count(end) != 1 or text.index(begin) > text.index(end):
        raise ValueError(f"{begin} ... {end}: wanted once, in this order")
    before, rest = text.split(begin)
    after = rest.split(end)[1]
    return f"{before}{begin}\n\n{content.strip()}\n\n{end}{after}"


def write(name: str, content: str, page: Path = PAGE) -> None:
    page.write_text(between(page.read_text("utf-8"), name, content), "utf-8")
