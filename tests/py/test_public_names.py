"""The names at the top of the package: there, lazy, and known to editors."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from pkgutil import iter_modules

import pytest

import dualdrive

TREE = ast.parse(Path(dualdrive.__file__).read_text())


def declared() -> dict[str, str]:
    """The imports that only type checkers see."""
    return {
        alias.name: str(node.module)
        for block in TREE.body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def test_editors_know_every_name_from_its_home() -> None:
    parts = dict.fromkeys(dualdrive._PARTS, "dualdrive")
    assert declared() == {**dualdrive._HOMES, **parts}


@pytest.mark.parametrize("name", sorted(dualdrive._HOMES))
def test_a_public_name_is_there_and_documented(name: str) -> None:
    assert getattr(dualdrive, name).__doc__
    assert name in dir(dualdrive)


def test_every_part_is_reached_from_the_top() -> None:
    """In an interpreter of its own: here, other tests have imported them already."""
    modules = (module.name for module in iter_modules(dualdrive.__path__))
    assert sorted(dualdrive._PARTS) == sorted(n for n in modules if not n.startswith("_"))
    code = "import dualdrive; print(dualdrive.diagnose.Diagnosis, dualdrive.tune.tune)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", dualdrive._PARTS)
def test_a_part_is_there_and_documented(name: str) -> None:
    assert getattr(dualdrive, name).__name__ == f"dualdrive.{name}"
    assert getattr(dualdrive, name).__doc__


def test_any_other_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        dualdrive.nothing  # noqa: B018
