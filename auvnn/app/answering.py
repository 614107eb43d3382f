"""From what the page asks to what it gets: JSON both ways, and one line where something is wrong."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from auvnn.answers import plain
from auvnn.errors import AuvnnError, ConfigError, one_line

Asked = dict[str, Any]


def answering(call: Callable[[Asked], Any]) -> Callable[[Request], Any]:
    """Turn a function of what was asked into an address; what the user gave wrong is one line with status 400."""

    async def answer(request: Request) -> Response:
        asked: Asked = dict(request.query_params)
        if request.method == "POST":
            try:
                body = await request.json()
            except (json.JSONDecodeError, UnicodeDecodeError):
                return refused("what was sent is not JSON")
            if not isinstance(body, dict):
                return refused("what was sent is not an object")
            asked = body
        return await run_in_threadpool(said, call, asked)

    return answer


def said(call: Callable[[Asked], Any], asked: Asked) -> Response:
    """Return what a call answers, or in one line why it cannot."""
    try:
        return JSONResponse(plain(call(asked)))
    except AuvnnError as error:
        return refused(one_line(error, 2000))
    except (ValueError, TypeError, KeyError) as error:
        if os.environ.get("AUVNN_DEBUG") == "1":
            raise
        return refused(
            f"a fault of the program, not of your input ({type(error).__name__}: {one_line(error, 300)})", 500
        )


def refused(words: str, status: int = 400) -> Response:
    """Return a refusal in one line."""
    return JSONResponse({"error": words}, status)


def span(asked: Asked) -> tuple[int | None, float | None, float | None, int]:
    """Return run, begin and end in s, and how many points, as asked for."""

    def number(key: str) -> float | None:
        value = asked.get(key)
        if value is None or value == "":
            return None
        try:
            return float(value)
        except (TypeError, ValueError):
            raise ConfigError(f"{key}={value} is no number") from None

    run, points = number("run"), number("points")
    return (
        None if run is None else int(run),
        number("from"),
        number("to"),
        int(min(max(points or 1600, 16), 8000)),
    )
