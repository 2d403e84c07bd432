"""The server: addresses below the token, and what they do. One process, one thread, one project.

GET   /                 the page, and its files
GET   /state            everything the page shows but series and large results
GET   /view/<job>/<name>    a result
POST  /series           stretches of series, reduced to the screen, as numbers
POST  /values           the samples nearest to a time
POST  /do/<command>     what a person asks for
PUT   /upload/<name>    a recording, a mapping or a machine file
GET   /file/<name>      what is saved: machine, report, script, next experiment
WS    /live             tells every tab when something has changed
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import struct
import subprocess
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import numpy as np
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from dualdrive.files import FileError, make_folder
from dualdrive.machine import presets
from dualdrive.web import modules
from dualdrive.workbench import session
from dualdrive.workbench.commands import Commands, downloads
from dualdrive.workbench.guard import Guard, new_token
from dualdrive.workbench.limits import MOST_BODY, MOST_KEYS, MOST_WIDTH
from dualdrive.workbench.project import Project
from dualdrive.workbench.series import Store, nearest, reduced
from dualdrive.workbench.shown import shown
from dualdrive.workbench.story import Story
from dualdrive.workbench.uploads import receive

__all__ = ["run"]

_PERIOD: Final = 0.03  # s between looks at the jobs under way
_IDLE: Final = 1.0  # where there are none: whoever asks for something wakes the watch
#: what a request of nonsense, or a disk that is full, raises; told in words
_REFUSED: Final = (ValueError, LookupError, TypeError, OverflowError, OSError)


class Workbench:
    """A project and the tabs that look at it."""

    def __init__(self, project: Project) -> None:
        self.project = project
        self.story = Story(project)
        self.commands = Commands(self.story)
        self._tabs: set[asyncio.Event] = set()
        self._asked = asyncio.Event()
        self._stores: dict[str, Store] = {}

    # --- what goes on by itself -------------------------------------------------------------------

    async def watch(self) -> None:
        """Take results, begin what is missing, tell the tabs; until cancelled."""
        told: list[int] = []
        while True:
            if self.story.go_on():
                self.wake()
            count = [len(self.project.jobs[int(n)].events()) for n in self.project.open]
            if count != told:
                told = count
                self.wake()
            self._asked.clear()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._asked.wait(), _PERIOD if count else _IDLE)

    def wake(self) -> None:
        """Let every tab have the state as it is now."""
        self._asked.set()
        for tab in self._tabs:
            tab.set()

    async def live(self, ws: WebSocket) -> None:
        """Send the state now and after every change."""
        await ws.accept()
        changed = asyncio.Event()
        changed.set()
        self._tabs.add(changed)
        gone = asyncio.create_task(_gone(ws))
        try:
            while not gone.done():
                waiting = asyncio.create_task(changed.wait())
                await asyncio.wait({waiting, gone}, return_when=asyncio.FIRST_COMPLETED)
                waiting.cancel()
                if changed.is_set() and not gone.done():
                    changed.clear()
                    await ws.send_text(json.dumps(shown(self.story)))
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._tabs.discard(changed)
            gone.cancel()

    # --- what is asked for ------------------------------------------------------------------------

    async def page(self, request: Request) -> Response:
        """The page or one of its files."""
        name = request.path_params.get("name", "")
        try:
            body = modules.index() if not name else modules.read(name)
        except KeyError:
            return PlainTextResponse(f"{name}: no such file of the page\n", 404)
        return Response(body, media_type=modules.KINDS[Path(name or "x.html").suffix])

    async def state(self, request: Request) -> Response:
        """See :mod:`dualdrive.workbench.shown`."""
        return JSONResponse({**shown(self.story), "presets": presets()})

    async def view(self, request: Request) -> Response:
        """A result as its job wrote it."""
        job = self.project.jobs[request.path_params["job"]]
        path = job.folder / "view.json"
        if not path.is_file():
            return _refused(FileError("no such result; reload the page"), 404)
        return Response(path.read_bytes(), media_type="application/json")

    async def series(self, request: Request) -> Response:
        """Stretches of series: a head in JSON, then float64 numbers."""
        told = await _body(request)
        keys = [tuple(map(str, key)) for key in told["keys"]]
        pixels = int(told["pixels"])
        start, stop = float(told["start"]), float(told["stop"])
        if len(keys) > MOST_KEYS or not 1 <= pixels <= MOST_WIDTH or not start < stop:
            raise FileError("series: too many keys or pixels, or no stretch of time")
        head, numbers = [], list[np.ndarray[Any, Any]]()
        for (store, record), names in _grouped(keys).items():
            found = reduced(self.store(store), record, names, start, stop, pixels)
            head.append({"store": store, "record": record, "names": names, "count": len(found.t),
                         "exact": found.exact})  # fmt: skip
            numbers += [found.t, found.values.ravel()]
        text = json.dumps(head).encode()
        text += b" " * (-len(text) % 8)
        body = [struct.pack("<II", len(text), 0), text]
        body += [np.ascontiguousarray(a, dtype="<f8").tobytes() for a in numbers]
        return Response(b"".join(body), media_type="application/octet-stream")

    async def values(self, request: Request) -> Response:
        """The samples nearest to a time, as they were recorded or simulated."""
        told = await _body(request)
        found = []
        keys = [tuple(map(str, key)) for key in told["keys"][:MOST_KEYS]]
        for (store, record), names in _grouped(keys).items():
            t, values = nearest(self.store(store), record, names, float(told["at"]))
            found += [
                {"store": store, "record": record, "name": n, "t": t, "value": v}
                for n, v in zip(names, values.tolist(), strict=True)
            ]
        return JSONResponse(found)

    def store(self, name: str) -> Store:
        """A store of series: ``<job>/<name>``, where the names are few and the job a number."""
        if name not in self._stores:
            number, _, which = name.partition("/")
            if not number.isdecimal() or which not in ("series", "fit", "held_out"):
                raise FileError(f"{name[:40]}: no such series; reload the page")
            folder = self.project.jobs[int(number)].folder / which
            if not (folder / "series.json").is_file():
                raise FileError(f"{name}: no such series; reload the page")
            self._stores[name] = Store(folder)
        return self._stores[name]

    async def do(self, request: Request) -> Response:
        """A command; its refusal is told in words."""
        self.commands(request.path_params["command"], await _body(request))
        self.story.go_on()
        self.wake()
        return JSONResponse(shown(self.story))

    async def upload(self, request: Request) -> Response:
        """A file from the page."""
        await receive(self.story, request.path_params["name"], request)
        self.story.go_on()
        self.wake()
        return JSONResponse(shown(self.story))

    async def file(self, request: Request) -> Response:
        """What is saved."""
        name = request.path_params["name"]
        make = downloads(self.story).get(name)
        if make is None:
            return PlainTextResponse(f"{name}: nothing of that name is saved\n", 404)
        body = make()
        head = {"Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}"}
        return Response(body, media_type="application/octet-stream", headers=head)


async def _gone(ws: WebSocket) -> None:
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        while True:
            await ws.receive_text()


async def _body(request: Request) -> dict[str, Any]:
    """A JSON object of bounded length. Raises FileError."""
    held = bytearray()
    async for part in request.stream():
        held += part
        if len(held) > MOST_BODY:
            raise FileError(f"a request of more than {MOST_BODY} bytes")
    try:
        told = json.loads(held or b"{}")
    except (ValueError, RecursionError):
        raise FileError("the request is no JSON") from None
    if not isinstance(told, dict):
        raise FileError("the request is no JSON object")
    return told


def _grouped(keys: Sequence[tuple[str, ...]]) -> dict[tuple[str, str], list[str]]:
    groups: dict[tuple[str, str], list[str]] = {}
    for store, record, name in keys:
        groups.setdefault((store, record), []).append(name)
    return groups


def _refused(error: Exception, status: int = 400) -> Response:
    text = f"{error}: not there" if isinstance(error, LookupError) else str(error)
    return JSONResponse({"refused": " ".join(text.split())[:500]}, status)


async def _refusing(_: Request, error: Exception) -> Response:
    return _refused(error)


def application(bench: Workbench) -> Starlette:
    """The addresses of a workbench."""

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        watching = asyncio.create_task(bench.watch())
        yield
        watching.cancel()

    handlers: dict[Any, Any] = dict.fromkeys(_REFUSED, _refusing)
    return Starlette(
        routes=[
            Route("/", bench.page),
            Route("/state", bench.state),
            Route("/view/{job:int}", bench.view),
            Route("/series", bench.series, methods=["POST"]),
            Route("/values", bench.values, methods=["POST"]),
            Route("/do/{command}", bench.do, methods=["POST"]),
            Route("/upload/{name}", bench.upload, methods=["PUT"]),
            Route("/file/{name}", bench.file),
            WebSocketRoute("/live", bench.live),
            Route("/{name:path}", bench.page),
        ],
        lifespan=lifespan,
        exception_handlers=handlers,
    )


def run(
    folder: str | Path,
    machine: str | None = None,
    traces: Sequence[str | Path] = (),
    *,
    port: int = 0,
    ready: Callable[[str], None] | None = None,
    worker: subprocess.Popen[bytes] | None = None,
) -> None:
    """Serve a project; see :func:`dualdrive.workbench.serve`.

    worker: the process from which its jobs are forked, where one has begun
    """
    folder = Path(folder)
    make_folder(folder)
    with session.claimed(folder):
        project = Project(folder, worker)
        project.jobs.prepare()
        bench = Workbench(project)
        bench.commands.begin(machine, [Path(t) for t in traces])
        before = session.known(folder)
        token = before.get("token") or new_token()
        listening = session.listen(port or before.get("port", 0), given=bool(port))
        port = listening.getsockname()[1]
        session.keep(folder, {"token": token, "port": port})
        app = Guard(application(bench), token=token, port=port, policy=modules.policy())
        config = uvicorn.Config(
            app, log_level="error", access_log=False, server_header=False, lifespan="on",
            ws_max_size=MOST_BODY, timeout_graceful_shutdown=1, proxy_headers=False,
        )  # fmt: skip
        server = _Server(config, lambda: ready and ready(session.address(port, token)))
        try:
            with contextlib.suppress(KeyboardInterrupt):
                server.run(sockets=[listening])
        finally:
            project.jobs.close()
            project.save()
            session.forget(folder)


class _Server(uvicorn.Server):
    """Tells when it answers."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], object]) -> None:
        super().__init__(config)
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to answer, and say so."""
        await super().startup(sockets)
        self._ready()
