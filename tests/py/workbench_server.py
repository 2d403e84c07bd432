"""A workbench under test: the real command in a process of its own, and a client that may lie."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from patience import PATIENCE


@dataclass
class Answer:
    """What the server said."""

    status: int
    text: str
    headers: Mapping[str, str]

    @property
    def json(self) -> Any:
        return json.loads(self.text)


class Running:
    """A server and a plain client of it."""

    def __init__(self, project: Path, *arguments: str | Path) -> None:
        self.project = project
        told = project.parent / f"{project.name}-address.json"
        told.unlink(missing_ok=True)
        command = ["-m", "dualdrive_cli", "workbench", *map(str, arguments)]
        options = ["--project", str(project), "--no-browser", "--json", str(told)]
        self.process = subprocess.Popen(
            [sys.executable, *command, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        wait_for(lambda: told.exists() or self.process.poll() is not None)
        if not told.exists():
            raise AssertionError(self.process.communicate()[0])
        self.address = str(json.loads(told.read_text())["address"])
        parts = urlsplit(self.address)
        assert parts.port is not None
        self.port, self.path = parts.port, parts.path
        self.token = parts.path.strip("/")
        self.origin = f"http://127.0.0.1:{self.port}"

    def ask(
        self,
        method: str,
        where: str,
        body: bytes | str | None = None,
        *,
        host: str | None = None,
        origin: str | None = "own",
        raw: bool = False,
    ) -> Answer:
        """One request; `where` is below the token unless raw."""
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        headers = {"Host": host or f"127.0.0.1:{self.port}"}
        if origin is not None:
            headers["Origin"] = self.origin if origin == "own" else origin
        try:
            link.request(method, where if raw else self.path + where, body=body, headers=headers)
            answer = link.getresponse()
            text = answer.read().decode("utf-8", "replace")
            return Answer(answer.status, text, dict(answer.getheaders()))
        finally:
            link.close()

    def do(self, command: str, **told: Any) -> Answer:
        return self.ask("POST", f"do/{command}", json.dumps(told))

    @property
    def state(self) -> dict[str, Any]:
        found: dict[str, Any] = self.ask("GET", "state").json
        return found

    def end(self, how: signal.Signals = signal.SIGTERM) -> None:
        if self.process.poll() is None:
            os.kill(self.process.pid, how)
        self.process.communicate(timeout=PATIENCE)


@contextmanager
def running(project: Path, *arguments: str | Path) -> Iterator[Running]:
    server = Running(project, *arguments)
    try:
        yield server
    finally:
        server.end()


def wait_for(holds: Any) -> None:
    """Until something holds; AssertionError where it does not."""
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, f"not within {PATIENCE:g} s"
        time.sleep(0.05)
