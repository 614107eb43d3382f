"""Drag that never gives energy: what learned damping says, without the part of it that would push the vehicle on."""

from __future__ import annotations

import torch
from torch import Tensor

# By this much more than what is missing is taken, so that rounding never leaves a push.
BEYOND = 1e-9
# Small beside any motion, and still a number in single precision, in which some exports hold constants.
SMALLEST = 1e-30


def passive(learned: Tensor, known: Tensor, nu: Tensor, weight: Tensor) -> Tensor:
    """Return learned damping d with which the drag as a whole gives no energy, at every velocity.

    nu . (D + d) >= min(0, nu . D), D the drag outside the subnetworks. Where d fails this it is moved by the
    shortest way that does not: along W nu, W the weight. Elsewhere, and across the motion, it stays as it is.

    Args:
        learned: d (..., 6), N and N m, positive against the motion.
        known: D (..., 6), the same of the drag that is stated.
        nu: velocity through the water (..., 6), m/s and rad/s.
        weight: (6,) positive: force per velocity that counts as one.

    Returns:
        (..., 6).

    Reference: the projection on a half-space in the metric of W^-1; Boyd and Vandenberghe (2004), section 8.1.1.
    """
    stated = (nu * known).sum(-1, keepdim=True)
    power = stated + (nu * learned).sum(-1, keepdim=True)
    missing = torch.clamp(torch.clamp(stated, max=0.0) - power, min=0.0)
    way = weight * nu
    size = torch.clamp((nu * way).sum(-1, keepdim=True), min=SMALLEST)
    return learned + way * ((missing + BEYOND * missing) / size)
