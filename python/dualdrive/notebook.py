"""How results look in a notebook: the sentence, the tables and one picture, as in the report.

The HTML is that of :mod:`dualdrive.report`; a notebook adds its own style.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from dualdrive.report.markup import Html, join, percent, table, tag

if TYPE_CHECKING:
    import xarray as xr

    from dualdrive.compare import Comparison
    from dualdrive.diagnose import Diagnosis, Ladder
    from dualdrive.paper.exhibit import Exhibit

__all__ = ["comparison_dataset", "diagnosis", "exhibit", "fit", "ladder", "pictured", "tabled"]


def diagnosis(d: Diagnosis) -> str:
    """The finding, the paragraph, the errors, the candidates and how probable each is."""
    from dualdrive.diagnose import headline
    from dualdrive.report import evidence, remedies
    from dualdrive.report.pictures import Gallery

    hung = Gallery()
    parts = [
        tag("p", tag("b", headline(d))),
        tag("p", d.paragraph),
        *(tag("p", f"warning: {line}") for line in d.warnings),
        evidence.errors(d),
        _folded("What could explain it", remedies.candidates(d, hung)),
        _folded("What is missing", evidence.shapes(d, hung)),
        _folded("What to measure next", remedies.experiment(d, hung)),
        _folded("Numbers that moved", remedies.moved(d)),
    ]
    return tag("div", join(parts))


def ladder(found: Ladder) -> str:
    """How the error fell, as a picture and a table, and why it stopped."""
    from dualdrive.report import remedies
    from dualdrive.report.pictures import Gallery

    drawn = remedies.ladder(found, Gallery())
    return tag("div", drawn if drawn is not None else tag("p", found.stopped))


def fit(found: Any) -> str:
    """A fit: numbers with their intervals, and the errors before and after."""
    rows = [
        (
            path,
            f"{p.value:.6g}",
            f"{p.low:.5g} … {p.high:.5g}",
            p.unit,
            f"{p.nominal:.6g}",
            p.verdict,
        )
        for path, p in found.parameters.items()
    ]
    head = ("parameter", "value", "interval", "unit", "nominal", "")
    caption = f"Fitted numbers, {percent(found.confidence, '.0f')} intervals"
    errors = found.error if isinstance(found.error, Mapping) else {"refitted": found.error}
    words = ", ".join(f"{name} {percent(value)}" for name, value in errors.items())
    return tag("div", tag("p", f"Error: {words}"), table(head, rows, caption, numbers=(1, 4)))


def pictured(found: Any, picture: str) -> str:
    """A result by the picture that :mod:`dualdrive.plots` has of it, its table beneath.

    Args:
        found: the result; its ``table()`` is plain text, where it has one.
        picture: the name of the function that draws it.

    """
    from dualdrive import plots
    from dualdrive.report.pictures import Gallery

    kind = type(found).__name__
    drawn = Gallery().hang(getattr(plots, picture)(found), kind, f"{kind}, as it is plotted")
    return tag("div", drawn, tag("pre", found.table()) if hasattr(found, "table") else None)


def tabled(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A result as one table, numbers to the right of what they are of."""
    return tag("div", table(head, rows, caption, numbers=range(1, len(head))))


def exhibit(e: Exhibit) -> str:
    """A figure or table of the paper: what it shows, its numbers, what a reader must know."""

    def cell(value: float | str | bool | None) -> str:
        return "–" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)

    sheets = [
        table(s.columns, [[cell(c) for c in row] for row in s.rows], s.title or e.title)
        for s in e.sheets()
    ]
    notes = [tag("p", note) for note in e.notes]
    return tag("div", tag("p", tag("b", e.title)), tag("p", e.about), *sheets, *notes)


def comparison_dataset(c: Comparison, record: str | None = None) -> xr.Dataset:
    """Measured and simulated quantities of one record over time, labelled.

    Args:
        c: the comparison.
        record: which; the first unless given.

    Returns:
        Dataset over ``t`` (s) and ``what`` (measured, model, residual); every variable has
        ``units`` and ``long_name``.

    Raises:
        KeyError: the record was not compared, or its quantities have other times.

    """
    import numpy as np
    import xarray as xr

    record = c.records[0] if record is None else record
    own = [q for q in c.quantities if q.record == record]
    if not own or any(not np.array_equal(q.t, own[0].t) for q in own):
        raise KeyError(
            f"{record}: not compared over common times; there are {', '.join(c.records)}"
        )
    variables = {
        q.name: (
            ("what", "t"),
            np.stack([q.measured, q.simulated, q.residual]),
            {"units": q.unit, "long_name": q.long_name},
        )
        for q in own
    }
    coordinates = {
        "t": ("t", own[0].t, {"units": "s", "long_name": "time"}),
        "what": ["measured", "model", "residual"],
    }
    return xr.Dataset(variables, coordinates, {"machine": c.machine, "record": record})


def _folded(title: str, content: Html | None) -> Html | None:
    return None if content is None else tag("details", tag("summary", title), content)
