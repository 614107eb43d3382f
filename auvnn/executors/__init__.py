"""The catalogue of executors: who computes the parts of a large job. A new one is one file and one line here."""

from __future__ import annotations

from auvnn.catalogue import Catalogue
from auvnn.errors import ConfigError
from auvnn.executors.base import Executor, Lost

__all__ = ["EXECUTORS", "Executor", "Lost", "executor_for"]

EXECUTORS = Catalogue(
    "executor",
    {
        "serial": "auvnn.executors.serial:Serial",
        "processes": "auvnn.executors.processes:Processes",
        "ray": "auvnn.executors.ray_cluster:RayCluster",
        "dask": "auvnn.executors.dask_cluster:DaskCluster",
    },
    "auvnn.executors",
)


def executor_for(name: str | None = None, workers: int = 1, address: str | None = None) -> Executor:
    """Return an executor that is not started yet; it is a context manager.

    Args:
        name: of the catalogue; by default `serial` for one worker and `processes` for more.
        workers: how many processes, on this machine or asked of a cluster that is started here.
        address: of a Ray or Dask cluster that is running already.

    Raises:
        ConfigError: an unknown name, fewer than one worker, or an address that the executor has no use for.
        MissingExtra: the executor's package is not installed.
    """
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ConfigError(f"workers={workers} must be a whole number, at least 1")
    kind = EXECUTORS.get(name or ("serial" if workers == 1 else "processes"))
    if address is not None and not kind.remote:
        raise ConfigError(
            f"address={address}: executor {kind.name} works on this machine alone; take ray or dask"
        )
    return kind(workers, address)
