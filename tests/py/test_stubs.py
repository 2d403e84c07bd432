"""The types Python sees of the C++ core are those it has: `./dev stubs` writes them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import dualdrive

ROOT = Path(__file__).resolve().parents[2]


def test_core_stub_is_current(tmp_path: Path) -> None:
    fresh = tmp_path / "_core.pyi"
    generate = [sys.executable, "-m", "nanobind.stubgen", "--quiet", "--module", "dualdrive._core"]
    patterns = ["--pattern-file", str(ROOT / "cpp" / "bindings" / "stubs.pat")]
    subprocess.run([*generate, *patterns, "--output-file", str(fresh)], check=True)
    committed = Path(dualdrive.__path__[0]) / "_core.pyi"
    assert committed.read_text() == fresh.read_text(), "run ./dev stubs and read what changed"
