"""The demo's log, made once."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def demo_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's log with its hidden current, four runs of 60 s, as a user would have it."""
    from auvnn.models import load
    from auvnn.studies.demo import VEHICLE, made_logs

    path = tmp_path_factory.mktemp("demo") / "dive.parquet"
    made_logs(load(VEHICLE))[0].log.write(path)
    return path
