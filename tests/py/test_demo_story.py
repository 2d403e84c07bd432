"""The demo, on records that another program made: it must find what was hidden."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from patience import PATIENCE

TRUTH = tomllib.loads((Path(__file__).parent / "demo_truth.toml").read_text())
HIDDEN = f"{TRUTH['effect']['name']}@{TRUTH['effect']['place']}"


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demo")
    done = subprocess.run(
        [sys.executable, "-m", "dualdrive_cli", "demo", "-o", "out", "--json", "figures.json"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=2 * PATIENCE,
    )
    assert done.returncode == 0, done.stderr
    (folder / "said.txt").write_text(done.stdout)
    return folder


@pytest.fixture(scope="module")
def figures(demo: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((demo / "figures.json").read_text())
    return found


def test_it_names_the_hidden_effect(figures: dict[str, Any]) -> None:
    first, last = figures["diagnoses"]
    best = first["candidates"][0]
    assert first["verdict"] == "effect"
    assert f"{best['effect']}@{best['place']}" == HIDDEN
    assert last["verdict"] == "adequate", "then nothing is missing"


def test_its_size_is_recovered(figures: dict[str, Any]) -> None:
    torque = figures["diagnoses"][0]["candidates"][0]["parameters"][f"{HIDDEN}.torque"]
    assert torque["value"] == pytest.approx(TRUTH["effect"]["torque"], rel=0.01)


def test_the_error_falls_to_the_noise_floor_on_data_it_was_not_fitted_to(
    figures: dict[str, Any],
) -> None:
    sheet, refitted, grown = (step["held_out"] for step in figures["steps"])
    assert refitted < sheet
    assert grown < 0.15 * refitted
    assert grown < 1.2 * figures["steps"][-1]["noise_floor"]


def test_pictures_and_machine_are_left(demo: Path) -> None:
    names = {path.name for path in (demo / "out").iterdir()}
    assert {"improved.toml", "report.html", "ladder.png", "improved.png"} <= names
    assert "coulomb@table" in (demo / "said.txt").read_text()
    history = tomllib.loads((demo / "out" / "improved.toml").read_text())["history"]
    assert any("coulomb" in json.dumps(entry) for entry in history)


def test_the_readme_shows_what_it_prints(demo: Path) -> None:
    shown = _errors((Path(__file__).parents[2] / "README.md").read_text())
    printed = _errors((demo / "said.txt").read_text())
    assert len(shown) == 3
    assert {name: printed[name] for name in shown} == {
        name: pytest.approx(row, abs=0.01) for name, row in shown.items()
    }


def _errors(text: str) -> dict[str, list[float]]:
    """Model -> per cent in its row, of the tables of errors in a text."""
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in text.splitlines()]
    return {
        name: [float(cell.removesuffix("%")) for cell in cells]
        for name, *cells in filter(None, rows)
        if cells and all(cell.endswith("%") for cell in cells)
    }


# --- its first diagnosis, of the record that is fitted --------------------------------------------


@pytest.fixture(scope="module")
def first(figures: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = figures["diagnoses"][0]
    return found


def test_the_equation_and_the_hidden_friction_have_their_names(first: dict[str, Any]) -> None:
    best = first["candidates"][0]
    assert f"{best['effect']}@{best['place']}" == HIDDEN
    assert first["verdict"] in ("effect", "ambiguous")
    assert first["equation"]["name"] == TRUTH["effect"]["place"]
    torque = best["parameters"][f"{HIDDEN}.torque"]
    assert torque["low"] <= 1.02 * TRUTH["effect"]["torque"]
    assert torque["high"] >= 0.98 * TRUTH["effect"]["torque"]


def test_the_error_falls_to_the_floor(first: dict[str, Any]) -> None:
    error = first["error"]
    assert error["nominal"] > 0.15
    assert error["refitted"] > 0.15
    assert error["best"] < 1.2 * error["noise_floor"]
    assert error["held_out_best"] < 0.5 * error["held_out_refitted"]


def test_it_says_so_in_words_and_gives_the_command(first: dict[str, Any]) -> None:
    assert HIDDEN in first["paragraph"]
    assert first["command"].startswith(f"dualdrive add MACHINE {HIDDEN} --set torque=")
