"""Files that are there whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["FileError", "WriteError", "refuse_existing", "write_atomically"]


class FileError(ValueError):
    """A file that can't be read or written. The message is one line."""


class WriteError(FileError):
    """A file that can't be written; what stood there is untouched."""


def refuse_existing(path: Path, *, overwrite: bool) -> None:
    """Raise FileError when `path` is there already and may not be replaced."""
    if path.exists() and not overwrite:
        raise WriteError(f"{path}: exists already; choose another name, or allow overwriting it")


@contextmanager
def write_atomically(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; on success it takes the place of `path`.

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
        _flush(temporary)
        temporary.chmod(_mode(path))
        temporary.replace(path)
    except OSError as error:
        reason = error.strerror or str(error).splitlines()[0]
        raise FileError(
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
