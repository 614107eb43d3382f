"""Run windows free from their initial states, and move those states by small amounts."""

from __future__ import annotations

import torch
from torch import Tensor

from auvnn.effects import Sensed
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.models.free_running.rollout import rollout
from auvnn.physics.attitude import quat_conjugate, quat_multiply, quat_to_rotvec, rotvec_to_quat


def predict(
    model: GreyBox, windows: Windows, initial: Tensor, max_step: float | None = None, engine: str = "torch"
) -> tuple[Tensor, Tensor]:
    """Run every window free from its initial state.

    Args:
        model: the model.
        windows: B windows of L samples.
        initial: (B, 13): position, quaternion, velocity.
        max_step: longest step of the solver, s; the windows' own by default.
        engine: see `rollout`. Plain torch by default: a training that goes on after it was killed must end with the
            same bits, whatever has been compiled meanwhile.

    Returns:
        eta (B, L, 7) and nu (B, L, 6), of the vehicle itself and not of what sensors report.
    """
    run = rollout(
        model,
        initial[:, :7],
        initial[:, 7:],
        windows.inputs,
        windows.times,
        max_step=windows.max_step if max_step is None else max_step,
        warmup=windows.warmup,
        check=False,
        engine=engine,
    )
    return run.eta, run.nu


def initial_states(model: GreyBox, windows: Windows) -> Tensor:
    """Return the states (B, 13) that the first measurements stand for, and estimates of what has no sensor."""
    first = model.unsense(Sensed(windows.eta[:, 0, :3], windows.eta[:, 0, 3:], windows.nu[:, 0]))
    return torch.cat([first.position, first.quaternion, first.nu], dim=-1).detach()


def moved(initial: Tensor, change: Tensor) -> Tensor:
    """Return the states (B, 13) after small changes (B, 12) of position, attitude and velocity."""
    quaternion = quat_multiply(initial[:, 3:7], rotvec_to_quat(change[:, 3:6]))
    quaternion = quaternion / torch.linalg.norm(quaternion, dim=-1, keepdim=True)
    return torch.cat([initial[:, :3] + change[:, :3], quaternion, initial[:, 7:] + change[:, 6:]], dim=-1)


def away(begin: Tensor, end: Tensor) -> Tensor:
    """Return the change (..., 12) of position, attitude and velocity that leads from states to others, (..., 13) each."""
    turn = quat_to_rotvec(quat_multiply(quat_conjugate(begin[..., 3:7]), end[..., 3:7]))
    return torch.cat([end[..., :3] - begin[..., :3], turn, end[..., 7:] - begin[..., 7:]], dim=-1)
