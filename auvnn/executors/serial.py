"""One task after the other, in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from auvnn.executors.base import Executor


class Serial(Executor):
    """No workers at all: this process does everything."""

    name = "serial"

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, tasks: Sequence[Any], *, losses: bool = False
    ) -> Iterator[Any]:
        """Yield the answers in the order of the tasks."""
        for task in tasks:
            yield function(shared, task)


# For work that nobody has given workers.
SERIAL = Serial()
