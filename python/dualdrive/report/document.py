"""The page: a sentence that a hurried reader sees first, what it rests on, and the sections."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

from dualdrive.diagnose.one_sentence import headline
from dualdrive.diagnose.result import Diagnosis
from dualdrive.report import evidence, origin, remedies
from dualdrive.report.markup import Html, held, join, tag
from dualdrive.report.pictures import Gallery
from dualdrive.web import modules

if TYPE_CHECKING:
    from collections.abc import Callable

    from dualdrive.diagnose.ladder import Ladder
    from dualdrive.report.provenance import Provenance

__all__ = ["page"]

_NAME = 32  # characters of a name in the title


def page(
    diagnosis: Diagnosis, *, ladder: Ladder | None = None, provenance: Provenance | None = None
) -> str:
    """The report as the text of one HTML file.

    Args:
        diagnosis: what was found.
        ladder: how the error fell, of :func:`dualdrive.diagnose.improve`.
        provenance: what it was made from.

    """
    hung = Gallery()
    title, records = _title(diagnosis), f"Records: {', '.join(diagnosis.records)}."
    listed = tag("p", records, class_="fine") if len(diagnosis.records) > 1 else None
    sections = [
        _section(name, heading, content)
        for name, heading, make in _plan(diagnosis, ladder, provenance, hung)
        if (content := make())
    ]
    scripts = hung.live.scripts
    contents = [tag("li", tag("a", h, href=f"#{n}")) for n, h, _ in sections]
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", f"{title} – dualdrive"),
        tag("meta", http_equiv="Content-Security-Policy", content=hung.live.policy),
        tag("style", Html(_styles(moving=bool(scripts)))),
    )
    body = tag(
        "body",
        tag(
            "header",
            tag("p", title, class_="kicker"),
            tag("h1", held(headline(diagnosis))),
            listed,
            _verdict(diagnosis),
        ),
        tag("nav", tag("ul", *contents), aria_label="Sections"),
        tag("main", *(section for _, _, section in sections)),
        *(tag("script", Html(text), type=kind) for kind, text in scripts),
    )
    return f"<!DOCTYPE html>\n{tag('html', head, body, lang='en')}\n"


def _styles(*, moving: bool) -> str:
    own = files("dualdrive.report").joinpath("style.css").read_text("utf-8")
    return f"{modules.read('vendor/uPlot.min.css').decode()}\n{own}" if moving else own


def _plan(
    d: Diagnosis, ladder: Ladder | None, provenance: Provenance | None, hung: Gallery
) -> list[tuple[str, str, Callable[[], Html | None]]]:
    """Every section in its order; one with nothing to say returns None and is left out."""
    return [
        ("error", "How large the error is", lambda: evidence.errors(d)),
        ("ladder", "How the error fell", lambda: remedies.ladder(ladder, hung)),
        ("records", "Measured and simulated", lambda: evidence.overlays(d, hung)),
        ("where", "Where it fails", lambda: evidence.where(d, hung)),
        ("missing", "What is missing", lambda: evidence.shapes(d, hung)),
        ("candidates", "What could explain it", lambda: remedies.candidates(d, hung)),
        ("next", "What to measure next", lambda: remedies.experiment(d, hung)),
        ("numbers", "Numbers that moved", lambda: remedies.moved(d)),
        ("origin", "How this was made", lambda: origin.origin(d, provenance)),
    ]


def _title(d: Diagnosis) -> str:
    """One line, however many records there are and however long their names."""
    first = _short(d.records[0]) if d.records else "no record"
    others = len(d.records) - 1
    more = f" and {others} more record{'s' if others > 1 else ''}" if others > 0 else ""
    return f"{_short(d.machine)} against {first}{more}"


def _short(name: str) -> str:
    return name if len(name) <= _NAME else f"{name[: _NAME - 1]}…"


def _section(name: str, heading: str, content: Html) -> tuple[str, str, Html]:
    own = tag("section", tag("h2", heading, id=name), content, aria_labelledby=name)
    return name, heading, own


def _verdict(d: Diagnosis) -> Html:
    cut = [f"Left undone: {line}" for line in d.cut]
    return tag(
        "div",
        tag("p", tag("strong", f"{d.verdict}{_named(d)}"), class_="named"),
        tag("p", held(d.paragraph)) if d.paragraph else None,
        join(tag("p", _sentence(line), class_="warning", role="note") for line in d.warnings),
        join(tag("p", _sentence(line), class_="fine") for line in cut),
        class_=f"verdict {d.verdict}",
    )


def _named(d: Diagnosis) -> str:
    """The best explanation, or the group that the record can't part."""
    if d.best is None:
        return ""
    alike = next((group for group in d.groups if d.best.label in group), (d.best.label,))
    others = [label for label in alike if label != d.best.label]
    return f": {' or '.join([d.best.label, *others])}"


def _sentence(line: str) -> str:
    return f"{line[:1].upper()}{line[1:]}{'' if line.endswith(('.', '!', '?')) else '.'}"
