"""What `auvnn diagnose` hands on to the search."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from auvnn.cli.main import main
from auvnn.errors import InputError


@pytest.mark.parametrize(("word", "stochastic"), [(None, True), ("stochastic=false", False)])
def test_the_stochastic_force_is_left_out_on_request(
    auvnn: Callable[..., tuple[int, str, str]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    word: str | None,
    stochastic: bool,
):
    log, seen = tmp_path / "made", {}
    words = ["runs=1", "duration=5", "rate=10", f"out={log}"]
    assert main(["simulate", "model=rov95", *words]) == 0

    def stand_in(*_: Any, **options: Any) -> None:
        seen.update(options)
        raise InputError("no search here")

    monkeypatch.setattr("auvnn.diagnosis.diagnose", stand_in)
    status, _, err = auvnn(
        "diagnose",
        "model=rov95",
        f"log={log / 'log.parquet'}",
        f"out={tmp_path / 'out'}",
        *([word] if word else []),
    )
    assert status == 2 and "no search here" in err and seen["stochastic"] is stochastic
