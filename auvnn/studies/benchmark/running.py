"""Many logs on several processes: rows come as they are done, and no log's end is the end of the others."""

from __future__ import annotations

import itertools
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any

from auvnn.studies.benchmark.cases import Case

# How often a log may take its process with it before that is its outcome.
DEATHS = 2
DEAD = "its process died, and again when it ran alone: too little memory?"

Runner = Callable[[Case], dict[str, Any]]


def run_all(todo: Sequence[Case], workers: int, run: Runner) -> Iterator[dict[str, Any]]:
    """Yield a row for each case as it is done, in whatever order.

    A process that dies, for lack of memory perhaps, takes the logs that were under way with it. They are tried
    again; whoever has died twice runs alone, and a log that dies alone is a row with that fault.

    Args:
        todo: the logs.
        workers: processes.
        run: makes the row of a case.
    """
    if workers <= 1 or len(todo) <= 1:
        yield from map(run, todo)
        return
    deaths: dict[Case, int] = {}
    waiting = list(todo)
    while waiting:
        batch = [case for case in waiting if deaths.get(case, 0) < DEATHS]
        alone = not batch
        done: set[Case] = set()
        died: list[Case] = []
        for case, row in _pool(
            waiting[:1] if alone else batch, 1 if alone else min(workers, len(batch)), run
        ):
            if row is None:
                died.append(case)
            else:
                done.add(case)
                yield row
        for case in died:
            deaths[case] = deaths.get(case, 0) + 1
            if alone:
                done.add(case)
                yield {**case.to_row(), "verdict": "fault", "missing": [], "fault": DEAD, "seconds": None}
        waiting = [case for case in waiting if case not in done]


def _pool(batch: Sequence[Case], size: int, run: Runner) -> Iterator[tuple[Case, dict[str, Any] | None]]:
    """Yield case and row until all are done or a process dies; None for a case that was under way then."""
    before = set(multiprocessing.active_children())
    # Spawned, not forked: torch's threads do not survive a fork.
    pool = ProcessPoolExecutor(size, mp_context=get_context("spawn"))
    under_way: dict[Future, Case] = {}
    rest = iter(batch)
    broken = False
    try:
        while not broken:
            # Handed out as places fall free, not all at once: what was not begun cannot have died.
            for case in itertools.islice(rest, size - len(under_way)):
                try:
                    under_way[pool.submit(run, case)] = case
                except BrokenProcessPool:
                    broken = True
                    yield case, None
                    break
            if not under_way:
                break
            finished, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in finished:
                case = under_way.pop(future)
                broken = broken or isinstance(future.exception(), BrokenProcessPool)
                yield case, None if isinstance(future.exception(), BrokenProcessPool) else future.result()
        for case in under_way.values():
            yield case, None
        pool.shutdown()
    except BaseException:
        # Whoever ends this does not want to wait for logs whose rows nobody will read.
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - before:
            process.terminate()
        raise
