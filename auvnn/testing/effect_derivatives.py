"""What every physical effect promises to those who differentiate and fit it."""

from __future__ import annotations

import numpy as np
import torch
from torch.func import jacfwd, jacrev, vmap

from auvnn.effects import Effect
from auvnn.testing.one_effect import built
from auvnn.testing.scene import EXAMPLE, as_function, make_scene, require, require_close
from auvnn.vehicle import Vehicle

Kind = type[Effect]


def has_right_gradient(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check the derivatives in the parameters: `gradcheck` in reverse, differences in forward mode.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    # As many commands as it takes for each to have either sign.
    model, scene = built(kind, vehicle, actuation), make_scene(vehicle, actuation, runs=4, rows=2, warmup=1)
    outputs, theta = as_function(model, scene)
    mix = torch.randn(
        4, outputs(theta).numel(), generator=torch.Generator().manual_seed(1), dtype=torch.float64
    )
    torch.autograd.gradcheck(
        lambda x: mix @ outputs(x), (theta.requires_grad_(),), eps=1e-6, rtol=1e-5, atol=1e-7
    )
    theta = theta.detach()
    slope = jacfwd(outputs)(theta)
    for i, p in enumerate(model.model.effect(kind.name).parameters_of):
        step = torch.zeros_like(theta)
        step[i] = 1e-4 * p.scale
        with torch.no_grad():
            difference = (outputs(theta + step) - outputs(theta - step)) / (2 * step[i])
        require_close(slope[:, i], difference, 1e-5, f"{kind.name}.{p.name}: derivative")
        moved = float((slope[:, i] * p.scale).abs().max())
        require(moved > 1e-9, f"{kind.name}.{p.name} moves nothing that the model predicts")


def transforms(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check that `torch.func` sees through it, as the diagnosis needs: jacrev = jacfwd, vmap = loop.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    model, scene = built(kind, vehicle, actuation), make_scene(vehicle, actuation, runs=2, rows=2, warmup=1)
    outputs, theta = as_function(model, scene)
    require_close(
        jacrev(outputs)(theta), jacfwd(outputs)(theta), 1e-10, f"{kind.name}: jacrev against jacfwd"
    )
    null = torch.tensor([p.null for p in model.model.effect(kind.name).parameters_of], dtype=theta.dtype)
    require(
        bool(torch.isfinite(jacfwd(outputs)(null)).all()),
        f"{kind.name}: derivative at the null is not finite",
    )
    several = torch.stack([null, theta, 0.5 * (null + theta)])
    with torch.no_grad():
        looped = torch.stack([outputs(t) for t in several])
    require_close(vmap(outputs)(several), looped, 1e-12, f"{kind.name}: vmap against a loop")


def recovers(
    kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters", tolerance: float = 1e-6
) -> None:
    """Check that noise-free data made with the effect give its parameters back, by least squares.

    The tolerance is relative to the parameters' distance from the null.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
        tolerance: relative error that is allowed.
    """
    from scipy.optimize import least_squares

    model, scene = built(kind, vehicle, actuation), make_scene(vehicle, actuation, runs=8, rows=3, warmup=2)
    outputs, truth = as_function(model, scene)
    described = model.model.effect(kind.name).parameters_of
    null = torch.tensor([p.null for p in described], dtype=truth.dtype)
    low, high, scale = (np.array([getattr(p, k) for p in described]) for k in ("low", "high", "scale"))
    jacobian = jacfwd(outputs)
    with torch.no_grad():
        data = outputs(truth)
    # Where the null says nothing the fit starts at a probe's distance, as the diagnosis does.
    start = null + (0.8 if any(p.probes for p in described) else 0.3) * (truth - null)
    with torch.no_grad():
        fit = least_squares(
            lambda x: (outputs(torch.tensor(x)) - data).numpy(),
            start.numpy(),
            jac=lambda x: jacobian(torch.tensor(x)).numpy(),  # pyright: ignore[reportArgumentType]
            bounds=(low, high),
            x_scale=scale,
            xtol=1e-14,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=40,
        )
    error = np.abs(fit.x - truth.numpy()) / np.maximum(np.abs((truth - null).numpy()), 1e-12)
    worst = int(error.argmax())
    require(
        error[worst] <= tolerance,
        f"{kind.name}.{described[worst].name}: recovered as {fit.x[worst]:.9g} "
        f"instead of {float(truth[worst]):.9g}",
    )
