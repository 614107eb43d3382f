"""Processes on this machine, each with one thread, that may die without harm.

A worker is a fresh interpreter at the other end of a socket. It gets the function and what all tasks share once,
then one task at a time. When its socket closes it is dead, killed by the system for lack of memory perhaps: its task
goes back to the front of the queue and a new worker takes its place. The pools of the standard library do not go on
after a death, which is why this one is here.
"""

from __future__ import annotations

import contextlib
import subprocess
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from typing import Any

from auvnn.executors.base import AHEAD, TRIES, Executor, Lost, in_order
from auvnn.executors.packing import pack
from auvnn.executors.safe_path import environment, python


class _Worker:
    """One process, and the task that it has in hand."""

    def __init__(self) -> None:
        self.end, other = Pipe()
        own = environment()
        # Several processes with several threads each would be in one another's way.
        own.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1", POLARS_MAX_THREADS="1")
        self.process = subprocess.Popen(
            python("auvnn.executors.worker", str(other.fileno())),
            pass_fds=[other.fileno()],
            env=own,
            stdin=subprocess.DEVNULL,
        )
        other.close()
        self.task: int | None = None
        self.knows: int | None = None

    def give(self, job: int, common: bytes, number: int, task: Any) -> None:
        """Send a task, before it what all tasks of the job share."""
        self.task = number
        if self.knows != job:
            self.end.send_bytes(common)
            self.knows = job
        self.end.send_bytes(pack(("task", task)))

    def close(self) -> None:
        """End the process, whatever it is doing."""
        with contextlib.suppress(OSError):
            self.end.close()
        self.process.kill()
        self.process.wait()


class Processes(Executor):
    """Own processes on this machine."""

    name = "processes"

    def __init__(self, workers: int = 1, address: str | None = None) -> None:
        super().__init__(workers, address)
        self._workers: list[_Worker] = []
        self._jobs = 0
        self.deaths = 0

    def stop(self) -> None:
        """End all workers."""
        for worker in self._workers:
            worker.close()
        self._workers = []

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, tasks: Sequence[Any], *, losses: bool = False
    ) -> Iterator[Any]:
        """Yield the answers in the order of the tasks.

        Raises:
            Lost: a task brought down three workers, and `losses` is false.
        """
        return in_order(self._finished(function, shared, tasks, losses))

    def _finished(
        self, function: Callable[[Any, Any], Any], shared: Any, tasks: Sequence[Any], losses: bool
    ) -> Iterator[tuple[int, Any]]:
        self._jobs += 1
        common = pack(("job", function, shared))
        queue, tries = deque(range(len(tasks))), [0] * len(tasks)
        done, oldest = set[int](), 0
        try:
            while oldest < len(tasks):
                self._hire(min(self.workers, len(tasks) - len(done)))
                for worker in [w for w in self._workers if w.task is None]:
                    # Whoever is far ahead waits for the slowest: else answers would pile up.
                    if queue and queue[0] < oldest + AHEAD * self.workers:
                        number = queue.popleft()
                        # A worker that is dead already is seen by its closed socket below.
                        with contextlib.suppress(OSError):
                            worker.give(self._jobs, common, number, tasks[number])
                        worker.task = number
                busy: dict[Any, _Worker] = {w.end: w for w in self._workers if w.task is not None}
                for end in wait(list(busy)):
                    worker = busy[end]
                    number = worker.task
                    assert number is not None  # it is among the busy ones
                    answer = _received(worker.end)
                    if answer is None:
                        self._bury(worker)
                        tries[number] += 1
                        if tries[number] < TRIES:
                            queue.appendleft(number)
                            continue
                        if not losses:
                            raise Lost(number, TRIES)
                        answer = ("value", Lost(number, TRIES))
                    worker.task = None
                    kind, value = answer
                    if kind == "error":
                        raise value
                    done.add(number)
                    while oldest in done:
                        oldest += 1
                    yield number, value
        finally:
            # What is still in hand belongs to a job that nobody waits for.
            for worker in [w for w in self._workers if w.task is not None]:
                self._bury(worker)

    def _hire(self, wanted: int) -> None:
        while len(self._workers) < wanted:
            self._workers.append(_Worker())

    def _bury(self, worker: _Worker) -> None:
        worker.close()
        self._workers.remove(worker)
        self.deaths += 1


def _received(end: Connection) -> tuple[str, Any] | None:
    """Return a worker's answer, None where there is none any more."""
    import pickle

    try:
        return pickle.loads(end.recv_bytes())
    except (EOFError, OSError):
        return None
