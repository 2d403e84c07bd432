"""The stand-alone simulation: compiled on demand, one process per record."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SOURCE = Path(__file__).parent / "cpp"
_COMMON = ("t", "theta_ref", "omega_ref", "theta_m")
_OF_A_DRIVE = ("theta", "I", "x", "mesh", "flank")
#: no contraction and nothing of this processor's own: the same bits on another one
_FLAGS = ("-std=c++20", "-O3", "-ffp-contract=off")


class EngineError(RuntimeError):
    """The simulation could not be built, or did not run."""


@cache
def executable() -> Path:
    """Path of the compiled program; its name is a digest of its source."""
    text = b"".join(f.read_bytes() for f in sorted(SOURCE.iterdir()))
    name = "blind-" + hashlib.sha256(text + " ".join(_FLAGS).encode()).hexdigest()[:16]
    folder = Path(tempfile.gettempdir()) / f"dualdrive-blind-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    program = folder / name
    if program.exists():
        return program
    compiler = os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        raise EngineError("no C++ compiler found; set CXX")
    fresh = program.with_suffix(f".{os.getpid()}")
    command = [compiler, *_FLAGS, str(SOURCE / "main.cpp"), "-o", str(fresh)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    if done.returncode != 0:
        raise EngineError(f"compiler failed:\n{done.stderr}")
    fresh.replace(program)
    return program


def run(
    numbers: Mapping[str, float],
    jerks: Sequence[tuple[float, float]] = (),
    knots: tuple[Array, float] | None = None,
    timeout: float = 300,
) -> dict[str, Array]:
    """Channels at every `output_step` from time 0 on, each of shape (n,), SI.

    numbers: of ``cpp/parameters.hpp``
    jerks:   (time, jerk) pieces of the commanded motion, or
    knots:   its cubic pieces (angle and speed at both ends, shape (k, 4)) and the length of one, s
    """
    lines = [f"{name} {float(value)!r}\n" for name, value in numbers.items()]
    lines += [f"jerk {t!r} {jerk!r}\n" for t, jerk in jerks]
    said = "".join(lines).encode()
    if knots is not None:
        pieces = np.ascontiguousarray(knots[0], dtype=np.float64)
        said += f"knots {len(pieces)} {knots[1]!r}\n".encode() + pieces.tobytes()
    done = subprocess.run(
        [executable()], input=said, capture_output=True, timeout=timeout, check=False
    )
    if done.returncode != 0:
        raise EngineError(done.stderr.decode().strip())
    names = list(_COMMON)
    for n in range(1, int(numbers.get("drives", 2)) + 1):
        names += [f"{name}_{n}" for name in _OF_A_DRIVE]
    rows = np.frombuffer(done.stdout).reshape(-1, len(names))
    if not np.all(np.isfinite(rows)):
        raise EngineError("the simulation left the finite numbers")
    return dict(zip(names, rows.T.copy(), strict=True))
