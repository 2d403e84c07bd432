"""How a trace looks at a prompt and in a notebook."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .trace import Trace

__all__ = ["as_html", "as_text"]


def _headline(trace: Trace) -> str:
    pieces = [f"{len(trace)} samples", f"{trace.duration:.6g} s", f"step {1e3 * trace.step:.4g} ms"]
    if trace.breaks:
        pieces.append(f"{len(trace.breaks) + 1} segments")
    if trace.log.troubles:
        pieces.append(f"{len(trace.log.troubles)} issues in .log")
    return ", ".join(pieces)


def _rows(trace: Trace) -> list[tuple[str, str, str, str, str]]:
    ordered = [*trace.canonical, *trace.extra]
    return [
        (
            name,
            trace.units[name],
            f"{np.min(trace[name]):.4g}",
            f"{np.max(trace[name]):.4g}",
            trace.long_names[name],
        )
        for name in ordered
    ]


_HEAD = ("channel", "unit", "min", "max", "")


def as_text(trace: Trace) -> str:
    """Name, size, and one line per channel with unit and range."""
    table = [_HEAD, *_rows(trace)]
    widths = [max(len(row[k]) for row in table) for k in range(4)]
    lines = [
        f"  {row[0]:<{widths[0]}}  {row[1]:<{widths[1]}}  {row[2]:>{widths[2]}}"
        f"  {row[3]:>{widths[3]}}  {row[4]}".rstrip()
        for row in table
    ]
    return "\n".join([f"<Trace {trace.name}: {_headline(trace)}>", *lines])


def as_html(trace: Trace) -> str:
    """The same as a table, with the log folded away below it."""

    def row(cells: tuple[str, ...], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

    body = "".join(row(cells, "td") for cells in _rows(trace))
    issues = "".join(f"<li>{html.escape(str(issue))}</li>" for issue in trace.log)
    log = f"<details><summary>{len(trace.log)} notes</summary><ul>{issues}</ul></details>"
    return (
        f"<p><b>{html.escape(trace.name)}</b>: {_headline(trace)}</p>"
        f"<table><thead>{row(_HEAD, 'th')}</thead><tbody>{body}</tbody></table>"
        f"{log if trace.log.issues else ''}"
    )
