"""What is being done, how much of it is done, and how much is to come: words that carry their own count."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sized
from typing import Any, TypeVar

T = TypeVar("T")
# Steps that are still to come, at least, while work goes on whose number of steps can only be estimated beforehand.
AHEAD = 2


def silent(words: str) -> None:
    """Say nothing: for work whose progress somebody else tells.

    Args:
        words: what is being done.
    """


class Progress(str):
    """Words for `progress=`, with how many of how many equal steps are done.

    It is a plain string to whoever only prints it; who knows more can tell the time that is left.

    Attributes:
        done: steps done.
        total: steps in all.
        rough: whether `total` is known only roughly.
    """

    done: int
    total: int
    rough: bool

    def __new__(cls, words: Any, done: int, total: int, rough: bool = False) -> Progress:
        """Keep words and count."""
        found = super().__new__(cls, words)
        found.done, found.total, found.rough = done, total, rough
        return found


class Counted:
    """Tells what is being done with a count: each call begins a step, and all before it are done.

    How many steps a search takes shows only as it goes. `expected` is what such work usually takes; where it takes more,
    the total grows. Words that carry another count, of work inside a step, are shown with it and are no steps.

    Args:
        say: to whom.
        expected: steps in all.
        rough: whether there may be more or fewer.
    """

    def __init__(self, say: Callable[[str], Any] | None, expected: int, *, rough: bool = False) -> None:
        """Begin with no step done."""
        self._say, self._rough = say, rough
        self.done, self.total = -1, expected

    def __call__(self, words: str) -> None:
        """Begin the next step, or tell of work inside the step that has begun."""
        inside = isinstance(words, Progress)
        if not inside or self.done < 0:
            self.done += 1
        if self._rough:
            self.total = max(self.total, self.done + AHEAD)
        self.total = max(self.total, self.done + 1)
        if self._say is None:
            return
        if isinstance(words, Progress):
            words = f"{words}, {min(words.done + 1, words.total)} of {'about ' if words.rough else ''}{words.total}"
        self._say(Progress(words, self.done, self.total, self._rough))

    def more(self, steps: int) -> None:
        """Say that so many more steps have shown to be needed."""
        self.total += steps


def each(items: Iterable[T], say: Callable[[str], Any] | None, words: Callable[[T], str]) -> Iterator[T]:
    """Yield items, and tell of each one before it comes how many of them are done.

    Args:
        items: what is worked through; it knows its length.
        say: to whom.
        words: what to say about an item.
    """
    total = len(items) if isinstance(items, Sized) else 0
    for done, item in enumerate(items):
        if say is not None:
            say(Progress(words(item), done, total) if total else words(item))
        yield item
