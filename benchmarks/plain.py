"""The case in a plain C++ program on CVODE alone: the limit of dualdrive's cvode engine.

Built here by CMake, once with the optimised SUNDIALS of .deps/sundials and once with Debian's own
where libsundials-dev is installed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from case import Array
from equations import STATES, constants, eq_23, sizes
from measure import Absent, Program
from surroundings import ROOT

SOURCE = ROOT / "benchmarks" / "plain_cvode"
OPTIMISED = "plain C++ CVODE"
DEBIAN = "plain C++, Debian's CVODE"
LIBRARIES = {OPTIMISED: ROOT / ".deps" / "sundials", DEBIAN: Path("/usr")}
METHODS = {"adams": "Adams", "bdf": "BDF"}


def engines(name: str, **rtols: tuple[float, ...]) -> list[Program]:
    """Methods and their tolerances with the SUNDIALS of that name; raises Absent."""
    path = build(name)
    given = " ".join(repr(float(x)) for x in (*constants(), *sizes()))
    return [
        Program(f"{name} {METHODS[method]}", tolerances, (str(path), method), read, given)
        for method, tolerances in rtols.items()
    ]


def read(states: Array) -> Array:
    return eq_23(np.reshape(states, (-1, STATES)))


def build(name: str) -> Path:
    """Return the program, built with one library; raises Absent with what is missing."""
    library = LIBRARIES[name]
    if not any(library.glob("lib/**/cmake/sundials/SUNDIALSConfig.cmake")):
        raise Absent(
            "apt-get install libsundials-dev gets it" if name == DEBIAN else "./dev build makes it"
        )
    folder = ROOT / "build" / "plain_cvode" / ("debian" if name == DEBIAN else "optimised")
    tools = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    if not (cmake := shutil.which("cmake", path=tools)):
        raise Absent("no CMake here; pip install cmake gets it")
    for command in _commands(cmake, folder, library):
        done = subprocess.run(
            command, env={**os.environ, "PATH": tools}, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise Absent((done.stdout + done.stderr).strip().splitlines()[-1])
    return folder / "plain_cvode"


def _commands(cmake: str, folder: Path, library: Path) -> Iterator[list[str]]:
    yield [cmake, "-S", str(SOURCE), "-B", str(folder), f"-DSUNDIALS_ROOT={library}"]
    yield [cmake, "--build", str(folder)]
