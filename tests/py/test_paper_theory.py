"""docs/theory/paper.md: its matrices are an independent hand's, its errata have their tests."""

from __future__ import annotations

import re
import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dualdrive import linear
from reference_model import heavy_table
from test_reference_model import SIDES, eq23

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "theory" / "paper.md").read_text()


@pytest.fixture(scope="module")
def shown() -> dict[str, Any]:
    """What the page's Python leaves."""
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    names: dict[str, Any] = {}
    exec(compile(block, "docs/theory/paper.md", "exec"), names)
    return names


@pytest.mark.parametrize("sides", [(a, b) for a in SIDES for b in SIDES])
def test_the_page_s_matrices_are_eq_23(shown: dict[str, Any], sides: tuple[int, int]) -> None:
    mode = linear.modes(shown["machine"])[str(sides)]
    machine = replace(heavy_table(250, dry_friction=False).both(c=0.0), controller=None)
    A, Cv = eq23(machine, sides)
    np.testing.assert_allclose(mode.A, A, rtol=1e-12, atol=1e-13 * np.abs(A).max())
    np.testing.assert_allclose(mode.C @ mode.v, Cv, rtol=1e-12, atol=1e-15)
    assert mode.v.tolist() == [side * machine.drives[0].gap for side in sides]
    for n, drive in enumerate(machine.drives):
        assert mode.B[4 + n, n] == pytest.approx(1 / drive.L)


def test_the_mode_shown_is_that_of_the_comment(shown: dict[str, Any]) -> None:
    assert shown["mode"].sides == (1, -1)
    assert len(shown["mode"].eigenvalues) == 8


def test_every_erratum_names_tests_that_are_there_or_says_that_it_is_notation() -> None:
    tests = "".join(path.read_text() for path in (ROOT / "tests" / "py").glob("test_*.py"))
    lines = PAGE.partition("## Errata")[2].splitlines()
    rows = [line for line in lines if re.match(r"\| (Eq|§|abs|Tab)", line)]
    assert len(rows) >= 27
    for row in rows:
        cell = row.rstrip("| ").rpartition(" | ")[2]
        named = re.findall(r"`(test_\w+)`", cell)
        assert named or cell in ("*notation*", "*open*"), row
        for name in named:
            assert f"def {name}(" in tests, name
    for number in range(1, 24):
        assert f"({number})" in PAGE, f"Eq. {number} is missing"


def test_every_equation_is_where_the_page_says_and_found_by_its_number() -> None:
    """In the function that computes it, its comment above included; else in the file of a type."""
    rows = [line for line in PAGE.partition("## Errata")[0].splitlines() if line.startswith("| (")]
    seen = []
    for row in rows:
        numbers = [int(n) for n in re.findall(r"\((\d+)\)", row.split("|")[1])]
        file, symbol = re.findall(r"\]\(\.\./\.\./([^)]+)\) `([^`]+)`", row)[0]
        text = (ROOT / file).read_text()
        assert re.search(rf"\b{re.escape(symbol)}\b", text), f"{file}: no {symbol}"
        if "::" in symbol:
            text = function(text, symbol)
        for number in numbers:
            assert re.search(rf"Eq\. {number}\b", text), f"{file}: {symbol}: no Eq. {number}"
        seen += numbers
    assert sorted(seen) == list(range(1, 24))


def function(text: str, symbol: str) -> str:
    """Its definition and the comment above it."""
    found = re.search(
        rf"(?:^//[^\n]*\n)*^template[^\n]*\n^[^\n]*\b{re.escape(symbol)}\(.*?^\}}",
        text,
        re.M | re.S,
    )
    assert found, symbol
    return found[0]


def test_a_newcomer_s_look_ups_are_those_of_the_review() -> None:
    """docs/paper-review.md shows what the tool prints, and every equation is found by it."""
    tool = runpy.run_path(str(ROOT / "tools" / "lookups.py"))
    review = (ROOT / "docs" / "paper-review.md").read_text("utf-8")
    shown = review.partition("$ python tools/lookups.py\n")[2].partition("```")[0]
    assert "\n".join(tool["looked_up"]()) == shown.strip()
    assert tool["looked_up"](range(1, 24))[-1].startswith("found 23 of 23; ")
    for path in re.findall(r"(?:benchmarks|tools|tests/py)/\w+\.py", review):
        assert (ROOT / path).is_file(), path
