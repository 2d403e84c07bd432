"""A page of docs/howto: its blocks, run as printed."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

from click.testing import CliRunner, Result

from dualdrive_cli.main import main

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "howto"


def typed(words: str, answers: str = "") -> Result:
    """What comes of a command line, `dualdrive` left out."""
    return CliRunner().invoke(main, shlex.split(words), input=answers)


class Page:
    """One page; its commands and its Python act in the current folder."""

    def __init__(self, name: str) -> None:
        self.path = FOLDER / name
        self.text = self.path.read_text("utf-8")

    def blocks(self, language: str) -> list[str]:
        """Every block in that language, at least one."""
        found = re.findall(rf"^```{language}\n(.*?)^```", self.text, re.M | re.S)
        assert found, f"{self.path.name}: no {language} block: this test looks for the wrong thing"
        return found

    def lines(self) -> list[str]:
        """Every command line, `dualdrive` left out."""
        found = "".join(self.blocks("sh")).splitlines()
        assert all(line.startswith("dualdrive ") for line in found), found
        return [line.removeprefix("dualdrive ") for line in found]

    def run_commands(self) -> str:
        """Run every command; what they print."""
        printed = ""
        for line in self.lines():
            result = typed(line)
            assert result.exit_code == 0, f"{line}: {result.output}"
            printed += result.output
        return printed

    def run_python(self) -> dict[str, Any]:
        """Run every block of Python, one after the other; the names that they leave."""
        names: dict[str, Any] = {}
        for block in self.blocks("python"):
            exec(compile(block, self.path.name, "exec"), names)
        return names
