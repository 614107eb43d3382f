"""An unstable vehicle with coefficients that are off: free running leaves the motion, and is brought back."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
import torch

import auvnn
from auvnn.diagnosis.hypotheses import outlier_restart as outliers
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.outlier_restart import fit_with_outlier_restart
from auvnn.diagnosis.hypotheses.stated_priors import lay_out, priors
from auvnn.estimation import prediction_error
from auvnn.estimation.prediction_error import fit
from auvnn.estimation.priors import Priors

# What the sensors of the condition "realistic" add to velocities and rates, m/s and rad/s.
NOISE = np.repeat([0.006, 0.003], 3)


def logged(seed):
    """Return the model as stated, windows of a log of one whose coefficients are off, their groups, and what is known."""
    model = auvnn.load("remus100")
    layout = lay_out(model, [])
    groups = [n for n in layout.names if n != "inertia"]
    random = np.random.default_rng(seed)
    off = {
        n: {
            p.name: float(max(mean + random.normal() * spread, p.low + 0.3))
            for p, mean, spread in zip(layout.described(n), layout.means[n], layout.spreads[n], strict=True)
        }
        for n in groups
    }
    made = auvnn.simulate(
        model, "multisine", hidden=off, duration=30.0, rate=10.0, runs=2, seed=seed, noise="realistic"
    )
    return layout.model, windows_for(model, made.log), groups, priors(layout, groups)


@pytest.mark.parametrize("seed", [19, 59])
def test_windows_that_one_step_for_all_throws_off_take_shorter_ones(seed, monkeypatch):
    model, windows, groups, known = logged(seed)
    found = fit(model, windows, groups, known, iterations=15)
    np.testing.assert_allclose(found.sigma[6:12], NOISE, rtol=0.1)
    monkeypatch.setattr(prediction_error, "shorter_steps", lambda *_: None)
    thrown = fit(model, windows, groups, known, iterations=15)
    assert thrown.sigma[6] > 3 * NOISE[0], "some windows go astray, or this says nothing"


def test_windows_that_went_astray_are_brought_back_by_the_others():
    model, windows, groups, known = logged(93)
    plain = fit(model, windows, groups, known, iterations=15)
    assert plain.sigma[6] > 3 * NOISE[0], "some windows go astray, or this says nothing"
    found = fit_with_outlier_restart(model, windows, groups, known, iterations=15)
    np.testing.assert_allclose(found.sigma[6:12], NOISE, rtol=0.1)


def test_where_none_goes_astray_it_is_the_plain_fit():
    model, windows, groups, known = logged(67)
    plain = fit(model, windows, groups, known, iterations=15)
    found = fit_with_outlier_restart(model, windows, groups, known, iterations=15)
    np.testing.assert_array_equal(found.theta, plain.theta)
    np.testing.assert_allclose(plain.sigma[6:12], NOISE, rtol=0.1)


def test_the_last_fit_begins_with_each_stray_already_brought_back(monkeypatch):
    model, windows, groups, known = logged(93)
    seen = []

    def watched(at, some, names, held, **how):
        seen.append((at, some, names, how))
        return fit(at, some, names, held, **how)

    monkeypatch.setattr(outliers, "fit", watched)
    found = fit_with_outlier_restart(model, windows, groups, known, iterations=15)
    at, some, names, how = seen[-1]
    assert len(some) == len(windows) and names == groups
    nothing = Priors(np.zeros(0), np.zeros(0))

    def errors(**begun):
        return fit(at, windows, (), nothing, sigma=found.sigma, iterations=0, **begun).statistics.cost

    assert errors().max() > 50 * np.median(errors()), (
        "from the measured states some go astray, or this says nothing"
    )
    assert errors(initial=how["initial"]).max() < 2 * np.median(errors())


@pytest.mark.parametrize(
    ("sigmas", "begun"),
    [
        ([1.0, 0.9, 0.8, 0.7, 0.6], 3),
        ([1.0, 0.9, 0.897, 0.7], 2),
        ([1.0, 0.995, 0.7], 1),
        ([1.0, 1.1, 0.7], 1),
    ],
)
def test_a_wrong_model_is_not_begun_again_for_next_to_nothing(monkeypatch, sigmas, begun):
    """Its windows have large errors wherever it begins; what brings some back lowers the errors by over a hundredth."""

    def fitted(sigma):
        sums = SimpleNamespace(cost=np.array([1.0, 1.0, 1.0, 10.0]), count=np.full((4, 18), 100.0))
        return SimpleNamespace(statistics=sums, sigma=np.full(18, sigma), converged=False)

    ends = [fitted(s) for s in sigmas]
    monkeypatch.setattr(outliers, "fit", lambda *_, **__: ends[0])
    following = iter(ends[1:])
    monkeypatch.setattr(outliers, "_begun_again", lambda *_: next(following))
    nothing: Any = None
    found = fit_with_outlier_restart(nothing, nothing, (), nothing, iterations=1)
    assert found.sigma[0] == min(sigmas[: begun + 1])
    assert len(list(following)) == len(sigmas) - 1 - begun


@pytest.mark.parametrize(("errors", "steps"), [(0.999, [15, 4]), (0.9, [15, 4, 11])])
def test_a_fit_begun_again_goes_on_where_its_first_steps_brought_windows_back(monkeypatch, errors, steps):
    sums = SimpleNamespace(cost=np.array([1.0, 1.0, 1.0, 10.0]), count=np.full((4, 18), 100.0))
    initial, asked = torch.zeros(4, 13), []

    def fitted(sigma, count=4):
        return SimpleNamespace(
            statistics=sums, sigma=np.full(18, sigma), converged=False, model=None, initial=initial[:count]
        )

    def fit_of(*_, iterations, **__):
        asked.append(iterations)
        return fitted(1.0, 3) if len(asked) == 1 else fitted(errors)

    monkeypatch.setattr(outliers, "fit", fit_of)
    monkeypatch.setattr(outliers, "initial_states", lambda *_: initial.clone())
    monkeypatch.setattr(outliers, "_restarted", lambda *_: initial[:1])
    windows: Any = MagicMock(__len__=lambda _: 4)
    nothing: Any = None
    near = np.array([True, True, True, False])
    outliers._begun_again(fitted(1.0), nothing, windows, (), nothing, near, None, 15)
    assert asked == steps
