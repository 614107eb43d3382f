"""Dask: a scheduler that runs already (`address=`), or workers started on this machine."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from auvnn.errors import ConfigError, MissingExtra, one_line
from auvnn.executors.base import AHEAD, TRIES, Executor, Lost, handed_ahead
from auvnn.executors.safe_path import kept_safe

_BEFORE = "distributed.nanny.pre-spawn-environ"
# s after which it is asked whether any worker is left, and s to wait for one.
_LOOK, _PATIENCE = 20.0, 120.0


class DaskCluster(Executor):
    """Tasks of a Dask scheduler, which gives a dead worker's tasks to another.

    What all tasks share goes with each of them: data scattered once would be lost with the worker that holds it.

    Reference: https://distributed.dask.org/en/stable/resilience.html
    """

    name = "dask"
    remote = True

    def start(self) -> None:
        """Join the scheduler, or start `workers` processes.

        Raises:
            MissingExtra: Dask's scheduler is not installed.
            ConfigError: no scheduler answers at the address.
        """
        try:
            dask = importlib.import_module("dask")
            distributed = importlib.import_module("distributed")
        except ImportError:
            raise MissingExtra("distributed", "cluster", "executor=dask") from None
        dask.config.set({"distributed.scheduler.allowed-failures": TRIES - 1})
        self._cluster = None
        try:
            if self.address is None:
                # Also those that Dask starts later, in the place of one that died.
                dask.config.set({f"{_BEFORE}.PYTHONSAFEPATH": "1"})
                with kept_safe():
                    self._cluster = distributed.LocalCluster(
                        n_workers=self.workers, threads_per_worker=1, processes=True, dashboard_address=None
                    )
            self.client = distributed.Client(self._cluster or self.address)
        except (OSError, ValueError) as problem:
            raise ConfigError(
                f"address={self.address}: no Dask scheduler to join ({one_line(problem, 200)})"
            ) from None

    def stop(self) -> None:
        """Leave the scheduler; one that was started here ends."""
        self.client.close()
        if self._cluster is not None:
            self._cluster.close()

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, tasks: Sequence[Any], *, losses: bool = False
    ) -> Iterator[Any]:
        """Yield the answers in the order of the tasks.

        Raises:
            Lost: a task brought down three workers, and `losses` is false.
        """
        client = self.client
        handed = handed_ahead(
            lambda task: client.submit(function, shared, task, pure=False), tasks, AHEAD * self.workers
        )
        for number, future in handed:
            yield self._answer(number, future, losses)

    def _answer(self, number: int, future: Any, losses: bool) -> Any:
        killed = importlib.import_module("distributed.scheduler").KilledWorker
        alone = 0.0
        while True:
            try:
                return future.result(timeout=_LOOK)
            except killed as problem:
                why = str(problem)
            except TimeoutError:
                # A worker that cannot be started again leaves its tasks waiting for ever.
                alone = 0.0 if self.client.scheduler_info()["workers"] else alone + _LOOK
                if alone < _PATIENCE:
                    continue
                why = f"no worker has come back for {alone:.0f} s"
            if losses:
                return Lost(number, TRIES, why)
            raise Lost(number, TRIES, why)
