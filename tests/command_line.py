"""The command line in this process, for the tests of every folder."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from auvnn.cli.main import main


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
