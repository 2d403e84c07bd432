"""HTML from nested calls; whatever is text is escaped, once, here."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from html import escape

__all__ = ["Html", "held", "join", "percent", "table", "tag"]

_EMPTY = ("meta", "br")
#: the space between a number and its unit
_UNIT = re.compile(r"(?<=\d) (?=%|\S+·\S|arcsec\b|[kMmµ]?(?:rad|m|s|N|A|V)\b)")


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


def tag(name: str, /, *children: str | None, **attributes: str | None) -> Html:
    """An element. Children that are not Html are escaped, None is left out.

    Attributes end in an underscore where Python has the word: ``class_``; inner underscores become
    hyphens: ``aria_label``.
    """
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in _EMPTY:
        return Html(f"<{name}{given}>")
    return Html(f"<{name}{given}>{join(children)}</{name}>")


def join(children: Iterable[str | None], between: str = "") -> Html:
    """Children one after the other, text escaped."""
    parts = (
        c if isinstance(c, Html) else escape(c, quote=False) for c in children if c is not None
    )
    return Html(between.join(parts))


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    caption: str,
    *,
    numbers: Sequence[int] = (),
    marked: int | None = None,
) -> Html:
    """A table with scopes: the first cell of a row is its heading.

    numbers: columns that are aligned to the right; marked: a row to set off
    """
    kinds = ["number" if k in numbers else None for k in range(len(head))]
    columns = (tag("th", c, scope="col", class_=k) for c, k in zip(head, kinds, strict=True))
    body = [
        tag(
            "tr",
            tag("th", row[0], scope="row"),
            *(tag("td", c, class_=k) for c, k in zip(row[1:], kinds[1:], strict=True)),
            class_="marked" if n == marked else None,
        )
        for n, row in enumerate(rows)
    ]
    whole = tag(
        "table",
        tag("caption", caption),
        tag("thead", tag("tr", *columns)),
        tag("tbody", *body),
    )
    return tag("div", whole, class_="scroll", tabindex="0", role="region", aria_label=caption)


def percent(share: float, form: str = ".3g") -> str:
    """Per cent, with three digits unless told, a dash where the number is not known."""
    return f"{100 * share:{form}}\N{NO-BREAK SPACE}%" if math.isfinite(share) else "–"


def held(text: str) -> str:
    """The same text, in which no line begins with the unit of a number."""
    return _UNIT.sub("\N{NO-BREAK SPACE}", text)
