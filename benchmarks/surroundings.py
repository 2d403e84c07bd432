"""The machine, the versions and the SUNDIALS that figures were taken with."""

from __future__ import annotations

import os
import platform
import re
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import dualdrive
from dualdrive import _core

ROOT = Path(__file__).resolve().parents[1]


def describe() -> dict[str, Any]:
    packages = ("numpy", "scipy", "numba", "scikit-sundae", "casadi")
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "load before": round(os.getloadavg()[0], 2),
        "system": platform.platform(terse=True),
        "python": platform.python_version(),
        "dualdrive": f"{dualdrive.__version__} with {_core.__kernels__} loops",
        "sundials": f"{_core.__sundials_version__}, {_sundials()}",
        **{name: _version(name) for name in packages},
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*: (.+)", info.read_text()) if info.exists() else None
    return found[1] if found else platform.processor() or platform.machine()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _sundials() -> str:
    """Which library the core was linked with, read from the build's own record."""
    cache = ROOT / "build" / "release" / "CMakeCache.txt"
    text = cache.read_text() if cache.exists() else ""
    found = re.search(r"^SUNDIALS_DIR:\w+=(.*)$", text, re.M)
    if found is None:
        return "origin unknown"
    if found[1].startswith("/usr/"):
        return (
            "Debian's own, without optimisation: runs take about 3.5 times as long as they should"
        )
    return "optimised (-O2)"
