"""A Dask scheduler and workers, each a process of its own, on this computer alone."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Self

from patience import PATIENCE

#: nothing to look at, nothing that samples what the workers do
QUIET = {
    "DASK_DISTRIBUTED__DASHBOARD__LINK": "",
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
}


class Cluster:
    """Ends with the block; `workers` and `scheduler` are there to be killed."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.workers = folder, list[subprocess.Popen[bytes]]()
        file = folder / "scheduler.json"
        self.scheduler = self._begin("scheduler", "--port", "0", "--scheduler-file", str(file))
        self.address = self._address(file)

    def _address(self, file: Path) -> str:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if file.exists() and (text := file.read_text()).strip().endswith("}"):
                return str(json.loads(text)["address"])
            time.sleep(0.05)
        raise TimeoutError((self.folder / "scheduler.log").read_text())

    def grow(self, count: int = 1, preload: str = "") -> Self:
        """Begin workers of one thread and wait for them; preload: code that they run first."""
        own = ["--nthreads", "1", "--no-nanny", "--local-directory", str(self.folder)]
        if preload:
            (self.folder / "preload.py").write_text(preload)
            own += ["--preload", str(self.folder / "preload.py")]
        for _ in range(count):
            self.workers.append(self._begin("worker", self.address, *own))
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(len(self.workers), timeout=PATIENCE)
        return self

    def _begin(self, what: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", what, *words, "--host", "127.0.0.1"]
        with (self.folder / f"{what}.log").open("ab") as log:
            return subprocess.Popen(
                [*command, "--no-dashboard"],
                stdout=log,
                stderr=log,
                cwd=self.folder,
                env={**os.environ, **QUIET},
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.wait()
