"""A look at what was learned: damping that adds energy, and where in the state space it does."""

from __future__ import annotations

import torch

from auvnn.damping.bank import DampingBank
from auvnn.training.problem import DampingProblem


def energy_warnings(bank: DampingBank, problem: DampingProblem, share: float = 0.01) -> list[str]:
    """Say if, and where, the learned damping drives the vehicle: nu . d(nu) < 0.

    Args:
        bank: the damping.
        problem: the samples at whose velocities it is looked at.
        share: of the largest power, below which a negative one is taken for round-off and noise.

    Returns:
        No sentence or one, with the share of the samples and the worst of them.
    """
    with torch.no_grad():
        force = bank(problem.nu.to(bank.input_scale)).double().cpu()
    power = (force * problem.nu).sum(-1)
    drives = power < -share * power.abs().max()
    if not bool(drives.any()):
        return []
    worst = int(power.argmin())
    velocity = ", ".join(f"{value:.2g}" for value in problem.nu[worst].tolist())
    return [
        f"the learned damping adds energy at {100 * float(drives.double().mean()):.1f} % of the samples, "
        f"most at nu = ({velocity}): {-float(power[worst]):.3g} W; the form 'dissipative' cannot do so"
    ]
