"""Chromium for tests of the workbench's page: Debian's, driven by Playwright's Python client."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from patience import PATIENCE

if TYPE_CHECKING:
    from playwright.sync_api import Browser

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


def reason() -> str:
    """Why no browser can be driven here; empty where one can."""
    if CHROMIUM is None:
        return "needs Chromium: apt-get install chromium"
    try:
        import playwright  # noqa: F401
    except ImportError:
        return "needs Playwright's client: pip install playwright"
    return ""


needs_chromium = pytest.mark.skipif(bool(reason()), reason=reason() or "Chromium is there")


@contextmanager
def chromium() -> Iterator[Browser]:
    """A headless browser; its sandbox is left out, since tests run as root in containers."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        try:
            yield browser
        finally:
            browser.close()


class Seen:
    """A page under test, and what its browser complained of."""

    def __init__(self, browser: Browser, address: str, **options: Any) -> None:
        self.page = browser.new_page(**{"viewport": {"width": 1280, "height": 900}, **options})
        self.complaints: list[str] = []
        self._server_gone = False
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._heard)
        self.page.set_default_timeout(1000 * PATIENCE)
        self.page.goto(address)

    def _heard(self, message: Any) -> None:
        expected = "WebSocket" in message.text or (
            self._server_gone and "ERR_CONNECTION_REFUSED" in message.text
        )
        if message.type == "error" and not expected:
            self.complaints.append(message.text)

    @contextmanager
    def server_gone(self) -> Iterator[None]:
        """While the test has its server killed: the page may find nobody there."""
        self._server_gone = True
        yield
        self.page.wait_for_timeout(100)  # what the browser has still to say of it
        self._server_gone = False

    def click(self, selector: str) -> None:
        self.page.locator(selector).first.click()

    def wait(self, selector: str, text: str | re.Pattern[str] | None = None) -> None:
        """Until something is there, with this text in it."""
        found = self.page.locator(selector, has_text=text) if text else self.page.locator(selector)
        found.first.wait_for()

    def wait_gone(self, selector: str) -> None:
        self.page.locator(selector).first.wait_for(state="detached")

    def cancel(self) -> None:
        """Cancel what is computed: it goes, and is told."""
        self.click(".job .cancel")
        self.wait_gone(".job")
        self.wait(".message", "cancelled; nothing was changed")

    def text(self, selector: str) -> str:
        return self.page.locator(selector).first.inner_text()

    def share(self, rung: int, column: int = 2) -> float:
        """An error of the ladder in per cent: rung and column counted from 0."""
        row = self.page.locator("#ladder tbody tr").nth(rung)
        return float(row.locator("th, td").nth(column).inner_text().rstrip(" %"))

    def upload(self, *paths: Path) -> None:
        self.page.set_input_files("#files", list(paths))

    def saved(self, selector: str, to: Path) -> Path:
        """What a button lets the browser download."""
        with self.page.expect_download() as told:
            self.click(selector)
        told.value.save_as(to)
        return to

    def faults(self, context: str = "document") -> list[str]:
        """What axe-core calls serious or critical."""
        axe = Path(__file__).resolve().parents[1] / "vendor" / "axe.min.js"
        session = self.page.context.new_cdp_session(self.page)  # past the page's own policy
        session.send("Runtime.evaluate", {"expression": axe.read_text()})
        asked = {"expression": f"axe.run({context})", "awaitPromise": True, "returnByValue": True}
        found = session.send("Runtime.evaluate", asked)["result"]["value"]["violations"]
        return [
            f"{v['impact']} {v['id']}: {node['html'][:160]} {node['failureSummary'][:200]}"
            for v in found
            if v["impact"] in ("serious", "critical")
            for node in v["nodes"]
        ]
