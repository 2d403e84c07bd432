"""Where a report comes from: enough to make it again, and to see that nothing was swapped."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Self

from dualdrive import __version__

__all__ = ["Provenance", "Source"]

_PACKAGES = ("numpy", "scipy", "matplotlib")


@dataclass(frozen=True)
class Source:
    """A file that went in: its name, size in bytes and SHA-256."""

    name: str
    size: int
    sha256: str

    @classmethod
    def of(cls, path: str | Path) -> Self:
        """Read a file's size and hash. Raises OSError where it can't be read."""
        path = Path(path)
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return cls(path.name, path.stat().st_size, digest)


@dataclass(frozen=True)
class Provenance:
    """What a report was made from.

    commands: what to type for it, in order
    machines: title -> text of a machine file
    """

    sources: Sequence[Source] = ()
    commands: Sequence[str] = ()
    machines: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    made: str = ""

    @classmethod
    def of(
        cls,
        machine: Any,
        traces: Sequence[str | Path],
        *,
        improved: Any = None,
        commands: Sequence[str] = (),
    ) -> Self:
        """Gather it now.

        Args:
            machine: the machine as it was given.
            traces: the files of the records.
            improved: the machine with what was found, if any.
            commands: what was typed, in order.

        Raises:
            OSError: a file that can't be read.

        """
        texts = {"as given": machine.toml()} if hasattr(machine, "toml") else {}
        if hasattr(improved, "toml"):
            texts["improved"] = improved.toml()
        made = datetime.now(UTC).isoformat(timespec="seconds")
        sources = [Source.of(path) for path in traces]
        return cls(sources, tuple(commands), texts, _versions(), made)


def _versions() -> dict[str, str]:
    from dualdrive._core import __kernels__, __sundials_version__

    found = {"dualdrive": __version__, "SUNDIALS": __sundials_version__, "kernels": __kernels__}
    found["Python"] = platform.python_version()
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found | {"system": f"{platform.system()} {platform.machine()}"}
