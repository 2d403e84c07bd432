"""Which names a project takes for its files, and that none of them leads out of its folder."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path
from typing import Final

from dualdrive.files import FileError
from dualdrive.workbench.limits import MOST_NAME

__all__ = ["MACHINES", "RECORDINGS", "accepted", "inside"]

RECORDINGS: Final = (".csv", ".txt", ".tsv", ".dat", ".asc", ".h5", ".hdf5", ".hdf", ".nc", ".mat")
MACHINES: Final = (".toml",)
#: letters and digits of any script, spaces inside, and what people put between words
_PLAIN: Final = re.compile(r"[^\W_][\w .,()+@=-]*")
#: names that mean devices on some systems that a project may be copied to
_DEVICES: Final = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def accepted(name: str, endings: tuple[str, ...] = RECORDINGS + MACHINES) -> str:
    """The name as it is kept. Raises FileError naming name, rule and way out."""
    name = unicodedata.normalize("NFC", name)
    shown = ascii(name[:60]).strip("'") if not name.isprintable() else name[:60]
    if len(name) > MOST_NAME or len(name.encode("utf-8", "replace")) > 2 * MOST_NAME:
        raise FileError(f"{shown}...: a name of more than {MOST_NAME} characters; shorten it")
    if not _PLAIN.fullmatch(name) or ".." in name or name.endswith((" ", ".")):
        rule = "a file's name here is letters, digits, spaces and . , ( ) + @ = - _"
        raise FileError(f"{shown}: {rule}; rename it")
    if _DEVICES.fullmatch(name):
        raise FileError(f"{shown}: the name of a device on some systems; rename it")
    if not name.lower().endswith(endings):
        known = ", ".join(endings)
        raise FileError(f"{shown}: its ending is none of {known}; convert or rename it")
    return name


def inside(folder: Path, name: str) -> Path:
    """A file of a folder; FileError for a name that leads out of it, by dots or by a link."""
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise FileError(f"{name}: leads out of the project; name a file of the project")
    return path
