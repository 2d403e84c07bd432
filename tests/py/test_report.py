"""The report: one file, escaped, accessible, and a browser shows it without asking anybody."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from diagnosed import NASTY, diagnosis, ladder
from dualdrive.report import Provenance, Source, page
from recorded import DEMO

SECTIONS = (
    "error", "ladder", "records", "where", "missing", "candidates", "next", "numbers", "origin",
)  # fmt: skip
VOID = {"meta", "br", "path", "use"}


@cache
def written() -> str:
    d = diagnosis()
    sources = [DEMO / "fit.csv"]
    found = Provenance.of(
        d.refitted, sources, improved=d.improved, commands=("dualdrive report x",)
    )
    return page(d, ladder=ladder(), provenance=found)


class Outline(HTMLParser):
    """What stands in a page: elements with their attributes, text, and whether all are closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


def test_every_element_is_closed_and_every_name_is_its_own() -> None:
    outline = Outline(written())
    assert outline.open == []
    names = [a["id"] for _, a in outline.elements if "id" in a]
    assert len(names) == len(set(names))
    for _, attributes in outline.elements:
        for key in ("href", "xlink:href"):
            target = attributes.get(key)
            assert target is None or target.removeprefix("#") in names


def test_sections_stand_in_order_and_the_contents_lead_to_them() -> None:
    outline = Outline(written())
    assert [a["id"] for a in outline.of("h2")] == list(SECTIONS)
    assert [a["href"] for a in outline.of("a")] == [f"#{name}" for name in SECTIONS]


def test_nothing_is_fetched_and_nothing_runs() -> None:
    text, outline = written(), Outline(written())
    assert not {"script", "link", "img", "iframe", "object"} & {n for n, _ in outline.elements}
    assert "@import" not in text
    addresses = set(re.findall(r"https?://[^\s\"'<]+", text))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert not [u for u in re.findall(r"url\(([^)]*)\)", text) if not u.startswith("#")]


def test_text_from_outside_is_text() -> None:
    assert "<script" not in written()
    words = " ".join(Outline(written()).words)
    assert NASTY in words
    page_of = page(replace(diagnosis(), machine=NASTY, warnings=[NASTY], records=(NASTY,)))
    assert "<script" not in page_of
    assert Outline(page_of).open == []


def test_pictures_have_words_and_tables_have_scopes() -> None:
    outline = Outline(written())
    pictures = [a for a in outline.of("svg") if a.get("role") == "img"]
    assert len(pictures) == len(outline.of("figure")) == len(outline.of("figcaption")) >= 8
    titles = {a["id"] for a in outline.of("title") if "id" in a}
    assert {a["aria-labelledby"] for a in pictures} == titles
    assert all(a.get("scope") in ("col", "row") for a in outline.of("th"))
    assert len(outline.of("caption")) == len(outline.of("table")) >= 5
    assert outline.of("html")[0]["lang"] == "en"
    assert len(outline.of("h1")) == len(outline.of("main")) == 1


def test_figures_are_those_of_the_diagnosis() -> None:
    words = " ".join(Outline(written()).words)
    for shown in (
        "41%",
        "3.3%",
        "2.01 kN·m (1.95 kN·m … 2.07 kN·m)",
        "0.610",
        "controller.T_ten = 0",
        "93%",
    ):
        assert shown in words, shown
    assert "coulomb@table or stribeck@table" in words
    assert "nothing is left that these records could show" in words


def test_provenance_names_the_file_by_its_hash() -> None:
    """As sha256sum has it."""
    told = subprocess.run(
        ["sha256sum", DEMO / "fit.csv"], capture_output=True, text=True, check=True
    ).stdout.split()[0]
    assert Source.of(DEMO / "fit.csv").sha256 == told
    words = " ".join(Outline(written()).words)
    assert told in words
    assert 'effect = "coulomb"' in words  # the improved machine file
    assert "dualdrive report x" in words


def test_what_is_not_known_is_left_out() -> None:
    bare = replace(
        diagnosis(), verdict="adequate", candidates=[], groups=[], equation=None, where=[],
        shapes=[], next_experiment=None, moved={}, after=None, warnings=[], cut=[],
        error={"nominal": 0.03, "noise_floor": np.nan},
    )  # fmt: skip
    outline = Outline(page(bare))
    assert [a["id"] for a in outline.of("h2")] == ["error", "records", "origin"]
    assert "–" in outline.words  # × a floor that nobody knows


def test_both_colour_schemes_and_paper_are_provided_for() -> None:
    text = written()
    for rule in ("prefers-color-scheme: dark", "@media print", "color-scheme: light dark"):
        assert rule in text
    # the lines of pictures follow the page: what is left are shades that read on both
    drawn = "".join(re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL))
    fixed = set(re.findall(r"(?<!, )#[0-9a-fA-F]{6}\b", drawn))
    assert not fixed & {"#000000", "#ffffff", "#1a1a1a"}


# --- in a browser ---------------------------------------------------------------------------------


def browser() -> str:
    names = ("chromium", "chromium-browser", "chromium-headless-shell", "google-chrome")
    for name in names:
        if path := shutil.which(name):
            return path
    pytest.skip(f"no headless browser here: none of {', '.join(names)}")


def shown(file: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [
        browser(), "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
        f"--user-data-dir={file.parent / 'profile'}", "--virtual-time-budget=2000",
        "--enable-logging=stderr", *options, file.as_uri(),
    ]  # fmt: skip
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)


def test_a_browser_shows_it_in_peace(tmp_path: Path) -> None:
    """Every section and picture is in the document, nothing on the console, nothing asked for."""
    file, log = tmp_path / "report.html", tmp_path / "net.json"
    file.write_text(written(), "utf-8")
    done = shown(file, "--dump-dom", f"--log-net-log={log}", "--net-log-capture-mode=Everything")
    outline = Outline(done.stdout)
    assert [a["id"] for a in outline.of("h2")] == list(SECTIONS)
    assert len(outline.of("figure")) == len(Outline(written()).of("figure"))
    assert "CONSOLE" not in done.stderr
    asked = re.findall(r'"url":"((?:https?|wss?|ftp)[^"]*)"', log.read_text())
    assert asked == []


@pytest.mark.parametrize("width", [420, 1100])
def test_it_is_drawn_and_nothing_sticks_out(tmp_path: Path, width: int) -> None:
    from PIL import Image

    file, picture = tmp_path / "report.html", tmp_path / "shot.png"
    file.write_text(written(), "utf-8")
    shown(file, f"--screenshot={picture}", f"--window-size={width},4000")
    pixels = np.asarray(Image.open(picture).convert("RGB"))
    assert pixels.shape[1] == width
    paper = pixels[2, 2]
    inked = np.any(pixels != paper, axis=2)
    assert 0.02 < inked.mean() < 0.6
    assert not inked[:, :6].any()
    assert not inked[:, -6:].any()
