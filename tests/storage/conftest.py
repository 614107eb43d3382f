"""A small folder on disk."""

from __future__ import annotations

from pathlib import Path

import pytest

from auvnn.storage import write_folder
from tests.storage.stored import FILES


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_folder(tmp_path / "model", FILES)
