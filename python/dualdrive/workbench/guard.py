"""Who may ask at all: this computer, this page, whoever has the token. Before anything is read.

The token is the first part of every address, for HTTP and WebSocket alike: no cookie that a browser
would send along for others, no header that a module import could not carry. Hosts are a fixed list,
so that a foreign name that resolves to this computer (DNS rebinding) is refused; whatever changes
something or opens a socket must name this page's own origin.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, Final

__all__ = ["HEADERS", "Guard", "new_token"]

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

_SAFE: Final = ("GET", "HEAD")
_LITTLE: Final = 65536  # bytes of a refused body that are still read
#: of every answer; nothing from elsewhere, nothing framed, nothing kept, nothing guessed
HEADERS: Final = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


def new_token() -> str:
    """256 random bits as they stand in an address."""
    return secrets.token_urlsafe(32)


class Guard:
    """ASGI middleware: passes on what holds the rules, with the token taken off the path."""

    def __init__(self, app: Any, *, token: str, port: int, policy: str) -> None:
        self.app, self._token = app, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._headers = {**HEADERS, "Content-Security-Policy": policy}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass on."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        status, why = self._refusal(scope)
        if status:
            await _read_little(scope, receive)
            await self._refuse(scope, send, status, why)
            return
        _, _, rest = scope["path"].removeprefix("/").partition("/")
        inner = {**scope, "path": f"/{rest}", "raw_path": None, "root_path": ""}
        await self.app(inner, receive, self._sealed(send))

    def _refusal(self, scope: Scope) -> tuple[int, str]:
        """Status and reason where this request is refused, else 0."""
        seen: dict[bytes, list[str]] = {}
        for name, value in scope["headers"]:
            seen.setdefault(name.lower(), []).append(value.decode("latin-1"))
        hosts, origins = seen.get(b"host", []), seen.get(b"origin", [])
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return 421, "this Host is not served: open the address that the terminal shows"
        socket = scope["type"] == "websocket"
        needed = socket or scope["method"] not in _SAFE
        if (origins or needed) and origins != [f"http://{hosts[0]}"]:
            return 403, "this Origin is not the workbench's own page"
        first, slash, _ = scope["path"].removeprefix("/").partition("/")
        if not hmac.compare_digest(first.encode(), self._token.encode()):
            return 403, "the token is missing or wrong: open the address that the terminal shows"
        if not slash:
            return 404, "the address ends in a slash"
        return 0, ""

    async def _refuse(self, scope: Scope, send: Send, status: int, why: str) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": why})  # answers 403
            return
        head = {"Content-Type": "text/plain; charset=utf-8", "Connection": "close", **self._headers}
        headers = [(k.encode(), v.encode()) for k, v in head.items()]
        await send({"type": "http.response.start", "status": status, "headers": headers})
        await send({"type": "http.response.body", "body": f"{why}\n".encode()})

    def _sealed(self, send: Send) -> Send:
        async def sealed(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                own = [(k.encode(), v.encode()) for k, v in self._headers.items()]
                message = {**message, "headers": [*message.get("headers", []), *own]}
            await send(message)

        return sealed


async def _read_little(scope: Scope, receive: Receive) -> None:
    """Take in a short body before the connection is closed.

    A client that is still sending would be told of a broken connection instead of the reason.
    """
    if scope["type"] != "http":
        return
    told = next((v for k, v in scope["headers"] if k.lower() == b"content-length"), b"0")
    if not told.isdigit() or len(told) > len(str(_LITTLE)) or int(told) > _LITTLE:
        return
    left = int(told)
    while left > 0:
        message = await receive()
        if message["type"] != "http.request":
            return
        left -= len(message.get("body", b""))
        if not message.get("more_body", False):
            return
