"""How a verb speaks: plain lines, colour only for a person at a terminal, JSON alone when asked."""

from __future__ import annotations

import json
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from auvnn.errors import one_line

# Seconds between two lines of progress where nobody sits at a terminal.
NOW_AND_THEN = 30.0
# Seconds of silence after which a person at a terminal is informed that work goes on, and between two such signs.
SILENT, SIGN = 2.0, 1.0


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
        self._doing: str = "working"
        self._lock = threading.RLock()
        # Of what is counted: how many steps there are, how many were done when it was first heard of and when, how many
        # are done and since when.
        self._count: tuple[int, int, float, int, float] | None = None

    def __call__(self, text: str, style: str | None = None) -> None:
        """Say one line."""
        if self.only_json:
            return
        with self._lock:
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
        with self._lock:
            now = self._clock()
            self._doing = words
            told = f"{one_line(words, 200)} ({self._times(words, now)})"
            if self.verbose:
                self._clear()
                print(f"progress  {told}", file=sys.stderr, flush=True)
                self._spoken = now
            elif sys.stderr.isatty():
                self._draw(words, self._times(words, now))
                self._spoken = now
            elif now - self._spoken >= NOW_AND_THEN:
                print(f"progress  {told}", file=sys.stderr, flush=True)
                self._spoken = now

    @contextmanager
    def ticking(self, words: str) -> Iterator[None]:
        """Give signs of life while something runs that tells nothing for a while.

        At a terminal the line with what is being done is drawn again each second, time passing; redirected, it is said
        again now and then.

        Args:
            words: what is being done, until somebody says more.
        """
        if self.only_json:
            yield
            return
        self._doing = words
        stop = threading.Event()

        def tick() -> None:
            while not stop.wait(SIGN):
                self.sign()

        thread = threading.Thread(target=tick, name="auvnn-progress", daemon=True)
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()
            with self._lock:
                self._clear()

    def sign(self) -> None:
        """Say that the same is still being done, if nothing has been said for long enough."""
        with self._lock:
            now = self._clock()
            alone = sys.stderr.isatty() and not self.verbose
            if now - self._spoken < (
                SILENT if alone and not self._shown else SIGN if alone else NOW_AND_THEN
            ):
                return
            if alone:
                self._draw(self._doing, self._times(self._doing, now))
            else:
                print(
                    f"progress  {one_line(self._doing, 200)} ({self._times(self._doing, now)})",
                    file=sys.stderr,
                    flush=True,
                )
            self._spoken = now

    def _draw(self, words: str, times: str) -> None:
        """Put words and times into the terminal's last line; what is too long is cut, not the times."""
        room = max(shutil.get_terminal_size((100, 24)).columns - len(times) - 4, 20)
        print(f"\r\x1b[K{one_line(words, min(room, 100))} ({times})", end="", file=sys.stderr, flush=True)
        self._shown = True

    def _times(self, words: str, now: float) -> str:
        """Return the time since the start and, where the words carry a count, what is done and the time left."""
        gone = duration(now - self._began)
        done, total = getattr(words, "done", None), getattr(words, "total", None)
        if not isinstance(done, int) or not isinstance(total, int) or total < 1:
            return gone
        # Fewer steps done than before, or fewer in all: this is other work, whose time is counted again.
        if self._count is None or total < self._count[0] or done < self._count[3]:
            self._count = (total, done, now, done, now)
        _, first, since, before, reached = self._count
        self._count = (total, first, since, done, now if done > before else reached)
        about = "about " if getattr(words, "rough", False) else ""
        out = f"{done} of {about}{total} done, {gone}"
        if done > first:
            # What the step in hand has taken so far is no longer to come.
            one = (self._count[4] - since) / (done - first)
            left = max(one * (total - done) - (now - self._count[4]), 0.0)
            out += f", about {duration(left)} left"
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
