"""How many threads numerical libraries may use, and for how long that holds.

What this package computes goes through many small arrays: a second thread gains next to nothing there, and on a machine
that others use too it costs a great deal, because threads wait for one another by spinning. So the calls of the public
interface run on one thread, and give back whatever setting they found. Large work is spread over processes (`workers=`).
Whoever sets OMP_NUM_THREADS has decided: nothing is changed then.

What is independent and small, such as the fits of several effects beside a stochastic force, may run side by side on
threads of its own (`side_by_side`): tensor operations leave the interpreter free for one another. Processes of ours that
work beside others say so with `beside_others`, and then nothing runs side by side in them.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
Item = TypeVar("Item")
# Threads side by side at most: each holds the arrays of a fit.
MOST = 4
# Read by the OpenMP runtimes when they are loaded: threads that have nothing to do sleep instead of spinning.
SLEEP = {"OMP_WAIT_POLICY": "PASSIVE", "KMP_BLOCKTIME": "0", "GOMP_SPINCOUNT": "0"}


def decided(environment: Mapping[str, str] | None = None) -> bool:
    """Whether the user has said how many threads there shall be."""
    return bool((os.environ if environment is None else environment).get("OMP_NUM_THREADS"))


def sleep_when_idle(environment: MutableMapping[str, str] | None = None) -> None:
    """Ask threads to sleep while they wait; to be called before a numerical library is loaded."""
    environment = os.environ if environment is None else environment
    for name, value in SLEEP.items():
        environment.setdefault(name, value)


@contextmanager
def one_thread() -> Iterator[None]:
    """Compute on one thread, and restore what was set before, also after an error."""
    if decided():
        yield
        return
    import torch
    from threadpoolctl import threadpool_limits

    before = torch.get_num_threads()
    # Of torch itself, and of the linear algebra of numpy and scipy, which have separate pools.
    with threadpool_limits(limits=1):
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(before)


def on_one_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Return the function as one that runs within `one_thread`."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        with one_thread():
            return function(*args, **kwargs)

    return call


class _Place:
    """Whether other processes of ours compute on the same machine."""

    shared = False


def beside_others() -> None:
    """Compute on one thread from here on, and nothing side by side: other processes of ours work at the same time."""
    import torch

    torch.set_num_threads(1)
    _Place.shared = True


def processors(environment: Mapping[str, str] | None = None) -> int:
    """Return how many threads may compute side by side, at least one."""
    if _Place.shared:
        return 1
    if decided(environment):
        told = (os.environ if environment is None else environment)["OMP_NUM_THREADS"].split(",")[0].strip()
        return min(int(told), MOST) if told.isdigit() and int(told) > 0 else 1
    known = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(known, MOST)


def side_by_side(function: Callable[[Item], T], items: Iterable[Item]) -> list[T]:
    """Return what a function makes of each item, in order, on several threads where the machine has them.

    The items must be independent: what comes out is the same on one thread. An error of the first item that has one is
    raised, once those that have begun are done; those that have not begun are left.

    Args:
        function: of one item.
        items: to be worked on.
    """
    items = list(items)
    threads = min(processors(), len(items))
    if threads < 2:
        return [function(item) for item in items]
    import torch

    differentiates = torch.is_grad_enabled()

    def one(item: Item) -> T:
        with torch.set_grad_enabled(differentiates):
            return function(item)

    with ThreadPoolExecutor(threads, thread_name_prefix="auvnn") as pool:
        # What is set for a time (numpy's handling of errors, for one) holds in the threads too.
        asked = [pool.submit(copy_context().run, one, item) for item in items]
        try:
            return [each.result() for each in asked]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
