"""How a verb speaks: plain lines, colour only for a person at a terminal, JSON alone when asked."""

from __future__ import annotations

import json
import sys
from typing import Any, TextIO

from auvnn.errors import one_line


class Speaker:
    """Says lines on standard output, or nothing but the answer when JSON is asked for."""

    def __init__(self, *, only_json: bool = False) -> None:
        """Decide once whether there is anybody to talk to."""
        self.only_json = only_json
        self._shown = False

    def __call__(self, text: str, style: str | None = None) -> None:
        """Say one line."""
        if self.only_json:
            return
        self._clear()
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
        """Show what is being done to a person at a terminal, on standard error; the next line replaces it."""
        if sys.stderr.isatty() and not self.only_json:
            print(f"\r\x1b[K{one_line(words, 78)}", end="", file=sys.stderr, flush=True)
            self._shown = True

    def _clear(self) -> None:
        if self._shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._shown = False


def complain(text: str, stream: TextIO | None = None) -> None:
    """Write one line to standard error."""
    print(one_line(text), file=stream or sys.stderr, flush=True)
