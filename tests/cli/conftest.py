"""The command line in this process, and a verb that needs none of the floors below."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from stand_ins import write_two

from auvnn.cli import check
from auvnn.cli.job import Job, Verb
from auvnn.cli.main import main


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


@pytest.fixture
def auvnn(capfd: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run the command line in this process: exit status, standard output, standard error."""

    def run(*arguments: str) -> tuple[int, str, str]:
        capfd.readouterr()
        try:
            status = main(arguments)
        except SystemExit as end:
            status = int(end.code or 0)
        out, err = capfd.readouterr()
        return status, out, err

    return run


@pytest.fixture
def refused(auvnn: Callable[..., tuple[int, str, str]]) -> Callable[..., str]:
    """Run what must be refused: status 2 and one line without a trace, and no result."""

    def run(*arguments: str) -> str:
        status, out, err = auvnn(*arguments)
        assert status == 2, (status, out, err)
        assert "Traceback" not in out and "result" not in out
        assert err.count("\n") == 1 and err.endswith("\n")
        assert "Traceback" not in err
        return err.strip()

    return run
