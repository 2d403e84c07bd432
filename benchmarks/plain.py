"""CVODE alone, in plain C++: the limit of dualdrive's cvode engine.

The case as a program, and `integrator` for problems that Numba compiled. Built here by CMake, once
with the optimised SUNDIALS of .deps/sundials and once with Debian's own where libsundials-dev is
installed.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from case import Array
from equations import STATES, Problem, constants, eq_23, sizes
from measure import Absent, Program
from surroundings import ROOT

SOURCE = ROOT / "benchmarks" / "plain_cvode"
OPTIMISED = "plain C++ CVODE"
DEBIAN = "plain C++, Debian's CVODE"
LIBRARIES = {OPTIMISED: ROOT / ".deps" / "sundials", DEBIAN: Path("/usr")}
METHODS = {"adams": "Adams", "bdf": "BDF"}


def engines(name: str, **rtols: tuple[float, ...]) -> list[Program]:
    """Methods and their tolerances with the SUNDIALS of that name; raises Absent."""
    path = build(name) / "plain_cvode"
    given = " ".join(repr(float(x)) for x in (*constants(), *sizes()))
    return [
        Program(f"{name} {METHODS[method]}", tolerances, (str(path), method), read, given)
        for method, tolerances in rtols.items()
    ]


def read(states: Array) -> Array:
    return eq_23(np.reshape(states, (-1, STATES)))


def integrator(problem: Problem, method: str) -> Callable[..., tuple[Array, int, int]]:
    """(rtol, atol, times) -> (states at the times, switches, evaluations of the rates).

    As that of dop853.py, by Adams or BDF; raises Absent where it can't be built. The Jacobian is
    CVODE's own difference quotient, whose evaluations are counted.
    """
    library = ctypes.CDLL(str(build(OPTIMISED) / "libcompiled_cvode.so"))
    functions = compiled(problem)
    bdf = int(method == "bdf")

    def run(rtol: float, atol: Array, times: Array) -> tuple[Array, int, int]:
        found, start = np.empty((len(times), problem.states)), np.zeros(problem.states)
        modes, counts = np.zeros(problem.modes, np.int64), np.zeros(3, np.int64)
        by = [ctypes.c_void_p(f.address) for f in functions]
        at = [ctypes.c_void_p(a.ctypes.data) for a in (modes, atol, times, start, found, counts)]
        failed = library.plain_cvode(
            *by, problem.states, problem.guards, at[0], bdf, ctypes.c_double(rtol), at[1], at[2],
            len(times), *at[3:],
        )  # fmt: skip
        if failed:
            raise RuntimeError(f"{OPTIMISED} {METHODS[method]} gave up at rtol {rtol:g}")
        return found, int(counts[0]), int(counts[2])

    return run


def compiled(problem: Problem) -> list[Any]:
    """Its three functions with the signatures of compiled.cpp."""
    import numba

    untyped: Any = numba
    carray, cfunc, types = untyped.carray, untyped.cfunc, untyped.types
    n, m, g = problem.states, problem.modes, problem.guards
    rates, margins, change = problem.rates, problem.margins, problem.change
    real, whole = types.CPointer(types.float64), types.CPointer(types.int64)
    values = types.void(types.float64, real, whole, real)

    @cfunc(values)
    def rates_in(t, y, modes, out):  # type: ignore[no-untyped-def]
        rates(t, carray(y, n), carray(modes, m), carray(out, n))

    @cfunc(values)
    def margins_in(t, y, modes, out):  # type: ignore[no-untyped-def]
        margins(t, carray(y, n), carray(modes, m), carray(out, g))

    @cfunc(types.void(types.int64, types.float64, real, whole))
    def change_in(guard, t, y, modes):  # type: ignore[no-untyped-def]
        change(guard, t, carray(y, n), carray(modes, m))

    return [rates_in, margins_in, change_in]


def build(name: str) -> Path:
    """Return the folder of what is built with one library; raises Absent with what is missing."""
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
    return folder


def _commands(cmake: str, folder: Path, library: Path) -> Iterator[list[str]]:
    yield [cmake, "-S", str(SOURCE), "-B", str(folder), f"-DSUNDIALS_ROOT={library}"]
    yield [cmake, "--build", str(folder)]
