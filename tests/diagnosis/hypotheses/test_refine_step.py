"""An integrator's error must not be there to be explained: steps are halved until it is lost in the noise."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.refine_step import refine_step
from auvnn.estimation.window_normal_equations import TRUST, motion
from auvnn.metrics.free_run import initial_states, predict
from auvnn.metrics.windows import VELOCITY
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


@pytest.fixture(scope="module")
def windows(model):
    return windows_for(model, make_log(model, runs=1, duration=12.0))


def least(windows):
    return np.where(windows.mask.sum((0, 1)).numpy() > 0, TRUST * motion(windows) + 1e-9, np.inf)


def off(model, windows, sigma, exact):
    """Return how many standard errors all predicted velocities are off together."""
    nu = predict(model, windows, initial_states(model, windows))[1]
    return float(torch.linalg.vector_norm((nu - exact) / torch.tensor(sigma[VELOCITY])))


def test_without_noise_steps_are_halved_until_what_they_get_wrong_is_lost(model, windows):
    start = initial_states(model, windows)
    sigma = 0.01 * least(windows)
    found = refine_step(model, windows, start, sigma)
    exact = predict(model, windows, start, max_step=0.001)[1]
    assert found.max_step < windows.max_step
    assert off(model, windows, sigma, exact) > 2.0, "or this says nothing"
    assert off(model, found, sigma, exact) < 1.0


def test_noise_hides_what_steps_get_wrong_and_they_stay(model, windows):
    assert refine_step(model, windows, initial_states(model, windows), 100 * least(windows)) is windows


def test_a_search_goes_on_with_shorter_steps(model, windows, monkeypatch):
    from auvnn.diagnosis.diagnose import searched

    def halved(model, windows, initial, sigma):
        return windows if windows.max_step < 0.05 else type(windows)(**{**vars(windows), "max_step": 0.025})

    monkeypatch.setattr("auvnn.diagnosis.stages.search_round.refine_step", halved)
    log = make_log(model, runs=2, duration=8.0, noise=1.0)
    found, search = searched(model, log, ["net_buoyancy"], whiteness=False)
    assert found.verdict == "adequate" and search.state.windows.max_step == 0.025
