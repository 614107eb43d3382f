"""What every executor does: call one function for many tasks, and give the answers back in the order of the tasks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any, ClassVar, Self

from auvnn.errors import AuvnnError, one_line

# A task that has brought down this many workers is given up: it would bring down the next one too.
TRIES = 3
# Tasks handed in before their turn, for each worker: bounds what waits in memory.
AHEAD = 4


class Lost(AuvnnError):
    """A task brought down every worker that tried it."""

    def __init__(self, task: int, tries: int, why: str = "") -> None:
        """Say which one, and what it may have been."""
        super().__init__(task, tries, why)
        self.task, self.tries, self.why = task, tries, why

    def __str__(self) -> str:
        """Return the line for a person."""
        reason = f" ({one_line(self.why, 200)})" if self.why else ""
        return f"part {self.task + 1}: {self.tries} workers died over it{reason}: not enough memory? Take fewer workers"


class Executor(ABC):
    """Calls a function for each task, wherever its workers are; a context manager.

    A function must be importable by name, and what it is given and returns must be picklable. An error that it
    raises is raised here. A worker that dies is no error: what it had in hand is computed again by another, at most
    `TRIES` times, so that what is returned does not depend on who computed it.

    Args:
        workers: how many at a time.
        address: of a cluster that is running, where the executor can join one.
    """

    name: ClassVar[str]
    remote: ClassVar[bool] = False

    def __init__(self, workers: int = 1, address: str | None = None) -> None:
        """Keep the numbers; nothing is started yet."""
        self.workers, self.address = workers, address

    def __enter__(self) -> Self:
        """Start the workers."""
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let the workers go."""
        self.stop()

    def start(self) -> None:  # noqa: B027 - nothing to start is a fine answer
        """Start the workers."""

    def stop(self) -> None:  # noqa: B027
        """Let the workers go."""

    @abstractmethod
    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, tasks: Sequence[Any], *, losses: bool = False
    ) -> Iterator[Any]:
        """Yield `function(shared, task)` for each task, in the order of the tasks.

        Few answers are held at a time, however many tasks there are.

        Args:
            function: what to call.
            shared: first argument of every call.
            tasks: second argument, one for each call.
            losses: give back `Lost` in the place of the answer to a task that brought down `TRIES` workers.

        Raises:
            Lost: there is such a task, and `losses` is false.
        """


def handed_ahead(hand: Callable[[Any], Any], tasks: Sequence[Any], most: int) -> Iterator[tuple[int, Any]]:
    """Hand tasks to a cluster, at most so many at a time, and yield number and reference of each in their order.

    Args:
        hand: gives one task to the cluster and returns its reference.
        tasks: in their order.
        most: how many are under way at a time.
    """
    handed: deque[tuple[int, Any]] = deque()
    for number, task in enumerate(tasks):
        handed.append((number, hand(task)))
        if len(handed) >= most:
            yield handed.popleft()
    yield from handed


def in_order(finished: Iterator[tuple[int, Any]]) -> Iterator[Any]:
    """Yield numbered answers in the order of their numbers."""
    waiting: dict[int, Any] = {}
    wanted = 0
    for number, answer in finished:
        waiting[number] = answer
        while wanted in waiting:
            yield waiting.pop(wanted)
            wanted += 1
