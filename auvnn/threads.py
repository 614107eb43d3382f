"""How many threads numerical libraries may use, and for how long that holds.

What this package computes goes through many small arrays: a second thread gains next to nothing there, and on a machine
that others use too it costs a great deal, because threads wait for one another by spinning. So the calls of the public
interface run on one thread, and give back whatever setting they found. Large work is spread over processes (`workers=`).
Whoever sets OMP_NUM_THREADS has decided: nothing is changed then.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
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
