"""Fins that lag, in another plant with another integrator: slopes of windows, one-step fit, and what diagnose says."""

from __future__ import annotations

import pytest
import torch

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.estimation.sensitivity import respond
from auvnn.metrics.free_run import initial_states, predict
from auvnn.models import load
from auvnn.simulation import simulate

TRUTH = 0.2
CANDIDATES = [
    "fin_lag",
    "fin_gain",
    "fin_offset",
    "added_mass",
    "munk_moment",
    "actuation_delay",
    "fin_stall",
]


@pytest.fixture(scope="module")
def remus():
    return load("remus100")


@pytest.fixture(scope="module")
def log(remus):
    hidden = {"fin_lag": {"time_constant": TRUTH}}
    return simulate(
        remus, "survey", "realistic", hidden=hidden, runs=2, duration=40.0, rate=10.0, seed=5, plant="numpy"
    ).log


# At the null all that changes comes in the interval after a command, of which the sensitivities know the mean.
@pytest.mark.parametrize(("tau", "share"), [(0.0, 0.15), (0.15, 0.01)])
def test_windows_answer_a_change_of_the_lag_as_runs_of_them_do(remus, tau, share, monkeypatch):
    monkeypatch.setenv("AUVNN_ENGINE", "torch")
    log = simulate(remus, "survey", "realistic", runs=1, duration=22.0, rate=10.0, seed=5).log
    model = remus.with_effects({"fin_lag": {"time_constant": tau}})
    windows = windows_for(model, log).pick(slice(1, 4))
    assert windows.warmup > 0
    initial = initial_states(model, windows)
    slope = respond(model, windows, initial, ["fin_lag"]).parameters[..., 6:12, 0]
    effect, ran = model.effect("fin_lag"), []
    for step in (0.0, 5e-4, 1e-3):
        with torch.no_grad():
            effect.theta.fill_(tau + step)
            ran.append(predict(model, windows, initial)[1])
    # Forward differences, the curvature taken out: there is nothing below the null.
    expected = (2 * (ran[1] - ran[0]) / 5e-4 - (ran[2] - ran[0]) / 1e-3) * windows.mask[..., 6:12]
    assert expected.abs().max() > 0.01
    away = (slope - expected).square().mean((0, 1)).sqrt() / expected.square().mean((0, 1)).sqrt()
    # Sway, heave, pitch and yaw, which the fins move.
    assert away[[1, 2, 4, 5]].max() < share, away


@pytest.mark.long
def test_diagnose_names_the_lag_and_its_value(remus, log, tmp_path):
    found = diagnose(remus, log, CANDIDATES, advice=False, costs=False, whiteness=False)
    assert found.missing == ["fin_lag"]
    told = next(c for c in found.to_dict()["candidates"] if c["effect"] == "fin_lag")["parameters"][
        "time_constant"
    ]
    assert abs(told["value"] - TRUTH) < 2.0 * told["std"] + 1e-3
    assert told["std"] < 0.02
    model = remus.with_effects({"fin_lag": {"time_constant": told["value"]}})
    again = load(model.save(tmp_path / "model"))
    assert again.effect("fin_lag").values() == {"time_constant": told["value"]}
    assert diagnose(again, log, CANDIDATES, advice=False, costs=False, whiteness=False).missing == []


@pytest.mark.long
def test_nothing_is_said_of_a_lag_that_is_not_there(remus):
    log = simulate(remus, "survey", "realistic", runs=2, duration=40.0, rate=10.0, seed=6, plant="numpy").log
    found = diagnose(remus, log, CANDIDATES, advice=False, costs=False, whiteness=False)
    assert found.missing == [] and found.verdict == "adequate"
