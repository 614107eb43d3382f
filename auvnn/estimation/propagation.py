"""How changes of the state go on from interval to interval: small linear maps, and their product over time."""

from __future__ import annotations

import torch
from torch import Tensor

from auvnn.physics.attitude import quat_to_matrix, skew


def interval_maps(
    jac_state: Tensor, jac_theta: Tensor, quaternion: Tensor, nu: Tensor, steps: Tensor
) -> tuple[Tensor, Tensor]:
    """Return what every interval makes of the state's change, (B, L - 1, 12, 12), and of parameters, (B, L - 1, 12, P).

    Args:
        jac_state: of the acceleration, (B, L - 1, 6, 12).
        jac_theta: (B, L - 1, 6, P).
        quaternion: (B, L - 1, 4).
        nu: (B, L - 1, 6).
        steps: s, (B, L - 1).
    """
    count, intervals = steps.shape
    rotation = quat_to_matrix(quaternion)
    a = jac_state.new_zeros(count, intervals, 12, 12)
    a[..., 0:3, 3:6] = -rotation @ skew(nu[..., :3])
    a[..., 0:3, 6:9] = rotation
    a[..., 3:6, 3:6] = -skew(nu[..., 3:])
    a[..., 3:6, 9:12] = torch.eye(3, dtype=a.dtype, device=a.device)
    a[..., 6:12, :] = jac_state
    ha = a * steps[..., None, None]
    eye = torch.eye(12, dtype=a.dtype, device=a.device)
    # Horner's form of (exp(hA) - 1)/(hA), with as many terms as this step needs.
    terms = _terms(float(ha.abs().sum(-1).max()) if ha.numel() else 0.0)
    phi = eye + ha / terms
    for k in range(terms - 1, 1, -1):
        phi = eye + (ha / k) @ phi
    forward = eye + ha @ phi
    forcing = (phi * steps[..., None, None])[..., 6:] @ jac_theta
    return forward, forcing


def propagate(forward: Tensor, forcing: Tensor, defect: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Return the change of the state with initial state, (B, L, 12, 12), and parameters, (B, L, 12, P).

    With defects, the last column of the parameters is what they add up to, (B, L, 12, P + 1).

    Args:
        forward: what every interval makes of the state's change, see `interval_maps`, (B, L - 1, 12, 12).
        forcing: what it makes of the parameters, (B, L - 1, 12, P).
        defect: by how much each interval misses the trajectory, (B, L - 1, 12), or None.
    """
    count, intervals = forward.shape[:2]
    if defect is not None:
        forcing = torch.cat([forcing, defect.unsqueeze(-1)], dim=-1)
    # Time comes first, so that each step reads and writes what lies together.
    forward = forward.transpose(0, 1).contiguous()
    by_state = forcing.new_empty(intervals + 1, count, 12, 12)
    by_theta = forcing.new_empty(intervals + 1, count, 12, forcing.shape[-1])
    by_state[0], by_theta[0] = torch.eye(12, dtype=forcing.dtype, device=forcing.device), 0.0
    by_theta[1:] = forcing.transpose(0, 1)
    for k in range(intervals):
        torch.bmm(forward[k], by_state[k], out=by_state[k + 1])
        by_theta[k + 1].baddbmm_(forward[k], by_theta[k])
    return by_state.transpose(0, 1), by_theta.transpose(0, 1)


def _terms(norm: float) -> int:
    """Return how many terms of the series of (exp(x) - 1)/x leave less than 1e-7 at |x| = norm; 8 suffice."""
    left, terms = norm / 2.0, 1
    while (left > 1e-7 or terms < 3) and terms < 8:
        terms += 1
        left *= norm / (terms + 1)
    return terms
