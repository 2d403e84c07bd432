"""Files that are there whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

__all__ = [
    "FileError",
    "WriteError",
    "make_folder",
    "read_text",
    "refuse_existing",
    "write_atomically",
]

_LONGEST_TEXT: Final = 10**8  # bytes; a drive's file has some 10^4, a device has no end


class FileError(ValueError):
    """A file that can't be read or written. The message is one line."""


class WriteError(FileError):
    """A file that can't be written; what stood there is untouched."""


def read_text(path: Path) -> str:
    """Text of a file in UTF-8, with or without a byte order mark.

    Raises FileNotFoundError where there is none, else FileError naming file and rule.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_LONGEST_TEXT + 1)
        if len(data) > _LONGEST_TEXT:
            raise FileError(f"{path}: longer than {_LONGEST_TEXT / 1e6:.0f} MB")
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except (FileNotFoundError, FileError):
        raise
    except UnicodeDecodeError:
        raise FileError(f"{path}: not a text file in UTF-8") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError:
        rule = "cannot be read: no file has the character NUL in its name"
        raise FileError(f"{str(path)!r}: {rule}") from None


def refuse_existing(path: Path, *, overwrite: bool) -> None:
    """Look before a long computation whether its result could be written to `path`.

    Raises WriteError when something is there that may not be replaced, or no folder to write in.
    """
    _refuse_special(path)
    if path.exists() and not overwrite:
        raise WriteError(
            f"{path}: exists already; choose another name, or say --overwrite (overwrite=True)"
        )
    folder = path.absolute().parent
    if not folder.is_dir():
        raise WriteError(f"{path}: cannot be written: there is no folder {folder}; make it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        rule = f"the folder {folder} may not be written to"
        raise WriteError(f"{path}: cannot be written: {rule}; choose another place")


def make_folder(path: Path) -> None:
    """Make a folder and those above it. Raises WriteError where that can't be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(f"{path}: no folder can be made here: {error.strerror}") from error


@contextmanager
def write_atomically(path: Path, *, flush: bool = True) -> Iterator[Path]:
    """Give a temporary path beside `path`; on success it takes the place of `path`.

    `flush` puts it on the disk first, so that not even a power cut leaves half of it there; without
    it that is left to who writes on.

    On any failure the temporary file is removed and what stood at `path` is untouched. Trouble
    with the disk (no permission, no space, no folder) is raised as WriteError.
    """
    temporary: Path | None = None
    try:
        _refuse_special(path)
        handle, name = tempfile.mkstemp(
            dir=path.parent, prefix=f".{path.name}.", suffix=path.suffix
        )
        os.close(handle)
        temporary = Path(name)
        yield temporary
        if flush:
            _flush(temporary)
        temporary.chmod(_mode(path))
        temporary.replace(path)
    except OSError as error:
        reason = error.strerror or str(error).splitlines()[0]
        raise WriteError(
            f"{path}: cannot be written: {reason}; nothing was changed there"
        ) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _refuse_special(path: Path) -> None:
    """A device or folder must not be replaced by a file, not even by root."""
    if path.exists() and not path.is_file():
        raise WriteError(f"{path}: cannot be written: not a regular file; name a file to write")


def _flush(path: Path) -> None:
    """Put the bytes on the disk before the name points at them."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _mode(path: Path) -> int:
    """Permissions of the file that is replaced, or those of a new file."""
    if path.exists():
        return path.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
