"""Each scheme against something independent: batch least squares, autograd, and the frozen-weight error."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.errors import ConfigError
from auvnn.online import Adapter, frozen_errors
from auvnn.online.residual import Predictor, Sample
from auvnn.online.schemes.base import Observation
from auvnn.online.schemes.rls import RLS
from auvnn.online.updates.weights import Weights
from tests.online.online_world import bare, driven, fed, vehicle, with_networks


def observations(weights: Weights, count: int, noise: float, seed: int = 0):
    """Yield (nu, target) of a law with another last layer, in the output scale."""
    generator = torch.Generator().manual_seed(seed)
    other = weights.read() + 0.01 * torch.randn(6, weights.width, generator=generator, dtype=torch.float64)
    for _ in range(count):
        nu = 0.3 * torch.randn(6, generator=generator, dtype=torch.float64)
        slope = weights.jacobian(nu)[1]
        drawn = noise * torch.randn(6, generator=generator, dtype=torch.float64)
        yield nu, (other * slope).sum(1) + drawn, slope


def test_rls_without_forgetting_is_batch_least_squares_with_a_prior():
    model = with_networks()
    assert model.damping is not None
    weights = Weights(model.damping, "last")
    scheme = RLS(forgetting=1e9, rest=0.0, shape=0.05, gain=0.05)
    scheme.start(weights)
    prior, start = scheme.state()["calm"].clone(), weights.read()
    hessian, slope_sum = torch.linalg.inv(prior), torch.zeros_like(start)
    variance = torch.full((6,), 0.1**2, dtype=torch.float64)
    for k, (nu, target, slope) in enumerate(observations(weights, 60, 0.1)):
        error = target - weights.value(nu)
        found = scheme.propose(weights, Observation(0.1 * k, 0.1, nu, target, error, slope, variance))
        if found is not None:
            weights.write(found)
        hessian = hessian + slope[:, :, None] * slope[:, None, :] / variance[:, None, None]
        slope_sum += slope * ((target - (start * slope).sum(1)) / variance)[:, None]
    batch = start + torch.linalg.solve(hessian, slope_sum[:, :, None])[..., 0]
    torch.testing.assert_close(weights.read(), batch, rtol=1e-6, atol=1e-8)
    covariance = torch.linalg.inv(hessian)
    torch.testing.assert_close(scheme.state()["covariance"], covariance, rtol=1e-4, atol=1e-9)


def test_rls_knows_that_damping_vanishes_at_rest():
    model = with_networks()
    assert model.damping is not None
    rest = torch.zeros(6, dtype=torch.float64)
    before = float(model.damping(rest).detach().abs().max())
    run = driven(vehicle(), duration=8.0, noise=(1e-3, 0.3))
    adapter = Adapter(model, watch=False)
    fed(adapter, run)
    damping = adapter.model.damping
    assert damping is not None
    assert float(damping(rest).detach().abs().max()) < 0.05 * before


def test_plain_sgd_is_a_gradient_step_on_the_squared_residual():
    model, run = with_networks(), driven(vehicle(), duration=3.0)
    adapter = Adapter(
        model, {"scheme": "sgd", "normalised": False, "learning_rate": 0.01}, guards="none", watch=False
    )
    fed(adapter, run, range(0, 11))
    held, bank = adapter.snapshot(), adapter.model.damping
    assert bank is not None
    nu = torch.tensor(run.nu[11])
    model = adapter.model
    with torch.no_grad():
        rate = model(torch.tensor(run.eta[11]), nu, torch.tensor(run.wrench[11]))
        target = bank(nu) + model.prepare().total @ (rate - torch.tensor(run.nu_dot[11]))
    loss = 0.5 * (((target - bank(nu)) / bank.output_scale) ** 2).sum()
    bank.zero_grad()
    loss.backward()
    fed(adapter, run, range(11, 12))
    for name, parameter in bank.named_parameters():
        assert parameter.grad is not None
        expected = held[name] - 0.01 * parameter.grad
        torch.testing.assert_close(adapter.snapshot()[name], expected, rtol=1e-9, atol=1e-12)


def test_an_increment_of_the_true_model_leaves_no_residual():
    """Without accelerations: the model's own increment over the interval, so nothing is differentiated."""
    run = driven(vehicle(), duration=4.0, step=0.01)
    predictor, left = Predictor(vehicle()), []
    for k in range(run.samples):
        tensors = [torch.tensor(v[k]) for v in (run.eta, run.nu, run.wrench)]
        found = predictor.take(Sample(float(run.t[k]), *tensors))
        if found is not None:
            left.append(found.acceleration)
    size = torch.stack(left).abs().max()
    assert (
        float(size) < 1e-4
    )  # m/s2: integration error of the run itself; a difference quotient would be at 1e-1
    quotient = np.diff(run.nu, axis=0) / 0.1 - run.nu_dot[:-1]
    assert np.abs(quotient).max() > 0.03


