"""Figures as inline SVG: text stays text, colours follow the page, names do not clash."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Final

from dualdrive.plots import style
from dualdrive.report.markup import Html, tag
from dualdrive.web.live import Live

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from dualdrive.web.live import Series

__all__ = ["Gallery"]

#: colours of the pictures -> what the page calls them, so that a dark page has light lines
_ROLES: Final = {
    style.PAPER: "paper",
    style.MEASURED: "ink",
    "#000000": "ink",
    "#444444": "soft",
    style.COMMAND: "soft",
    style.LIMIT: "faint",
    "#D9DCDE": "grid",
    style.BAND: "band",
    "#EDEFF0": "band",
    style.NOISE: "noise",
    style.FIRST: "first",
    style.SECOND: "second",
    style.TABLE: "third",
}
#: all as wide as the font that the layout was made with
_FONTS: Final = "'DejaVu Sans', Verdana, 'Bitstream Vera Sans', sans-serif"
_STYLE: Final = {
    "svg.fonttype": "none",
    "svg.hashsalt": "dualdrive",
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
}


class Gallery:
    """The pictures of one page, numbered as they are hung."""

    def __init__(self) -> None:
        self.count, self.live = 0, Live()

    def numbers(self, first: int) -> str:
        """What the pictures from `first` to the last that was hung are called."""
        one = f"Figure {first}"
        return one if first >= self.count else f"Figures {first} to {self.count}"

    def hang(self, figure: Figure, caption: str, alt: str, moving: Sequence[Series] = ()) -> Html:
        """A figure with its caption, and the words for those who don't see it.

        moving: quantities that a browser draws in its place, to be zoomed into
        """
        self.count += 1
        drawn = _svg(figure, f"p{self.count}", alt)
        words = tag("figcaption", tag("b", f"Figure {self.count}. "), caption)
        return tag("figure", drawn, words, data_live=self.live.add(moving))


def _svg(figure: Figure, prefix: str, alt: str) -> Html:
    """The picture as an element that scales with the page."""
    from matplotlib import rc_context

    held = io.StringIO()
    with rc_context(_STYLE):  # type: ignore[arg-type]
        figure.savefig(held, format="svg", metadata={"Date": None, "Creator": None})
    text = held.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'(\bid="|url\(#|xlink:href="#)', rf"\1{prefix}-", text)
    text = re.sub(r"font: ([^;\"]*?)'DejaVu Sans'[^;\"]*", rf"font: \1{_FONTS}", text)
    text = re.sub(r"#[0-9A-Fa-f]{6}\b", _role, text)
    size = re.search(r'width="([\d.]+)pt" height="[\d.]+pt"', text)
    assert size is not None  # as matplotlib writes it
    width = f"{float(size[1]) / 72:.2f}in"
    named = tag("title", alt)
    label = f'role="img" style="width: {width}" aria-labelledby="{prefix}-title"'
    text = text.replace(size[0], label, 1)
    head = text.index(">") + 1
    named = Html(named.replace("<title>", f'<title id="{prefix}-title">', 1))
    return Html(text[:head] + named + text[head:])


def _role(colour: re.Match[str]) -> str:
    known = {name.upper(): role for name, role in _ROLES.items()}
    role = known.get(colour[0].upper())
    return f"var(--{role}, {colour[0]})" if role else colour[0]
