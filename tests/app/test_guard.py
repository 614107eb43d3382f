"""Only this machine, only the page itself, only with the token."""

from __future__ import annotations

import pytest

pytest.importorskip("starlette", reason="the page's server is not installed: pip install 'auvnn[app]'")

from starlette.responses import PlainTextResponse

from auvnn.app.guard import Guard
from tests.app.asking import ask

TOKEN = "a-token"
OWN = "http://127.0.0.1:8000"


@pytest.fixture(scope="module")
def guarded():
    return Guard(PlainTextResponse("inside"), TOKEN, 8000)


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        (f"/{TOKEN}/", {}, 200),
        (f"/{TOKEN}/api/state", {"host": "localhost:8000"}, 200),
        (f"/{TOKEN}/", {"origin": OWN, "sec-fetch-site": "same-origin"}, 200),
        (f"/{TOKEN}", {}, 307),
        ("/", {}, 403),
        ("/a-toke/", {}, 403),
        ("/a-token-and-more/", {}, 403),
        ("/A-TOKEN/", {}, 403),
        # A stranger's name that leads to the loopback address, other ports, and no name at all.
        (f"/{TOKEN}/", {"host": "evil.example:8000"}, 403),
        (f"/{TOKEN}/", {"host": "127.0.0.1"}, 403),
        (f"/{TOKEN}/", {"host": "127.0.0.1:8001"}, 403),
        (f"/{TOKEN}/", {"host": ""}, 403),
        (f"/{TOKEN}/", {"origin": "http://evil.example"}, 403),
        (f"/{TOKEN}/", {"origin": "http://127.0.0.1:8001"}, 403),
        (f"/{TOKEN}/", {"origin": "https://127.0.0.1:8000"}, 403),
        (f"/{TOKEN}/", {"origin": "null"}, 403),
        (f"/{TOKEN}/", {"sec-fetch-site": "cross-site"}, 403),
        (f"/{TOKEN}/", {"sec-fetch-site": "same-site"}, 403),
    ],
)
def test_who_is_let_in(guarded, path, headers, status):
    got, answered, body = ask(guarded, path, headers=headers)
    assert got == status
    assert (body == b"inside") == (status == 200)
    assert answered["x-content-type-options"] == "nosniff" and answered["referrer-policy"] == "no-referrer"
    assert "default-src 'none'" in answered["content-security-policy"]
    assert "unsafe" not in answered["content-security-policy"]


def test_nobody_speaks_by_another_protocol(guarded):
    import asyncio

    told = []

    async def send(message):
        told.append(message)

    asyncio.run(guarded({"type": "websocket", "path": f"/{TOKEN}/", "headers": []}, None, send))
    assert told == []
