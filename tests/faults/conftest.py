"""What the tests of bad input stand on: an empty folder with one good log, and the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from auvnn.errors import AuvnnError
from auvnn.logs import Log
from tests.command_line import auvnn, refused
from tests.faults.vehicles import put
from tests.log_samples import frame, make_run

__all__ = ["auvnn", "good", "home", "noted", "refused", "rows"]


@pytest.fixture(scope="session")
def good() -> str:
    """A good log as CSV text, 400 samples at 20 Hz with four thrusters."""
    return frame(make_run(400, noise=0.01)).write_csv()


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, good: str) -> Path:
    """Stand in a separate folder, with the good log and the file of a vehicle in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.csv").write_text(good)
    put()
    return tmp_path


@pytest.fixture
def rows(good: str) -> list[list[str]]:
    """The good log's cells, the header first, for a test to spoil."""
    return [line.split(",") for line in good.strip().split("\n")]


@pytest.fixture
def noted() -> Callable[..., str]:
    """Read what must be survived: all findings of the quality report on a log, in one text."""

    def read(
        path: str | Path | list[str], mapping: Any = None, level: str | None = None, **options: Any
    ) -> str:
        try:
            log = Log.read(path, mapping, **options)
        except AuvnnError as error:
            pytest.fail(f"refused instead of corrected: {error}")
        found = [f for f in log.quality().findings if level in (None, f.level)]
        return "\n".join(f"{f.level}: {f.where}: {f.what}; {f.cure}" for f in found)

    return read
