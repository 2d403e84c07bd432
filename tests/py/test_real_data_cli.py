"""docs/howto/real-data.md: its commands run as printed, and reach what others have published."""

from __future__ import annotations

import json
import math
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from dualdrive import Machine
from dualdrive_cli.main import main
from measured import EXAMPLES, measured_file

pytestmark = pytest.mark.long

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "real-data.md"
TEXT = PAGE.read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
RECORDS = [
    "emps/DATA_EMPS.mat",
    "kuka_kr300/derived_rec_A.csv",
    "dual_motor_rig/log10.csv",
    "dual_motor_rig/log12.csv",
]
#: M in kg, Fv in N*s/m, Fc in N: A. Janot, M. Gautier, M. Brunot, 2019
PUBLISHED = {"table.J": 95.109, "table.b": 203.50, "coulomb@table.torque": 20.39}
NUMBER = re.compile(r"[-+±]?\d+(?:\.\d+)?")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example files and the records under the names the page uses."""
    here = tmp_path_factory.mktemp("real")
    for record in RECORDS:
        path = measured_file(record)
        (here / path.name).symlink_to(path.resolve())
    for example in EXAMPLES.glob("*.toml"):
        shutil.copy(example, here)
    return here


@pytest.fixture(scope="module")
def told(folder: Path) -> dict[str, str]:
    """What every command of the page printed, by command; figures as JSON under out/<number>."""
    lines = [line for kind, text in BLOCKS if not kind for line in text.splitlines()]
    commands = [line for line in lines if line.startswith("dualdrive ")]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        printed = {}
        for number, line in enumerate(commands):
            words = shlex.split(line)[1:]
            if words[0] != "add":
                words += ["--json", f"figures-{number}.json"]
            done = CliRunner().invoke(main, words)
            assert done.exit_code == 0, (line, done.output)
            printed[line] = done.output
    return printed


def figures(folder: Path, told: dict[str, str], part: str) -> dict[str, dict[str, object]]:
    """The JSON of the one command that matches."""
    (number,) = [k for k, line in enumerate(told) if re.search(part, line)]
    found: dict[str, dict[str, object]] = json.loads(
        (folder / f"figures-{number}.json").read_text()
    )
    return found


def number(content: object, *keys: str) -> float:
    for key in keys:
        assert isinstance(content, dict)
        content = content[key]
    assert isinstance(content, int | float)
    return float(content)


def test_the_page_prints_what_the_commands_print(told: dict[str, str]) -> None:
    lines = [" ".join(line.split()) for text in told.values() for line in text.splitlines()]
    shown = [line for kind, text in BLOCKS if kind == "output" for line in text.splitlines()]
    assert len(shown) >= 15
    for line in shown:
        words = NUMBER.sub("#", line)
        alike = [own for own in lines if NUMBER.sub("#", own).startswith(words)]
        assert alike, f"no command prints {line!r}"
        assert any(near(line, own) for own in alike), (line, alike)


def near(line: str, own: str) -> bool:
    """Numbers within 2 %: another processor may round otherwise."""
    ours, theirs = ([float(n.lstrip("±")) for n in NUMBER.findall(text)] for text in (line, own))
    return ours == pytest.approx(theirs[: len(ours)], rel=0.02, abs=1e-3)


# --- the linear axis ------------------------------------------------------------------------------


def test_balance_without_dry_friction_leaves_a_sixth_of_the_force(
    folder: Path, told: dict[str, str]
) -> None:
    bare = figures(folder, told, "--free table.J,table.b")
    assert 0.15 < number(bare, "force_error", "refitted") < 0.20


def test_balance_with_dry_friction_reaches_the_published_figures(
    folder: Path, told: dict[str, str]
) -> None:
    found = figures(folder, told, "-o emps-fitted.toml")
    assert number(found, "force_error", "refitted") <= 0.042
    machine = Machine.load(folder / "emps-fitted.toml")
    for path, value in PUBLISHED.items():
        assert number(found, "parameters", path, "value") == pytest.approx(value, rel=5e-3)
        assert machine.get(path) == number(found, "parameters", path, "value")
    offset = number(found, "offsets", "offset DATA_EMPS, total", "value")
    assert offset == pytest.approx(-3.165, abs=0.1)
    assert found["parameters"]["table.J"]["unit"] == "kg"  # type: ignore[index]
    assert machine.history[-1]["change"] == "fitted to DATA_EMPS"


def test_processing_and_standstill_are_printed(told: dict[str, str]) -> None:
    balances = [text for line, text in told.items() if "balance" in line or "--cutoff" in line]
    assert len(balances) == 8
    for text in balances:
        flat = " ".join(text.split())
        assert re.search(r"Butterworth order 4, \d+ Hz.*both sides decimated ×\d+", flat)
        assert re.search(r"\d+ of \d+ samples count, \d+ near standstill masked", flat)


def test_closed_loop_with_the_rigs_own_controller(folder: Path, told: dict[str, str]) -> None:
    bare = figures(folder, told, r"fit emps.toml \S+ --map emps.map.toml$")
    assert 0.15 < number(bare, "errors", "T_1") < 0.20
    found = figures(folder, told, "-o emps-loop.toml")
    assert number(found, "errors", "T_1") < 0.050  # 4.6 % with unequal friction
    assert abs(number(found, "parameters", "coulomb@table.asymmetry", "value")) > 0.05
    assert number(found, "parameters", "table.J", "value") == pytest.approx(95.109, rel=0.01)
    compared = figures(folder, told, "compare emps-fitted.toml")
    assert number(compared, "channels", "T_1", "error") < 0.055


# --- a robot's axis -------------------------------------------------------------------------------


def test_a_robot_axis_misses_friction_and_order_8_of_its_motor(
    folder: Path, told: dict[str, str]
) -> None:
    """1.48 N m and order 8.00 per motor turn come out of a plain regression as well."""
    found = figures(folder, told, "-o kuka-friction.toml")
    assert number(found, "error", "refitted") < 0.16 < number(found, "error", "nominal")
    friction = number(found, "parameters", "coulomb@motor_1.torque", "value")
    assert friction == pytest.approx(1.48, rel=0.03)
    compared: Any = figures(folder, told, "compare kuka-friction.toml")
    assert number(compared["orders"][0], "order") == pytest.approx(8.0, abs=0.02)
    (skew,) = compared["skews"]
    assert (skew["late"], skew["significant"]) == ("theta_m", True)
    assert skew["low"] < 2.83e-3 < skew["high"]
    arcsec = math.pi / 180.0 / 3600.0
    assert skew["apart"] / arcsec == pytest.approx(144.0, rel=0.1)
    assert skew["left"] / arcsec < 20.0


# --- two drives on one ring -----------------------------------------------------------------------


@pytest.mark.parametrize(("name", "parts", "most"), [("10", 8, 0.10), ("12", 3, 0.25)])
def test_ring_inertia_is_said_to_be_unknown(
    folder: Path, told: dict[str, str], name: str, parts: int, most: float
) -> None:
    found = figures(folder, told, f"-o rig-{name}.toml")
    assert number(found, "error", "refitted") < most < number(found, "error", "nominal")
    ring = found["parameters"]["table.J"]
    assert isinstance(ring, dict)
    assert ring["verdict"] == "not identified"
    assert "cannot be identified from these records" in ring["reason"]
    assert len(found["offsets"]) == parts


def test_every_part_has_its_error(told: dict[str, str]) -> None:
    (text,) = [text for line, text in told.items() if line.startswith("dualdrive compare dual")]
    for test in (1, 2, 3, 4):
        for tension in (0, 1):
            name = rf"log10\[TestIndex={test}, AntiBacklashEnabled={tension}, .*\] +\d\d\.\d\d%"
            assert re.search(name, text)


def test_play_of_the_rig_is_54_to_62_degrees(folder: Path, told: dict[str, str]) -> None:
    """While the ring rests the drives cross the gap: 54 to 62 degrees, read off the raw trace."""
    found = figures(folder, told, "play log10.csv")
    assert [mesh["status"] for mesh in found["meshes"]] == ["estimated"] * 2  # type: ignore[index]
    for mesh in found["meshes"]:
        low, high = (57.29578 * number(mesh, "full", end) for end in ("low", "high"))
        assert 52 < low < high < 62
    bounded = figures(folder, told, "play log12.csv")
    assert [mesh["status"] for mesh in bounded["meshes"]] == ["bounded"] * 2  # type: ignore[index]
    for picture in ("play.png", "play-12.png", "emps.png", "log10.png"):
        assert (folder / picture).stat().st_size > 10_000
