"""Commands between samples of a vehicle that steers by fins: too far from held ones for a first order about these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.commands.early import clearly_between_samples
from auvnn.diagnosis.noise_law.commands.holding import FAR, cost_at_best, cost_with, holding
from auvnn.diagnosis.noise_law.commands.law import Holding
from auvnn.diagnosis.noise_law.commands.share import with_share
from auvnn.estimation.window_parts import split
from auvnn.logs import Log, Run
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.commands.paths import between
from auvnn.models import GreyBox, Inputs
from auvnn.vehicle import load_vehicle
from tests.small_logs import NOISE, sines

TICKS, RATE, DURATION = 10, 5.0, 40.0


@pytest.fixture(scope="module")
def model():
    return GreyBox(load_vehicle("remus100"))


def steered(model, ticks, seed=3):
    """Return a log at 5 Hz of two runs under way whose commands and fins change so many times in an interval."""
    random = np.random.default_rng(seed)
    t = np.arange(int(DURATION * RATE * ticks) + 1) / (RATE * ticks)
    runs = []
    for number in range(2):
        fins = 0.25 * sines(t, model.vehicle.n_fins, seed + number, low=0.1, high=1.5)
        command = 0.7 + 0.1 * sines(t, len(model.vehicle.thrusters), seed + 10 + number)
        eta = torch.tensor([0.0, 0.0, 10.0, 1.0, 0.0, 0.0, 0.0], dtype=torch.float64)
        nu = torch.tensor([1.5, 0.0, 0.0, 0.0, 0.0, 0.0], dtype=torch.float64)
        inputs = Inputs(torch.from_numpy(command), torch.from_numpy(fins))
        with torch.no_grad():
            run = model.rollout(eta, nu, inputs, torch.from_numpy(t), max_step=0.02)
        every = slice(None, None, ticks)
        seen = run.nu[every].numpy()
        runs.append(
            Run(
                number,
                t[every],
                run.eta[every, 3:].numpy(),
                seen + NOISE["nu"] * random.normal(size=seen.shape),
                position=run.eta[every, :3].numpy() + NOISE["position"] * random.normal(size=(len(seen), 3)),
                thrusters=command[every],
                fins=fins[every],
            )
        )
    return Log.from_runs(runs, name="steered")


def first_fit(model, log):
    windows, layout = windows_for(model, log), lay_out(model, [])
    return layout, fit_hypothesis(layout, windows, list(layout.names), (), iterations=6), windows


def test_fins_that_change_between_samples_are_not_held(model):
    layout, first, windows = first_fit(model, steered(model, TICKS))
    straight = between(windows, 0.5, "linear")
    assert cost_at_best(first, straight) > FAR * cost_at_best(first, windows)
    held = holding(first, windows, layout)
    assert held.odds > np.log(100.0) and clearly_between_samples(layout, first, windows)
    found = with_share(layout, first, windows, held)
    assert found.share == pytest.approx(0.5 - 0.5 / TICKS, abs=0.05)
    # About a fit to these the error is what it is by the law that was found.
    assert cost_with(found, first, windows, layout=layout) < cost_at_best(first, windows)
    assert cost_with(found, first, windows) > cost_with(found, first, windows, layout=layout)


def test_a_share_that_is_far_off_is_left(model):
    """From where the first order about held commands may end: the fit to the middle of the interval is likelier."""
    layout, first, windows = first_fit(model, steered(model, TICKS))
    for name, share in (("smooth", 0.1), ("ahead", 0.1)):
        far = Holding(name, share, 9.0, 18.0, curves=MeanThrust.of(model))
        found = with_share(layout, first, windows, far)
        assert found.share == pytest.approx(0.5 - 0.5 / TICKS, abs=0.05) and found.odds > 9.0


def test_fins_that_are_held_are_held(model):
    layout, first, windows = first_fit(model, steered(model, 1))
    assert holding(first, windows, layout).name == "held"
    assert not clearly_between_samples(layout, first, windows)


def test_where_no_fit_to_other_commands_is_found_the_first_one_is_asked(model, monkeypatch):
    from auvnn.diagnosis.noise_law.commands import holding as module

    def nowhere(*_, **__):
        raise np.linalg.LinAlgError("nowhere")

    layout, first, windows = first_fit(model, steered(model, TICKS))
    monkeypatch.setattr(module, "fitted_to", nowhere)
    assert replace(holding(first, windows, layout)) == holding(first, windows)


def test_fins_within_an_interval_stay_with_their_windows(model):
    """What is picked of windows, or divided into shorter ones, runs as it does in all of them."""
    log = steered(model, TICKS)
    straight = between(windows_for(model, log), 0.5, "linear")
    within = straight.inputs.fins_within
    assert within is not None and straight.inputs.fins is not None
    assert torch.allclose(within.mean(-2), straight.inputs.fins)
    assert torch.equal(straight.pick(slice(2, 5)).inputs.fins_within, within[2:5])
    parts, whole, begins = split(straight, 2.5)
    assert len(whole) > len(straight)
    for found, window, begin in zip(parts.inputs.fins_within, whole, begins, strict=True):
        first = straight.warmup
        expected = within[window, first + begin : first + begin + found.shape[0] - first]
        assert torch.equal(found[first : first + expected.shape[0]], expected)
