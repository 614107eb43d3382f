"""The command line in this process, and a verb that needs none of the floors below."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from auvnn.cli.runs.job import Job, Verb
from auvnn.cli.verbs import check
from tests.cli.stand_ins import write_two
from tests.command_line import auvnn, refused

__all__ = ["auvnn", "refused", "stand_in"]


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[Callable[[Job], Any]], None]:
    """Put a function in the place of what `auvnn check` does, and stand in an empty folder with one log."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dive.csv").write_text("t\n0\n")

    def put(run: Callable[[Job], Any]) -> None:
        verb = Verb("stand-in", ("log",), ("quality.json", "figures/", "report.html"), run)
        monkeypatch.setattr(check, "VERB", verb)

    put(write_two)
    return put


@pytest.fixture(scope="module", autouse=True)
def engine(compiled_engine: None) -> None:
    """Use the compiled engine in every module of this folder, as users do."""
