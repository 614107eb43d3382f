"""The fit by free running: its normal equations against differences, and the truth found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.stated_priors import lay_out, priors
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.improvement.free_run import Task, fit_free_run, normal_equations, predicted
from auvnn.metrics.rollouts import scale_of
from auvnn.metrics.windows import VELOCITY, cut_windows
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

TRUTH = {"force": 6.0}


@pytest.fixture(scope="module")
def setting():
    model = GreyBox(small_vehicle())
    log = make_log(model.with_effects({"net_buoyancy": TRUTH}), runs=3, duration=10.0)
    task = Task(cut_windows(log, 2.0, 1.0, warmup=3.0, kind="thrusters"), scale_of(log))
    return lay_out(model, ["net_buoyancy", "cg_offset"]), task


def test_normal_equations_are_those_of_differences(setting):
    layout, task = setting
    task = replace(task, windows=task.windows.pick(slice(0, 4)))
    names = ("net_buoyancy", "cg_offset")
    model = layout.model
    hessian, slope, cost = normal_equations(model, task, names)
    weight, theta = task.weight().numpy(), parameters_of(model, names)
    columns, base = [], predicted(model, task.windows)
    for k in range(len(theta)):
        moved = model.rebuilt(model.copied_effects())
        step = np.zeros(len(theta))
        step[k] = 1e-4
        set_parameters(moved, names, theta + step)
        columns.append((predicted(moved, task.windows) - base) / 1e-4 * weight)
    jacobian = np.stack(columns, -1)
    error = (task.windows.nu.numpy() - base) * weight
    assert task.windows.mask[..., VELOCITY].bool().any()
    assert np.allclose(
        hessian, np.einsum("btci,btcj->bij", jacobian, jacobian), rtol=0.02, atol=1e-2 * hessian.max()
    )
    assert np.allclose(
        slope, np.einsum("btci,btc->bi", jacobian, error), rtol=0.02, atol=1e-2 * np.abs(slope).max()
    )
    assert np.allclose(cost, (error**2).sum((1, 2)), rtol=1e-6)


def test_the_truth_is_found_again_without_noise(setting):
    layout, task = setting
    names = ("net_buoyancy",)
    fit = fit_free_run(layout.model, task, names, priors(layout, names, free=names))
    assert fit.converged and fit.theta[0] == pytest.approx(TRUTH["force"], rel=1e-3)
    # Half of the windows say the same: one Newton step from the fit to all of them stays there.
    half = np.arange(len(task.windows)) % 2 == 0
    assert fit.newton(layout.model, half)[0] == pytest.approx(TRUTH["force"], rel=1e-3)


def test_a_window_that_has_lost_its_way_does_not_rule(setting, monkeypatch):
    layout, task = setting
    nu = task.windows.nu.clone()
    nu[0, 5:] += 9.0 * torch.as_tensor(task.scale.std)
    spoilt = replace(task, windows=replace(task.windows, nu=nu))
    names = ("net_buoyancy",)
    held = priors(layout, names, free=names)
    robust = fit_free_run(layout.model, spoilt, names, held).theta[0]
    monkeypatch.setattr("auvnn.improvement.free_run.ROBUST", np.inf)
    plain = fit_free_run(layout.model, spoilt, names, held).theta[0]
    assert abs(robust - TRUTH["force"]) < 0.6 * abs(plain - TRUTH["force"])
