"""docs/effects.md says what the registry says."""

from __future__ import annotations

import runpy
from pathlib import Path

TOOL = Path(__file__).resolve().parents[2] / "tools" / "effects_page.py"


def test_the_page_is_what_the_registry_declares() -> None:
    tool = runpy.run_path(str(TOOL))
    assert tool["PAGE"].read_text("utf-8") == tool["page"](), "run: python tools/effects_page.py"
