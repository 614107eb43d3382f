"""Start the server, say its address, and end it so that nothing stays behind."""

from __future__ import annotations

import contextlib
import secrets
import socket
import tempfile
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from auvnn.answers import Answer
from auvnn.app.session import Session
from auvnn.app.source import Source
from auvnn.errors import ConfigError, InputError, MissingExtra


class Served(Answer):
    """What a session of the page left: the folders that the user saved into."""

    kind = "app"

    def __init__(self, saved: Sequence[str]) -> None:
        self.saved = list(saved)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        return {"schema": "auvnn/app/1", "saved": self.saved}


def serve(
    out: Path,
    *,
    model: str | None = None,
    log: Sequence[Path] = (),
    mapping: dict[str, Any] | None = None,
    test: Sequence[Path] = (),
    max_duration: float | None = None,
    port: int = 0,
    browser: bool = True,
    say: Callable[[str], None] = print,
) -> Served:
    """Serve the page on this machine until interrupted.

    Args:
        out: folder that is proposed for saving; nothing is written there before the user asks.
        model: name or path of the model to begin with.
        log: files of the log to begin with.
        mapping: how their columns are named.
        test: files that are held out.
        max_duration: s, of each file.
        port: on which to listen; 0 for any that is free.
        browser: open the page in the user's browser.
        say: called with the address.

    Raises:
        MissingExtra: Starlette or uvicorn is not installed.
        InputError: the port is taken.
        AuvnnError: the model cannot be loaded.
    """
    try:
        import uvicorn

        from auvnn.app.guard import Guard
        from auvnn.app.web import Pages
    except ModuleNotFoundError as missing:
        if missing.name and missing.name.split(".")[0] in ("starlette", "uvicorn", "anyio"):
            raise MissingExtra(missing.name.split(".")[0], "app", "the page") from None
        raise
    if not 0 <= port < 65536:
        raise ConfigError(f"port={port}: choose from 0 (any that is free) to 65535")
    with contextlib.ExitStack() as stack:
        work = Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix="auvnn-app-", ignore_cleanup_errors=True))
        )
        session = Session(work, out, model)
        stack.callback(session.close)
        if log:
            session.open(Source(list(log), mapping or {}, max_duration, list(test)))
        listening = stack.enter_context(_bound(port))
        number = listening.getsockname()[1]
        token = secrets.token_urlsafe(24)
        guarded = Guard(Pages(session).app(), token, number)
        config = uvicorn.Config(
            guarded, log_level="error", access_log=False, lifespan="off", server_header=False, ws="none",
            timeout_graceful_shutdown=2, proxy_headers=False,
        )  # fmt: skip
        address = f"http://127.0.0.1:{number}/{token}/"
        say(f"page      {address}")
        if browser:
            with contextlib.suppress(Exception):
                webbrowser.open(address)
        # Ctrl-C is how it ends: uvicorn closes its connections first and hands the interrupt on.
        with contextlib.suppress(KeyboardInterrupt):
            uvicorn.Server(config).run(sockets=[listening])
        return Served(session.saved)


def _bound(port: int) -> socket.socket:
    """Return a socket on the loopback address that listens soon.

    Raises:
        InputError: the port is taken.
    """
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(("127.0.0.1", port))
    except OSError as problem:
        listening.close()
        raise InputError(
            f"port={port}: cannot be used ({problem.strerror}); choose another, or leave it out"
        ) from None
    return listening
