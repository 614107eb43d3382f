"""A long log is read, judged and differentiated in seconds."""

import time
from pathlib import Path

import numpy as np
import pytest

from auvnn.logs import Log, Run, local_polynomial


@pytest.mark.long
def test_a_million_rows(tmp_path: Path) -> None:
    n = 1_000_000
    rng = np.random.default_rng(0)
    run = Run(
        number=1,
        t=0.01 * np.arange(n),
        quaternion=np.tile([1.0, 0, 0, 0], (n, 1)),
        nu=rng.normal(size=(n, 6)),
        thrusters=np.clip(rng.normal(size=(n, 8)), -1, 1),
        position=rng.normal(size=(n, 3)),
    )
    path = Log.from_runs([run]).write(tmp_path / "log.parquet")
    start = time.perf_counter()
    log = Log.read(path)
    assert time.perf_counter() - start < 8.0
    start = time.perf_counter()
    log.quality()
    assert time.perf_counter() - start < 40.0
    start = time.perf_counter()
    local_polynomial(log.runs[0].t, log.runs[0].nu)
    assert time.perf_counter() - start < 4.0
