"""docs/howto/add-an-effect.md does what it says: its blocks are built and tested as printed."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HOWTO = ROOT / "docs" / "howto" / "add-an-effect.md"
COMPILER = shutil.which("c++")


def has_doctest() -> bool:
    probe = [
        str(COMPILER),
        "-x",
        "c++",
        "-fsyntax-only",
        "-include",
        "doctest/doctest.h",
        "/dev/null",
    ]
    return COMPILER is not None and subprocess.run(probe, capture_output=True).returncode == 0


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", HOWTO.read_text(), re.DOTALL)


def apply(diff: str, text: str) -> str:
    """Insert a diff's one added line after its line of context; without one, among the includes."""
    context, added = "", ""
    for line in diff.splitlines():
        if line.startswith("+"):
            added = line[1:]
        elif not added:
            context = line[1:]
    anchor = context or '#include "dualdrive/effect.hpp"'
    assert text.count(anchor) == 1, f"the registry has no line {anchor!r}"
    return text.replace(anchor, f"{anchor}\n{added}")


@pytest.mark.long
@pytest.mark.skipif(not has_doctest(), reason="needs a C++ compiler and doctest")
def test_the_printed_effect_passes_every_effect_test(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "cpp" / "include", tmp_path / "include")
    header, case = blocks("cpp")
    registry = tmp_path / "include" / "dualdrive" / "effects.hpp"
    (registry.parent / "effects" / "windage.hpp").write_text(header)
    text = registry.read_text()
    for diff in blocks("diff"):
        text = apply(diff, text)
    registry.write_text(text)

    tests = ROOT / "tests" / "cpp"
    beside = tmp_path / "test_effects_body.cpp"
    beside.write_text((tests / "test_effects_body.cpp").read_text() + case)
    sources = [
        beside,
        tests / "test_effects.cpp",
        tests / "doctest_main.cpp",
        ROOT / "cpp" / "src" / "effects.cpp",
        ROOT / "cpp" / "src" / "nearest.cpp",
    ]
    built = subprocess.run(
        [str(COMPILER), "-std=c++20", "-I", tmp_path / "include", *sources, "-o", tmp_path / "run"],
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    for selection in ("", "windage*"):
        ran = subprocess.run(
            [tmp_path / "run", f"--test-case={selection}"], capture_output=True, text=True
        )
        assert ran.returncode == 0, ran.stdout
        assert "assertions: 0" not in re.sub(r" +", " ", ran.stdout)
