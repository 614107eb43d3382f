"""How a verb speaks: plain lines, colour only for a person at a terminal, JSON alone when asked."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any, TextIO

from auvnn.errors import one_line

# Seconds between two lines of progress where nobody sits at a terminal.
NOW_AND_THEN = 30.0


class Speaker:
    """Says lines on standard output, or nothing but the answer when JSON is asked for."""

    def __init__(
        self, *, only_json: bool = False, verbose: bool = False, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Decide once whether there is anybody to talk to."""
        self.only_json = only_json
        self.verbose = verbose
        self._shown = False
        self._clock = clock
        self._began = self._spoken = clock()
        # Of what is counted: how many steps there are, how many were done when it was first heard of, and when.
        self._count: tuple[int, int, float] | None = None

    def __call__(self, text: str, style: str | None = None) -> None:
        """Say one line."""
        if self.only_json:
            return
        self._clear()
        self._spoken = self._clock()
        if sys.stdout.isatty():
            from rich.console import Console  # it knows NO_COLOR and dumb terminals

            Console(soft_wrap=True).print(text, style=style, markup=False, highlight=False)
        else:
            print(text, flush=True)

    def answer(self, data: dict[str, Any]) -> None:
        """Print the JSON answer if that is what was asked for."""
        if self.only_json:
            print(json.dumps(data, indent=1, allow_nan=False), flush=True)

    def progress(self, words: str) -> None:
        """Say on standard error what is being done, how far it is, and how long it has taken.

        At a terminal the next line replaces it. Redirected, there is a line now and then; with `verbose`, one each time.
        """
        if self.only_json:
            return
        now = self._clock()
        told = f"{one_line(words, 200)} ({self._times(words, now)})"
        if self.verbose:
            self._clear()
            print(f"progress  {told}", file=sys.stderr, flush=True)
        elif sys.stderr.isatty():
            print(f"\r\x1b[K{one_line(told, 100)}", end="", file=sys.stderr, flush=True)
            self._shown = True
        elif now - self._spoken >= NOW_AND_THEN:
            print(f"progress  {told}", file=sys.stderr, flush=True)
            self._spoken = now

    def _times(self, words: str, now: float) -> str:
        """Return the time since the start and, where the words carry a count, what is done and the time left."""
        gone = duration(now - self._began)
        done, total = getattr(words, "done", None), getattr(words, "total", None)
        if not isinstance(done, int) or not isinstance(total, int) or total < 1:
            return gone
        if self._count is None or self._count[0] != total or done < self._count[1]:
            self._count = (total, done, now)
        _, first, since = self._count
        out = f"{done} of {total} done, {gone}"
        if done > first:
            out += f", about {duration((now - since) / (done - first) * (total - done))} left"
        return out

    def _clear(self) -> None:
        if self._shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._shown = False


def duration(seconds: float) -> str:
    """Return a time as `42 s`, `3 min 05 s` or `1 h 02 min`."""
    whole = round(max(seconds, 0.0))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def complain(text: str, stream: TextIO | None = None) -> None:
    """Write one line to standard error."""
    print(one_line(text), file=stream or sys.stderr, flush=True)
