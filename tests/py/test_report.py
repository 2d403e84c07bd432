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
from dualdrive.compare import compare
from dualdrive.compare.equation import Measure
from dualdrive.demo import records, sheet
from dualdrive.diagnose import headline
from dualdrive.identify import with_torques
from dualdrive.report import Provenance, Source, page
from patience import PATIENCE
from recorded import DEMO
from workbench_page import Seen, chromium, needs_chromium

SECTIONS = (
    "error", "ladder", "records", "where", "missing", "candidates", "next", "numbers", "origin",
)  # fmt: skip
#: hosts that a browser asks for updates of its own, when it likes
OWN = re.compile(r"(update|clients\d*|accounts|redirector|edgedl|optimizationguide-pa)\.")
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


def test_nothing_is_fetched_and_only_its_own_plots_run() -> None:
    text, outline = written(), Outline(written())
    assert not {"link", "img", "iframe", "object"} & {n for n, _ in outline.elements}
    kinds = [a["type"] for a in outline.of("script")]
    assert kinds == ["importmap", "application/json", "module"]
    assert not [a for a in outline.of("script") if "src" in a]
    [policy] = [a["content"] for a in outline.of("meta") if "http-equiv" in a]
    assert policy is not None
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe-inline" not in policy.partition("style-src")[0]
    assert "@import" not in text
    addresses = set(re.findall(r"https?://[^\s\"'<]+", text))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert not [u for u in re.findall(r"url\(([^)]*)\)", text) if not u.startswith("#")]


def test_text_from_outside_is_text() -> None:
    assert written().count("<script") == 3
    words = " ".join(Outline(written()).words)
    assert NASTY in words
    page_of = page(replace(diagnosis(), machine=NASTY, warnings=[NASTY], records=(NASTY,)))
    assert page_of.count("<script") == 3
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
        "41\N{NO-BREAK SPACE}%",
        "3.3\N{NO-BREAK SPACE}%",
        "2.01 kN·m [1.95 .. 2.07 kN·m]",
        "0.610",
        "controller.T_ten = 0",
        "93\N{NO-BREAK SPACE}%",
    ):
        assert shown in words, shown
    assert "coulomb@table or stribeck@table" in words
    assert "Explains: its share of the error that an arbitrary torque could remove" in words
    assert "nothing is left that these records could show" in words


@pytest.mark.long
def test_the_title_is_one_line_whatever_the_records_are_called() -> None:
    many = tuple(f"log8, a long name of test {k}, tension {k % 2}, part {k}" for k in range(23))
    for some in (many[:1], many[:2], many):
        outline = Outline(page(replace(diagnosis(), records=some, machine="m" * 90)))
        text = " ".join(outline.words)
        title = next(line for line in outline.words if line.endswith("– dualdrive"))
        assert len(title) <= 112
        assert ("and 22 more records" in title) == (len(some) == 23)
        assert all(name in text for name in some[1:])  # the whole list stands below it


def captions(text: str) -> list[tuple[int, bool]]:
    """Number of each picture in the order of the page, and whether it is folded away."""
    found, deep = [], 0
    for what, number in re.findall(r"(<details|</details)|<b>Figure (\d+)\. </b>", text):
        deep += {"<details": 1, "</details": -1, "": 0}[what]
        if number:
            found.append((int(number), deep > 0))
    return found


def test_pictures_are_numbered_as_they_are_shown() -> None:
    """A number that is skipped is told by what hides it."""
    one = diagnosis().shapes[0]
    faint = [replace(one, coordinate=name, explained=0.01) for name in ("angle", "time")]
    text = page(replace(diagnosis(), shapes=[*faint, one]), ladder=ladder())
    numbers = captions(text)
    assert [n for n, _ in numbers] == list(range(1, len(numbers) + 1))
    folded = [n for n, hidden in numbers if hidden]
    assert len(folded) == 2
    assert f"Figures {folded[0]} to {folded[1]}: coordinates that explain next to nothing" in text


def rows_of(text: str, caption: str) -> list[list[str]]:
    """Cells of the table with that caption."""
    start = text.index(f"<caption>{caption}")
    body = text[start : text.index("</table>", start)]
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", body, flags=re.DOTALL)
    return [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, flags=re.DOTALL) for row in rows]


def test_what_was_not_refitted_stands_apart_from_what_was() -> None:
    text = page(diagnosis("screened only"))
    refitted = rows_of(text, "Explanations refitted")
    assert [row[0] for row in refitted[1:]] == [
        "coulomb@table", "stribeck@table", "cogging@motors + viscous@table",
    ]  # fmt: skip
    assert not any("screened" in cell or cell == "–" for row in refitted for cell in row)
    screened = rows_of(text, "Explanations screened only")
    assert [row[0] for row in screened[1:]] == ["wear@ring"]
    words = " ".join(Outline(text).words)
    assert "Each of these was added to the machine and everything refitted." in words


