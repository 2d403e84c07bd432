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
CHANNELS = (
    *("t", "theta_ref", "theta_m", "theta_1", "theta_2", "I_1", "I_2"),
    *("x_1", "x_2", "mesh_1", "mesh_2", "flank_1", "flank_2"),
)
_FLAGS = ("-std=c++20", "-O3", "-march=native")


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
    numbers: Mapping[str, float], jerks: Sequence[tuple[float, float]] = (), timeout: float = 120
) -> dict[str, Array]:
    """Channels at every `output_step` from time 0 on, each of shape (n,), SI.

    numbers: of ``cpp/parameters.hpp``; jerks: (time, jerk) pieces of the commanded motion.
    """
    lines = [f"{name} {float(value)!r}" for name, value in numbers.items()]
    lines += [f"jerk {t!r} {jerk!r}" for t, jerk in jerks]
    done = subprocess.run(
        [executable()],
        input="\n".join(lines).encode(),
        capture_output=True,
        timeout=timeout,
        check=False,
    )
    if done.returncode != 0:
        raise EngineError(done.stderr.decode().strip())
    rows = np.frombuffer(done.stdout).reshape(-1, len(CHANNELS))
    if not np.all(np.isfinite(rows)):
        raise EngineError("the simulation left the finite numbers")
    return dict(zip(CHANNELS, rows.T.copy(), strict=True))
