"""What is being done, how much of it is done, and how much is to come: words that carry their own count."""

from __future__ import annotations

from typing import Any


class Progress(str):
    """Words for `progress=`, with how many of how many equal steps are done.

    It is a plain string to whoever only prints it; who knows more can tell the time that is left.

    Attributes:
        done: steps done.
        total: steps in all.
    """

    done: int
    total: int

    def __new__(cls, words: Any, done: int, total: int) -> Progress:
        """Keep words and count."""
        found = super().__new__(cls, words)
        found.done, found.total = done, total
        return found
