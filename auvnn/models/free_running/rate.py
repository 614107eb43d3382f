"""The state of a free run as one vector, its rate of change, and what is done to it after each step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from auvnn.models.inputs import Inputs
from auvnn.physics.attitude import quat_derivative, quat_normalize, quat_to_matrix
from auvnn.physics.products import matvec

if TYPE_CHECKING:
    from auvnn.models.equations_of_motion import Prepared
    from auvnn.models.grey_box import GreyBox

SIZE = 13
"""Size of the state: position, quaternion, velocity."""


def state_rate(
    model: GreyBox, y: Tensor, thrust: Tensor, row: Inputs, time: Tensor, prepared: Prepared | None
) -> Tensor:
    """Return the rate of the state y = [position, quaternion, nu], (..., 13).

    p_dot = R(q) v, q_dot = 1/2 q (0, omega), nu_dot as the model says

    Args:
        model: the model.
        y: (..., 13).
        thrust: what acts now, N, (..., n).
        row: inputs held over the interval.
        time: s, (...).
        prepared: body and inertia matrices, or None to work them out here.
    """
    position, quaternion, nu = y.split((3, 4, 6), dim=-1)
    rotation = quat_to_matrix(quaternion)
    return torch.cat(
        [
            matvec(rotation, nu[..., :3]),
            quat_derivative(quaternion, nu[..., 3:]),
            model.nu_dot(position, rotation, nu, thrust, row, time, prepared),
        ],
        dim=-1,
    )


def unit_attitude(y: Tensor) -> Tensor:
    """Return the state (..., 13) with its quaternion at unit length again."""
    return torch.cat([y[..., :3], quat_normalize(y[..., 3:7]), y[..., 7:]], dim=-1)