def test_explanations_of_a_search_that_was_stopped_are_not_judged() -> None:
    """No bar, no probability, nothing set off; in the order of what they gain so far."""
    first, second, *rest = diagnosis().candidates
    waiting = [replace(first, resolved=False, gain=9.0), replace(second, resolved=False, gain=90.0)]
    cut = replace(diagnosis(), verdict="unfinished", candidates=[*waiting, rest[0]])
    cut = replace(cut, groups=[], improved=None, after=None)
    text = page(cut)
    words = " ".join(Outline(text).words)
    assert "none of these is judged" in words
    assert "Probability of every explanation" not in words
    assert [row[0] for row in rows_of(text, "Explanations that wait for their turn")] == [
        "explanation", "stribeck@table", "coulomb@table",
    ]  # fmt: skip
    assert [row[1] for row in rows_of(text, "Refitted until then")[1:]] == ["–"]
    assert "with the best explanation" not in words


@pytest.mark.long
@pytest.mark.parametrize(
    ("measure", "sums", "told"),
    [
        ("probability", True, "Probability of all laws that act in an equation"),
        ("torque", False, "the filter asks for a torque of 0.91 of the drives' there"),
        ("explained", False, "the numbers do not add up"),
    ],
)
def test_what_does_not_add_up_is_called_no_share(measure: Measure, sums: bool, told: str) -> None:
    found = replace(diagnosis().equation, measure=measure)  # type: ignore[type-var]
    text = page(replace(diagnosis(), equation=found))
    words = " ".join(Outline(text).words)
    assert told in words
    assert "hare of the unexplained" not in words
    for phrase in ("these do not add up", "times and squares do not add up"):
        assert phrase in words


def test_measured_and_model_stand_over_time_in_a_torque_balance_too() -> None:
    fitting = records()[0]
    machine = sheet()
    trace = with_torques(machine.core, fitting)
    grown = machine.copy()
    grown.add("coulomb", "table", torque=2000.0)
    before, after = compare(machine, trace, "balance"), compare(grown, trace, "balance")
    text = page(replace(diagnosis(), mode="balance", before=before, after=after))
    words = " ".join(Outline(text).words)
    record = before.records[0]
    assert f"{record}, numbers refitted: measured (solid) and model (dashed)." in words
    assert f"{record}, with the best explanation: measured (solid) and model (dashed)." in words


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


def test_the_first_heading_is_the_finding() -> None:
    for verdict in ("adequate", "parameters", "effect", "ambiguous", "unknown", "unfinished"):
        found = replace(diagnosis(), verdict=verdict, before=None, after=None, where=[], shapes=[])
        words = [line.replace("\N{NO-BREAK SPACE}", " ") for line in Outline(page(found)).words]
        assert headline(found) in words[:5]  # after title, styles and the name of the record


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
        "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr",
        "--disable-background-networking", *options, file.as_uri(),
    ]  # fmt: skip
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=True)


def asked_for(text: str, folder: Path) -> tuple[subprocess.CompletedProcess[str], set[str]]:
    """A browser that shows a page, and the hosts that were asked for something meanwhile."""
    file, log = folder / "page.html", folder / "net.json"
    file.write_text(text, "utf-8")
    done = shown(file, "--dump-dom", f"--log-net-log={log}", "--net-log-capture-mode=Everything")
    return done, set(re.findall(r'"url":"(?:https?|wss?|ftp)://([^/"]*)', log.read_text()))


def test_a_browser_shows_it_in_peace(tmp_path: Path) -> None:
    """Every section and picture is in the document, nothing on the console, nothing asked for."""
    for name in ("report", "empty", "image"):
        (tmp_path / name).mkdir()
    done, asked = asked_for(written(), tmp_path / "report")
    outline = Outline(done.stdout)
    assert [a["id"] for a in outline.of("h2")] == list(SECTIONS)
    drawn = [a for a in outline.of("figure") if a.get("class") != "panel"]
    assert len(drawn) == len(Outline(written()).of("figure"))
    assert [a for a in drawn if a.get("class") == "lively"]
    assert "CONSOLE" not in done.stderr
    _, for_itself = asked_for("<p>nothing", tmp_path / "empty")  # updates of the browser's own
    _, with_image = asked_for("<img src='https://a.invalid/b.png'>", tmp_path / "image")
    assert "a.invalid" in with_image, "the log would not have shown it"
    assert {host for host in asked - for_itself if not OWN.match(host)} == set()


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


@needs_chromium
def test_the_finding_stands_on_the_first_screen_and_on_paper(tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    file.write_text(written(), "utf-8")
    with chromium() as browser:
        for width, height in ((1280, 900), (390, 844)):
            seen = Seen(browser, file.as_uri(), viewport={"width": width, "height": height})
            box = seen.page.locator("h1").bounding_box()
            assert box is not None
            assert box["y"] + box["height"] < 0.5 * height
            assert "Coulomb friction or Stribeck friction at the table" in seen.text("h1")
            assert seen.faults() == []
            seen.page.emulate_media(media="print")
            assert seen.page.locator("h1").is_visible()
            assert not seen.page.locator("nav").is_visible()
            # paper can't be zoomed: every moving plot gives way to its still picture
            assert not any(plot.is_visible() for plot in seen.page.locator(".moving").all())
            assert all(p.is_visible() for p in seen.page.locator("figure.lively > svg").all())
            assert seen.complaints == []
            seen.page.close()
