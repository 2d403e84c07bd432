"""Refused requests: a short body is taken in before the answer, a long one is left where it is."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from dualdrive.workbench.guard import Guard
from patience import PATIENCE


def refused(length: bytes | None, pieces: int, size: int = 1000) -> tuple[int, int]:
    """Status of a request without a token, and how many pieces of its body were taken in."""
    taken, sent = 0, list[dict[str, Any]]()

    async def app(*_: Any) -> None:
        raise AssertionError("it was passed on")

    async def receive() -> dict[str, Any]:
        nonlocal taken
        taken += 1
        return {"type": "http.request", "body": bytes(size), "more_body": taken < pieces}

    async def send(message: Any) -> None:
        sent.append(message)

    headers = [(b"host", b"127.0.0.1:1"), (b"origin", b"http://127.0.0.1:1")]
    if length is not None:
        headers.append((b"content-length", length))
    scope = {"type": "http", "method": "POST", "path": "/wrong/upload", "headers": headers}
    asyncio.run(Guard(app, token="right", port=1, policy="")(scope, receive, send))
    return sent[0]["status"], taken


@pytest.mark.parametrize(
    ("length", "pieces", "taken"),
    [
        (b"3000", 3, 3),
        (b"3000", 2, 2),  # it ends before what it told
        (b"1500", 9, 2),  # it goes on beyond
        (b"0", 1, 0),
        (None, 1, 0),
        (b"65536", 66, 66),
        (b"65537", 66, 0),
        (b"9" * 400, 1, 0),
        (b"-5", 1, 0),
        (b"5e3", 1, 0),
    ],
)
def test_a_short_body_is_taken_in(length: bytes | None, pieces: int, taken: int) -> None:
    assert refused(length, pieces) == (403, taken)


def test_a_client_that_hangs_up_is_not_waited_for() -> None:
    async def receive() -> dict[str, Any]:
        return {"type": "http.disconnect"}

    async def nothing(*_: Any) -> None:
        return None

    headers = [(b"host", b"elsewhere"), (b"content-length", b"100")]
    scope = {"type": "http", "method": "POST", "path": "/", "headers": headers}
    guard = Guard(nothing, token="right", port=1, policy="")
    asyncio.run(asyncio.wait_for(guard(scope, receive, nothing), PATIENCE))
