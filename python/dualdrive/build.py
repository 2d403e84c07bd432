"""Which build of dualdrive computes: what the last bits of a result depend on."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

from dualdrive import __version__, _core

__all__ = ["core_digest", "fingerprint"]


@cache
def core_digest() -> str:
    """The compiled core, and which of its inner loops this processor runs."""
    library = Path(str(_core.__file__)).read_bytes()
    return f"{hashlib.sha256(library).hexdigest()[:16]} {_core.__kernels__}"


@cache
def _fingerprint() -> tuple[tuple[str, str], ...]:
    python = ".".join(platform.python_version_tuple()[:2])
    packages = ((name, version(name)) for name in ("numpy", "scipy"))
    return (("python", python), ("dualdrive", __version__), ("core", core_digest()), *packages)


def fingerprint() -> dict[str, str]:
    """Name -> version of all that computes; two computers that agree compute the same bits."""
    return dict(_fingerprint())
