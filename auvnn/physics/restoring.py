"""Weight and buoyancy."""

from __future__ import annotations

import torch

from auvnn.physics.attitude import skew
from auvnn.physics.products import cross, per_vector
from auvnn.shapes import Number, RestoringGain, Rotation, Vector3, Wrench


def restoring_gain(weight: Number, buoyancy: Number, cg: Vector3, cb: Vector3) -> RestoringGain:
    """Return the matrix G with g(eta) = G R' e_z, constant for a given vehicle.

    G = -[(W - B) I ; S(W r_g - B r_b)]

    Args:
        weight: N, a number or (...).
        buoyancy: N, a number or (...).
        cg: centre of gravity in body axes, m (..., 3).
        cb: centre of buoyancy in body axes, m (..., 3).

    Returns:
        (..., 6, 3): multiplied by the direction of down in body axes, the third row of R.
    """
    w = torch.as_tensor(weight, dtype=cg.dtype, device=cg.device)[..., None]
    b = torch.as_tensor(buoyancy, dtype=cg.dtype, device=cg.device)[..., None]
    force = (b - w)[..., None] * torch.eye(3, dtype=cg.dtype, device=cg.device)
    return torch.cat(torch.broadcast_tensors(force, skew(b * cb - w * cg)), -2)


def restoring_force(rotation: Rotation, weight: Number, buoyancy: Number, cg: Vector3, cb: Vector3) -> Wrench:
    """Return the restoring forces on the left-hand side of the equation of motion.

    g = -[f_g + f_b ; r_g x f_g + r_b x f_b] with f_g = R' [0 0 W]', f_b = -R' [0 0 B]'

    Args:
        rotation: body to world (NED) (..., 3, 3).
        weight: N, a number or (...).
        buoyancy: N, a number or (...).
        cg: centre of gravity in body axes, m (..., 3).
        cb: centre of buoyancy in body axes, m (..., 3).

    Returns:
        (..., 6), N and N m. Fossen 2011, section 4.1.
    """
    w, b = per_vector(weight), per_vector(buoyancy)
    down = rotation[..., 2, :]
    force = (b - w) * down
    moment = cross(b * cb - w * cg, down)
    if force.shape != moment.shape:
        force, moment = torch.broadcast_tensors(force, moment)
    return torch.cat((force, moment), -1)
