"""The T200 bench study: the package's own thruster effects on measured transients."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "experiments" / "t200"
DATA = Path(os.environ.get("AUVNN_DATA", ROOT.parent / "shared" / "data")) / "t200"
ABSENT = pytest.mark.skipif(
    not (DATA / "static.csv").is_file(),
    reason="the T200 records are not here: set AUVNN_DATA to the folder above t200/",
)


@pytest.fixture(scope="module")
def study():
    sys.path.insert(0, str(HERE))
    try:
        sys.modules.pop("run", None)
        import run

        yield run
    finally:
        sys.path.remove(str(HERE))
        sys.modules.pop("run", None)


def test_what_is_expected_holds_together():
    """A lag explains most of what a static curve leaves, and a delay as much: the README rests on these figures."""
    expected = json.loads((HERE / "expected.json").read_text())
    static, lag, delay = (expected[n]["left_out_r2"] for n in ("static", "thruster_lag", "actuation_delay"))
    assert static < 0.82 and lag > 0.93 and abs(lag - delay) < 0.005
    tau = expected["thruster_lag"]["parameters"]["thruster_lag.time_constant"]
    assert 0.010 < tau["low"] < tau["value"] < tau["high"] < 0.015


def test_the_force_of_the_bench_is_that_of_a_lag_in_closed_form(study, tmp_path):
    """A straight static curve and steps of the command every 50 ms: the mean around each row, by hand."""
    model = study.Bench(tmp_path, ("thruster_lag",), straight=True)
    t = 0.002 * np.arange(200)
    command = np.where((t // 0.05).astype(int) % 2 == 0, 0.3, 0.6)
    batch = study.Batch(torch.tensor(command[None]), torch.tensor(t[None]), np.zeros((1, 150)), 50)
    theta = np.array([1.1, 0.012, 2.0])
    got = model.predict(theta, batch)[0]
    fine = np.linspace(0.0, t[-1], 199 * 50 + 1)
    held = command[np.minimum((fine / 0.002 + 1e-9).astype(int), 199)]
    state, exact = command[0], np.empty(len(fine))
    for k in range(len(fine)):
        exact[k] = state
        state += (held[k] - state) * -np.expm1(-(fine[1] - fine[0]) / 0.012)
    for row in (60, 77, 120, 150):
        around = exact[50 * row - 50 : 50 * row + 51]
        assert got[row - 50] == pytest.approx(1.1 * 50.0 * np.trapezoid(around, dx=1.0) / 100 + 2.0, abs=0.05)


@ABSENT
def test_a_lag_is_found_in_the_records(study):
    """One record: a lag of some 11 ms takes away most of what the static curve leaves."""
    batch = study.windows([study.read(DATA, study.SINES[1])])
    some = study.Batch(batch.command[::3], batch.times[::3], batch.force[::3], batch.history)
    static, lagged = (study.Bench(DATA, study.CANDIDATES[n]) for n in ("static", "thruster_lag"))
    static.fit(some, iterations=3)
    std = lagged.fit(some, iterations=5)
    assert study.score(static, some)["r2"] < 0.85 < 0.94 < study.score(lagged, some)["r2"]
    assert lagged.theta[1] == pytest.approx(0.0112, abs=0.001) and std[1] < 0.0005
