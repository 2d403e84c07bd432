"""A server's session: the project it alone serves, its socket, its token and port.

Token and port lie in a file of the project while a server runs, so that the tabs of one that was
killed find the next one, and whoever starts a second one is told where the first is.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from dualdrive.files import FileError, WriteError, claim

__all__ = ["address", "claimed", "forget", "keep", "known", "listen"]

_FILE: Final = ".session"


@contextlib.contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Be the project's one server; where there is one already, WriteError says at what address."""
    with contextlib.ExitStack() as held:
        try:
            held.enter_context(claim(folder))
        except WriteError as error:
            if not (other := known(folder)):
                raise
            where = address(other["port"], other["token"])
            raise WriteError(f"{folder}: a workbench shows it already, at {where}") from error
        yield


def address(port: int, token: str) -> str:
    """Of the page."""
    return f"http://127.0.0.1:{port}/{token}/"


def listen(port: int, *, given: bool) -> socket.socket:
    """A socket of the loopback interface alone; another port where an old one is taken."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind(("127.0.0.1", port))
    except OSError as error:
        if given:
            listening.close()
            raise FileError(f"--port {port}: {error.strerror}; name another, or none") from None
        listening.bind(("127.0.0.1", 0))
    return listening


def known(folder: Path) -> dict[str, Any]:
    """Token and port of the server that runs, or was killed; empty where there is none."""
    try:
        told = json.loads((folder / _FILE).read_text("ascii"))
        if (folder / _FILE).stat().st_mode & 0o077 or not told["token"].isascii():
            return {}
        return {"token": str(told["token"]), "port": int(told["port"])}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def keep(folder: Path, told: dict[str, Any]) -> None:
    """For its owner alone; gone when the server ends in order."""
    handle = os.open(folder / _FILE, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(handle, "w") as file:
        file.write(json.dumps(told))


def forget(folder: Path) -> None:
    """Of a server that ends in order: its token is void."""
    (folder / _FILE).unlink(missing_ok=True)
