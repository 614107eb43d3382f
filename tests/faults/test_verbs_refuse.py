"""What `check` calls an error, no verb that fits takes for granted, in memory or in parts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auvnn.logs import Log
from tests.command_line import auvnn, refused
from tests.online.online_world import driven, vehicle

__all__ = ["auvnn", "refused"]

VERBS = {
    "train": ["train"],
    "train in parts": ["train", "stream=true"],
    "diagnose": ["diagnose"],
    "diagnose in parts": ["diagnose", "stream=true"],
    "add": ["add", "effect=quadratic_damping"],
    "improve": ["improve"],
    "fleet": ["fleet", "effects=quadratic_damping"],
    "adapt": ["adapt"],
}


@pytest.fixture(scope="module")
def neutral(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A vehicle that was driven, whose log says that it was not."""
    run = driven(vehicle(), duration=40.0, noise=(2e-3, 0.0))
    assert run.wrench is not None
    # As a broken recorder leaves it: the same motion, no command. Accelerations are not measured.
    silent = replace(run, wrench=np.zeros_like(run.wrench), nu_dot=None)
    return Log.from_runs([silent]).write(tmp_path_factory.mktemp("neutral") / "dive.parquet")


def test_row_42_check_calls_it_an_error(neutral, auvnn, tmp_path):
    _, out, _ = auvnn("check", f"log={neutral}", f"out={tmp_path / 'c'}", "json=true")
    levels = {f["level"] for f in json.loads(out)["findings"] if "zero throughout" in f["what"]}
    assert levels == {"error"}


@pytest.mark.parametrize("verb", VERBS)
def test_row_42_every_verb_that_fits_refuses_it(verb, neutral, refused, tmp_path):
    words = refused(*VERBS[verb], "model=rov95", f"log={neutral}", f"out={tmp_path / 'o'}")
    assert "the wrench is zero throughout" in words and "force=true" in words
    assert not (tmp_path / "o").exists()


def test_row_42_a_fleet_leaves_that_dive_out_and_says_so(neutral, auvnn, tmp_path):
    good = Log.from_runs([driven(vehicle(), duration=40.0, noise=(2e-3, 0.0))]).write(tmp_path / "a.parquet")
    status, out, _ = auvnn(
        "fleet",
        "model=rov95",
        f"log=[{good},{neutral}]",
        "effects=quadratic_damping",
        f"out={tmp_path / 'o'}",
    )
    assert status == 0
    lost = [line for line in out.splitlines() if line.startswith("failed")]
    assert len(lost) == 1 and "zero throughout" in lost[0]
