"""Searches driven in the page: improve until nothing is left, stop and keep what is known."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator

import pytest

from workbench_page import Seen, chromium, needs_chromium
from workbench_server import running

pytestmark = needs_chromium
long = pytest.mark.skipif(
    "SHOWN" not in os.environ, reason="a minute of a core of its own: SHOWN=1"
)

#: some refits are done, and some are still to come; a single step may pass unseen
REFITTING = re.compile(r"\(([4-9]|1\d) of \d+\)")


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Seen]:
    project = tmp_path_factory.mktemp("search") / "project"
    with running(project) as server, chromium() as browser:
        found = Seen(browser, server.address)
        found.click("#demo")
        found.wait("#ladder td.number", "%")
        found.page.select_option("#effort", "quick")
        yield found
        assert found.complaints == []


def rungs(seen: Seen) -> int:
    return seen.page.locator("#ladder tbody tr").count()


def stop_and_keep(seen: Seen) -> None:
    seen.click("button:has-text('Stop, keep what is known')")
    seen.wait_gone(".job")


def test_a_diagnosis_that_is_stopped_hands_over_what_it_knows(seen: Seen) -> None:
    seen.click("#diagnose")
    seen.wait(".job .what", REFITTING)
    stop_and_keep(seen)
    seen.wait("#sentence", "The search was stopped before every effect had its turn: ")
    assert "friction at the table gains most so far" in seen.text("#sentence")
    assert not seen.page.locator("article.candidate.named").count(), "what leads has no name yet"
    assert "none of these is judged" in seen.text("#unjudged")
    assert not seen.page.locator("article.candidate .primary, article.candidate .track").count()
    gains = re.findall(r"gain so far (\d+)", seen.page.locator("#part-candidates").inner_text())
    assert [int(gain) for gain in gains] == sorted(map(int, gains), reverse=True) != []
    assert rungs(seen) == 1
    seen.click("#undo")
    seen.wait_gone("article.candidate")


def test_improving_that_is_stopped_keeps_the_rungs_that_it_has(seen: Seen) -> None:
    """The first diagnosis is cut: the refitted numbers are known, no effect is."""
    seen.click("#climb")
    seen.wait(".job .what", REFITTING)
    stop_and_keep(seen)
    seen.wait(".message", "Improved: stopped")
    seen.wait("#ladder tbody tr:nth-child(2) td.number", "%")
    assert rungs(seen) == 2
    assert seen.share(1) < seen.share(0)
    seen.click("#undo")
    seen.wait_gone("#ladder tbody tr:nth-child(2)")


def test_improving_that_is_cancelled_changes_nothing(seen: Seen) -> None:
    seen.click("#climb")
    seen.wait(".job .what", "refitting")
    seen.cancel()
    assert rungs(seen) == 1


@long
def test_improving_goes_on_until_nothing_is_left(seen: Seen) -> None:
    """The line of progress names what is best so far, before it is added."""
    seen.click("#climb")
    seen.wait(".job strong", "Improving until nothing is left")
    seen.wait(".job .what", "best so far coulomb@table")
    assert rungs(seen) == 1
    seen.wait("#ladder tbody tr:nth-child(3) td.number", "%")
    seen.wait("#ladder tbody tr:nth-child(2) td.number", "%")
    seen.wait(".message", "Improved: ")
    assert [seen.share(k) for k in range(3)] == pytest.approx([22.0, 19.2, 1.77], rel=0.02)
    assert re.match(r"The model meets what was recorded: .* sensors\.", seen.text("#sentence"))
    assert seen.faults() == []
    seen.click("#undo")
    seen.wait_gone("#ladder tbody tr:nth-child(2)")
    seen.click("#redo")
    seen.wait("#ladder tbody tr:nth-child(3) td.number", "1.7")
