"""Files that are there whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import os
import secrets
import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Final

__all__ = [
    "FileError",
    "WriteError",
    "claim",
    "make_folder",
    "read_text",
    "refuse_existing",
    "refuse_replacing",
    "refuse_unwritable",
    "same_file",
    "target",
    "write_atomically",
]

_STOPS: Final = {signal.SIGINT, signal.SIGTERM}
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
    refuse_replacing(path, overwrite=overwrite)
    refuse_unwritable(path)


def refuse_replacing(path: Path, *, overwrite: bool) -> None:
    """Raise WriteError when something is there that may not be replaced."""
    try:
        _refuse_special(path)
    except OSError as error:  # a name too long
        raise _unwritable(path, error) from None
    if path.exists() and not overwrite:
        raise WriteError(
            f"{path}: exists already; choose another name, or say --overwrite (overwrite=True)"
        )


def refuse_unwritable(path: Path) -> None:
    """Raise WriteError when there is no folder to write `path` in."""
    folder = target(path).absolute().parent
    if not folder.is_dir():
        raise WriteError(f"{path}: cannot be written: there is no folder {folder}; make it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        rule = f"the folder {folder} may not be written to"
        raise WriteError(f"{path}: cannot be written: {rule}; choose another place")


def target(path: Path) -> Path:
    """The file that is written under this name: where a symbolic link leads, else `path` itself.

    Raises WriteError for a link that leads nowhere, or in a circle.
    """
    if not path.is_symlink():
        return path
    try:
        return Path(os.path.realpath(path, strict=True))
    except OSError as error:
        where = "in a circle" if error.errno == errno.ELOOP else f"to {path.readlink()}, not there"
        rule = f"a symbolic link that leads {where}"
        raise WriteError(f"{path}: cannot be written: {rule}; name a file") from None


def same_file(one: Path, other: Path) -> bool:
    """Whether two names, by links of either kind, mean one file, there already or not."""
    with suppress(OSError):  # a file that is not there, a name too long
        return one.samefile(other)
    return os.path.realpath(one) == os.path.realpath(other)


@contextmanager
def claim(path: Path) -> Iterator[None]:
    """Be the one program that computes what goes to this file or folder.

    Raises WriteError while another has it. The claim ends with the process, however it ends; the
    hidden file beside that bears it is taken away by whoever leaves in order.
    """
    place = target(path)
    bearer = place / ".lock" if place.is_dir() else place.with_name(f".{place.name}.lock")
    with _ctrl_c_later() as heard:
        file = _claimed(path, bearer)
        try:
            os.ftruncate(file, 0)
            os.write(file, f"{os.getpid()}\n".encode())
            with heard():
                yield
        finally:
            bearer.unlink(missing_ok=True)
            os.close(file)


@contextmanager
def _ctrl_c_later() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Ctrl-C and SIGTERM come when this is over, or where what it gives is entered."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)

    @contextmanager
    def heard() -> Iterator[None]:
        try:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_BLOCK, _STOPS)

    try:
        yield heard
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _claimed(path: Path, bearer: Path) -> int:
    """The open file that bears a claim."""
    while True:
        try:
            file = os.open(bearer, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError as error:
            raise _unwritable(path, error) from None
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(file, 20).decode(errors="replace").strip() or "?"
            os.close(file)
            rule = f"another dualdrive (process {owner}) is about to write it"
            raise WriteError(f"{path}: {rule}; wait for it, or name another file") from None
        except OSError:
            pass  # a file system that knows no locks
        with suppress(FileNotFoundError):  # taken away between the two calls: once more
            if os.fstat(file).st_ino == bearer.stat().st_ino:
                return file
        os.close(file)


def make_folder(path: Path) -> None:
    """Make a folder and those above it. Raises WriteError where that can't be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(f"{path}: no folder can be made here: {error.strerror}") from error


@contextmanager
def write_atomically(path: Path, *, overwrite: bool = True, flush: bool = True) -> Iterator[Path]:
    """Give a temporary path beside `path`; on success it takes the place of `path`.

    Where `path` is a symbolic link, the file it leads to is written. Without `overwrite` a file
    that has come to be there meanwhile stays. `flush` puts the content on the disk first, so that
    not even a power cut leaves half of it there; without it that is left to who writes on.

    On any failure the temporary file is removed and what stood at `path` is untouched. Trouble
    with the disk (no permission, no space, no folder) is raised as WriteError.
    """
    with _ctrl_c_later() as heard:
        temporary: Path | None = None  # named before it is there: no moment is without an owner
        try:
            _refuse_special(path)
            place = target(path)
            temporary = place.with_name(f".{place.name}.{secrets.token_hex(4)}{place.suffix}")
            os.close(os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))
            with heard():
                yield temporary
                if flush:
                    _flush(temporary)
            temporary.chmod(_mode(place))
            if overwrite:
                temporary.replace(place)
            else:
                _give_name(temporary, place)
        except OSError as error:
            raise _unwritable(path, error) from error
        finally:
            if temporary is not None:
                with suppress(OSError):  # it took its place, or never came to be
                    temporary.unlink()


def _give_name(temporary: Path, place: Path) -> None:
    """Let the file appear under its name, unless something has appeared there by now."""
    try:
        place.hardlink_to(temporary)
    except FileExistsError:
        raise WriteError(f"{place}: exists by now: another program made it; it stays") from None
    except OSError:  # a file system without hard links
        refuse_replacing(place, overwrite=False)
        temporary.replace(place)


def _unwritable(path: Path, error: OSError) -> WriteError:
    reason = error.strerror or str(error).splitlines()[0]
    return WriteError(f"{path}: cannot be written: {reason}; nothing was changed there")


def _refuse_special(path: Path) -> None:
    """A device or folder must not be replaced by a file, not even by root; nor a lost link."""
    if target(path).exists() and not path.is_file():
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
