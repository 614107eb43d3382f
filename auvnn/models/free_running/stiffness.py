"""How fast a model's own motion settles, and the step that follows it.

The explicit fixed-step solvers stay true while the step is below the shortest time constant of the velocities; lags
and delays of the actuators are in closed form and ask for no step at all.
Reference: Hairer and Wanner (1996), Solving Ordinary Differential Equations II, section IV.2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from auvnn.models.inputs import Inputs
from auvnn.physics.attitude import quat_to_matrix

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox

# Step times rate: rk4 explodes beyond 2.8; steps are cut to where its error is below a percent of what changes. Steps
# that are merely coarse are the caller's choice.
UNSTABLE, FINE = 2.0, 1.0
# More steps than this a rollout does not take: minutes would become days without a word.
MAX_STEPS = 5_000_000
# A run that diverged is tried again with steps shorter by at most this factor.
MOST_CUT = 200.0


def fastest_rate(model: GreyBox, eta: Tensor, nu: Tensor, command: Tensor) -> float:
    """Return the largest rate at which velocities settle or run away, max |eig d(nu_dot)/d(nu)|, 1/s.

    Args:
        model: the model.
        eta: (K, 7), states around which it is linearised.
        nu: (K, 6), m/s and rad/s.
        command: (K, n), with the thrust settled.
    """
    with torch.no_grad():
        sound = torch.isfinite(nu).all(-1) & torch.isfinite(eta).all(-1) & torch.isfinite(command).all(-1)
        eta, nu, command = eta[sound].detach(), nu[sound].detach(), command[sound].detach()
        if len(nu) == 0:
            return 0.0
        small = 1e-4 if nu.dtype == torch.float64 else 1e-2
        change = small * torch.cat(
            [torch.zeros_like(nu[:1, :6]), torch.eye(6, dtype=nu.dtype, device=nu.device)]
        )
        moved = nu.unsqueeze(1) + change
        wide = (*moved.shape[:-1],)
        position = eta[:, None, :3].expand(*wide, 3)
        rotation = quat_to_matrix(eta[:, 3:]).unsqueeze(1).expand(*wide, 3, 3)
        thrust = model.actuators.static(command).unsqueeze(1).expand(*wide, -1)
        inputs = Inputs(command.unsqueeze(1).expand(*wide, -1), None, None, None)
        time = torch.zeros(wide, dtype=nu.dtype, device=nu.device)
        rate = model.nu_dot(position, rotation, moved, thrust, inputs, time)
        slope = ((rate[:, 1:] - rate[:, :1]) / small).mT
        slope = slope[torch.isfinite(slope).all(-1).all(-1)]
        return float(torch.linalg.eigvals(slope.double()).abs().max()) if len(slope) else 0.0


def followed(max_step: float, rate: float) -> float:
    """Return the step that follows a rate, s: `max_step` unless that is too long to be stable."""
    return FINE / rate if rate * max_step > UNSTABLE else max_step


def words(rate: float, max_step: float) -> str:
    """Say that steps were cut because a model is stiff."""
    return (
        f"the model is stiff: velocities settle within {1e3 / rate:.3g} ms, so steps of {1e3 * max_step:.3g} ms were cut "
        f"to {1e3 * followed(max_step, rate):.3g} ms; check damping and mass"
    )


def slow_log(model: GreyBox, dt: float) -> list[str]:
    """Say which time constants of a model are so short that a log of this step cannot tell them from none."""
    found = []
    for effect in model.members:
        for parameter, value in zip(effect.parameters_of, effect.theta.detach().tolist(), strict=True):
            if (
                parameter.unit == "s"
                and parameter.name in ("time_constant", "delay")
                and 0.0 < value < 0.05 * dt
            ):
                found.append(
                    f"{effect.name}: {parameter.name} {value:.3g} s is far below the log's step of {dt:.3g} s: it is "
                    "followed exactly, but this log cannot tell it from none"
                )
    return found