@pytest.mark.parametrize("measured", [True, False])
def test_the_default_learns_a_vehicle_whose_drag_it_did_not_know(measured):
    """Weights frozen at t, five seconds ahead: a third of the error of the model without adaptation."""
    run = driven(vehicle(), duration=20.0)
    adapter = Adapter(bare(), watch=False)
    fed(adapter, run, range(0, 120), measured=measured)
    rows = [120, 130, 140]
    start = Adapter(bare(), watch=False)
    errors = [frozen_errors(a.model, run, a.snapshot(), rows, horizon=5.0).rmse for a in (adapter, start)]
    assert (np.sqrt((errors[0] ** 2).mean(0)) < np.sqrt((errors[1] ** 2).mean(0)) / 3).all()


def test_replay_keeps_what_was_learned_elsewhere():
    """Learn on the first half, then stay at one speed: the memory keeps the first half, plain SGD does not."""
    run = driven(vehicle(), duration=10.0)
    steady = driven(vehicle(), command=np.tile([80.0, 60, 60, 3, 3, 3], (201, 1)))
    left = {}
    for scheme in ({"scheme": "replay", "learning_rate": 0.5}, {"scheme": "sgd", "learning_rate": 0.5}):
        adapter = Adapter(with_networks(), scheme, guards="none", watch=False)
        fed(adapter, run)
        adapter.new_run()
        fed(adapter, steady)
        damping = adapter.model
        with torch.no_grad():
            predicted = damping(torch.tensor(run.eta), torch.tensor(run.nu), torch.tensor(run.wrench)).numpy()
        left[scheme["scheme"]] = np.sqrt(((predicted - run.nu_dot)[20:] ** 2).mean())
    assert left["replay"] < 0.7 * left["sgd"]


def test_frozen_errors_are_those_of_rollouts_one_by_one():
    run = driven(vehicle(), duration=4.0)
    models = [with_networks(seed) for seed in (0, 1, 2)]
    snapshots = [{n: p.detach() for n, p in m.damping.named_parameters()} for m in models]
    found = frozen_errors(models[0], run, snapshots, [0, 5, 12], horizon=2.0)
    for k, row in enumerate((0, 5, 12)):
        part = slice(row, row + 21)
        free = models[k].rollout(
            torch.tensor(run.eta[row]), torch.tensor(run.nu[row]), torch.tensor(run.wrench[part]),
            torch.tensor(run.t[part]),
        )  # fmt: skip
        np.testing.assert_allclose(found.error[k], run.nu[part] - free.nu.detach().numpy(), atol=1e-10)
    with pytest.raises(ConfigError, match="3 snapshots for 2 rows"):
        frozen_errors(models[0], run, snapshots, [0, 5])
    with pytest.raises(ConfigError, match="no window"):
        frozen_errors(models[0], run, snapshots, [30, 35, 38])
