"""docs/paper.md is what the command writes; the verb `paper`, its pictures and what it refuses."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from dualdrive.indexing import PRINTED
from dualdrive.paper import EXHIBITS, page
from dualdrive.paper.rendering import section
from dualdrive.plots.paper import draw
from dualdrive_cli.main import main
from test_paper import exhibit

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "paper.md").read_text()
FIGURES = [name for name in EXHIBITS if name.startswith("fig")]
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")

TUNED = re.compile(r"^.*(dualdrive tune|tuned).*$", re.MULTILINE)


def written(title: str) -> str:
    """A section of docs/paper.md, without its picture."""
    text = PAGE.partition(f"## {title}\n")[2].partition("\n## ")[0]
    return re.sub(r"!\[.*\]\(.*\)\n\n", "", text).strip()


@pytest.mark.long
@pytest.mark.parametrize("name", FIGURES)
def test_the_page_is_what_the_command_writes(name: str) -> None:
    """Word for word, and number for number as far as processors round alike.

    Red after a change of the model: write the page anew, its second line says how. What `tune`
    finds is a search's end; its lines are held to their words alone.
    """
    now = section(exhibit(name)).partition("\n")[2].strip()
    then = written(exhibit(name).title)
    assert NUMBER.sub("#", now) == NUMBER.sub("#", then)
    numbers = [[float(x) for x in NUMBER.findall(TUNED.sub("", text))] for text in (now, then)]
    assert numbers[0] == pytest.approx(numbers[1], rel=2e-3, abs=0.02)


def test_the_tables_on_the_page_have_every_printed_number() -> None:
    """A table per load and figure, its first row what the paper prints."""
    for (load, column), row in PRINTED.items():
        title = "Table 1: indexing accuracy without load"
        if load != "empty":
            title = "Table 2: indexing accuracy under load"
        where = "unloaded" if load == "empty" else load.replace("t", " t")
        if column == "single motor":
            continue
        place = 1 if column == "traditional" else 2
        for figure, value in row.items():
            part = written(title).partition(f"**{figure}, {where}")[2]
            printed = next(line for line in part.splitlines() if line.startswith("| printed"))
            assert printed.strip("| ").split(" | ")[place] == f"{value:g}"


def test_the_page_shows_a_picture_of_everything() -> None:
    pictures = re.findall(r"!\[.*\]\((.*)\)", PAGE)
    assert [Path(picture).stem for picture in pictures] == list(EXHIBITS)
    assert all((DOCS / picture).stat().st_size > 10_000 for picture in pictures)
    assert "`dualdrive paper all -o docs/paper --page docs/paper.md`" in PAGE


@pytest.mark.parametrize("name", FIGURES)
def test_every_picture_says_what_its_axes_are(name: str) -> None:
    figure = draw(exhibit(name))
    assert figure.axes
    for axes in figure.axes:
        if axes.axison and axes.lines:
            assert re.search(r"\[.+\]$", axes.get_ylabel()), axes.get_ylabel()


def run(line: str) -> Result:
    return CliRunner().invoke(main, ["paper", *line.split()])


def test_the_verb_draws_prints_and_writes(tmp_path: Path) -> None:
    done = run(f"fig5 -o {tmp_path}/out --json {tmp_path}/f.json --page {tmp_path}/page.md")
    assert done.exit_code == 0, done.output
    assert re.search(r"delay time t_d \[s\] +1\.243 +1\.248 +\+0\.4 %", done.stdout)
    (one,) = json.loads((tmp_path / "f.json").read_text())["exhibits"]
    assert one["name"] == "fig5"
    assert abs(one["numbers"][0]["deviation"]) < 0.02
    text = (tmp_path / "page.md").read_text()
    assert text == page([exhibit("fig5")], {"fig5": "out/fig5.png"}, _command(text))
    assert (tmp_path / "out" / "fig5.png").stat().st_size > 10_000
    again = run(f"fig5 -o {tmp_path}/out")
    assert again.exit_code != 0
    assert "exists already" in again.stderr


def _command(text: str) -> str:
    (line,) = re.findall(r"Written by `(.*)`", text)
    return str(line)


def test_the_example_of_the_help_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"Example: dualdrive paper (.+)", run("--help").output)
    assert run(example).exit_code == 0


def test_what_makes_no_sense_is_refused_before_anything_is_computed(tmp_path: Path) -> None:
    assert run("fig7").exit_code == 2
    refused = run(f"fig4 --page {tmp_path}/p.md")
    assert refused.exit_code == 2
    assert "say with -o where they go" in refused.stderr
    nowhere = run(f"fig4 -o {tmp_path}/out --page {tmp_path}/none/p.md")
    assert nowhere.exit_code == 1
    assert "there is no folder" in nowhere.stderr
    assert not (tmp_path / "out").exists()
