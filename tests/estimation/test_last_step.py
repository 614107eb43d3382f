"""The initial states of a fit that has not settled: the last step is taken window by window, where it pays."""

from __future__ import annotations

import numpy as np
import torch

from auvnn.estimation import prediction_error
from auvnn.estimation.prediction_error import fit
from auvnn.estimation.priors import Priors
from auvnn.estimation.window_normal_equations import weights_of
from auvnn.estimation.window_simulation import output_error
from auvnn.metrics.windows import cut_windows
from auvnn.models import load
from auvnn.simulation import simulate


def test_the_last_step_of_an_unsettled_fit_raises_no_windows_error(monkeypatch):
    # An unstable vehicle: over 4 s, free running is far from linear in its initial state.
    model = load("remus100")
    weak = {"fin_gain": {"fin_1": 1.0, "fin_2": 0.6, "fin_3": 1.0, "fin_4": 0.6}}
    log = simulate(model, "survey", "realistic", hidden=weak, runs=1, duration=20.0, rate=10.0, seed=2).log
    windows = cut_windows(log, 4.0)
    none = Priors(np.zeros(0), np.zeros(0))
    found = fit(model, windows, [], none, iterations=1)
    assert not found.converged

    def squared(initial: torch.Tensor) -> torch.Tensor:
        error = output_error(model, windows, initial) * weights_of(found.sigma)
        return (error**2).flatten(1).sum(1)

    seen = {}

    def kept(*given):
        seen["old"], seen["new"] = given[-2:]
        return given[-1]

    monkeypatch.setattr(prediction_error, "better_of", kept)
    fit(model, windows, [], none, iterations=1)
    old, new, last = squared(seen["old"]), squared(seen["new"]), squared(found.initial)
    assert new.sum() > 5 * last.sum(), "taken as a whole, the step leads away"
    assert bool((last <= old * (1 + 1e-9)).all()) and last.sum() < old.sum()
