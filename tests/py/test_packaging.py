"""What leaves the project: the C++ package, the wheel, and one version everywhere."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import dualdrive

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "release"


def declared_version() -> str:
    version: str = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    return version


def run(*command: str | Path) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}"
    return done.stdout


def test_what_a_program_still_holds_at_its_end_is_no_leak() -> None:
    """The frame of a thread that sleeps on outlives the module; nothing may be printed of it."""
    code = (
        "import threading, time, dualdrive\n"
        "core = dualdrive.Machine.load('bench').core\n"
        "threading.Thread(target=lambda held: time.sleep(99), args=[core], daemon=True).start()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


def test_the_module_and_the_command_carry_the_declared_version() -> None:
    assert dualdrive.__version__ == declared_version()
    assert declared_version() in run(sys.executable, "-m", "dualdrive_cli", "--version")


def test_every_package_of_the_tests_is_locked() -> None:
    """What was green yesterday is green today: `./dev lock` moves all versions at once."""
    lines = (ROOT / "tests" / "constraints.txt").read_text().splitlines()
    locked = {re.split("==", line)[0].lower().replace("_", "-") for line in lines}
    assert all(re.fullmatch(r'[\w.-]+==[\w.]+ ; python_version == "3\.\d+"', s) for s in lines)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    groups = project["dependency-groups"]
    asked = [*project["project"]["dependencies"], *groups["build"], *groups["test"]]
    names = {re.split(r"[<>=]", text)[0].lower() for text in asked}
    assert names <= locked


def test_changelog_knows_the_version() -> None:
    assert f"## {declared_version()}" in (ROOT / "CHANGELOG.md").read_text()


@pytest.mark.skipif(not BUILD.exists(), reason="needs build/release: run ./dev build")
def test_a_cpp_program_finds_and_links_the_installed_library(tmp_path: Path) -> None:
    prefix, build = tmp_path / "prefix", tmp_path / "build"
    run("cmake", "--install", BUILD, "--component", "cpp", "--prefix", prefix)
    source = ROOT / "examples" / "cpp-consumer"
    run("cmake", "-G", "Ninja", "-S", source, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}")
    run("cmake", "--build", build)
    assert declared_version() in run(build / "cpp_consumer")


def test_the_wheel_holds_every_python_file(tmp_path: Path) -> None:
    """Of both packages and their data; the compiled core is left out, to be quick."""
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    run(*pip, "--config-settings=wheel.cmake=false", "--wheel-dir", tmp_path, ROOT)
    (wheel,) = tmp_path.glob("dualdrive-*.whl")
    held = set(zipfile.ZipFile(wheel).namelist())
    for package, folder in (
        ("dualdrive", ROOT / "python" / "dualdrive"),
        ("dualdrive_cli", ROOT / "cli"),
    ):
        for path in folder.rglob("*"):
            if path.suffix in {".py", ".pyi", ".toml", ".typed", ".css", ".js", ".html", ".txt"}:
                assert f"{package}/{path.relative_to(folder).as_posix()}" in held
