"""Ray: a cluster that runs already (`address=`), or one started on this machine."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from auvnn.errors import ConfigError, MissingExtra, one_line
from auvnn.executors.base import AHEAD, TRIES, Executor, Lost, handed_ahead
from auvnn.executors.safe_path import kept_safe, ray_job

# Ray gives the agents of a node 15 s to come up, and cannot be told otherwise (ray-project/ray issue 65983). On a busy
# machine the first try reads their code from the disk and may fail; the next one finds it in memory.
_STARTS = 3


class RayCluster(Executor):
    """Tasks of a Ray cluster; Ray itself gives a dead worker's task to another.

    Reference: https://docs.ray.io/en/latest/ray-core/fault-tolerance.html
    """

    name = "ray"
    remote = True

    def start(self) -> None:
        """Join the cluster, or start one of `workers` processes.

        Raises:
            MissingExtra: Ray is not installed.
            ConfigError: no cluster answers at the address.
        """
        try:
            ray = importlib.import_module("ray")
        except ImportError:
            raise MissingExtra("ray", "cluster", "executor=ray") from None
        self._ray, self._ours = ray, not ray.is_initialized()
        if not self._ours:
            return
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        # How long a process waits for the node that it belongs to.
        os.environ.setdefault("RAY_raylet_start_wait_time_s", "120")
        own = {"num_cpus": self.workers, "include_dashboard": False} if self.address is None else {}
        for left in reversed(range(_STARTS if self.address is None else 1)):
            try:
                with kept_safe():
                    ray.init(
                        address=self.address,
                        log_to_driver=False,
                        logging_level="ERROR",
                        job_config=ray_job(),
                        **own,
                    )
                return
            except Exception as problem:  # Ray raises a bare Exception where a node does not come up in time
                ray.shutdown()
                if left:
                    continue
                words = (
                    f"no Ray cluster comes up here, tried {_STARTS} times: is the machine too busy to start its agents "
                    "within Ray's 15 s? Start one beforehand, 'ray start --head', and give its address="
                    if self.address is None
                    else f"no Ray cluster at {self.address}"
                )
                raise ConfigError(f"executor=ray: {words} ({one_line(problem, 200)})") from None

    def stop(self) -> None:
        """Leave the cluster; one that was started here ends."""
        if self._ours:
            self._ray.shutdown()

    def run(
        self, function: Callable[[Any, Any], Any], shared: Any, tasks: Sequence[Any], *, losses: bool = False
    ) -> Iterator[Any]:
        """Yield the answers in the order of the tasks.

        Raises:
            Lost: a task brought down three workers, and `losses` is false.
        """
        ray = self._ray
        call = ray.remote(num_cpus=1, max_retries=TRIES - 1)(function)
        common = ray.put(shared)
        handed = handed_ahead(lambda task: call.remote(common, task), tasks, AHEAD * self.workers)
        for number, reference in handed:
            yield self._answer(number, reference, losses)

    def _answer(self, number: int, reference: Any, losses: bool) -> Any:
        errors = self._ray.exceptions
        try:
            return self._ray.get(reference)
        except (errors.WorkerCrashedError, errors.OutOfMemoryError, errors.NodeDiedError) as problem:
            if losses:
                return Lost(number, TRIES, str(problem))
            raise Lost(number, TRIES, str(problem)) from None
        except errors.RayTaskError as problem:
            raise problem.cause from None
