"""The standard work: a 90 kg vehicle with full matrices and six 12-5-1 networks, on the paper's manoeuvre."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from auvnn.compiled import toolchain
from auvnn.damping.bank import DampingBank
from auvnn.models import GreyBox
from auvnn.physics.drag import damping_force
from auvnn.training.fit_damping import fit_damping
from auvnn.training.problem import DampingProblem
from auvnn.vehicle import load_vehicle

STEP, STEPS = 0.01, 3000
WRENCH = (100.0, 100.0, 100.0, 10.0, 10.0, 10.0)
NETWORKS = {"form": "mlp", "inputs": "quadratic"}


@dataclass(frozen=True)
class Work:
    """The model and its manoeuvre.

    Attributes:
        model: with networks in place of the damping matrices.
        truth: with the damping matrices; what the networks were trained on.
        eta0: (7,), at rest.
        nu0: (6,).
        command: (3001, 6), N and N m.
        times: (3001,), s.
    """

    model: GreyBox
    truth: GreyBox
    eta0: Tensor
    nu0: Tensor
    command: Tensor
    times: Tensor


def full(diagonal: list[float], seed: int, share: float) -> np.ndarray:
    """Return a symmetric positive definite matrix with this diagonal, of which no element is zero."""
    rng = np.random.default_rng(seed)
    root = np.sqrt(np.asarray(diagonal))
    mixed = rng.uniform(0.3, 1.0, (6, 6)) * rng.choice([-1.0, 1.0], (6, 6)) * share
    mixed = np.triu(mixed, 1)
    return np.outer(root, root) * (np.eye(6) + mixed + mixed.T)


def vehicle(damped: bool):
    """Return rov90 with full matrices, its centre of gravity off the origin, with or without its damping matrices."""
    plain = load_vehicle("rov90")
    added = full([54.0, 72.0, 360.0, 11.0, 43.5, 5.2], 1, 0.08)
    inertia = np.diag([10.0, 15.0, 13.0]) + 0.3 * (1 - np.eye(3))
    return replace(
        plain,
        added_mass=added,
        inertia=inertia,
        center_of_gravity=np.array([0.02, -0.01, 0.03]),
        linear_damping=full([250.0, 200.0, 175.0, 20.0, 20.0, 15.0], 2, 0.06) if damped else None,
        quadratic_damping=full([350.0, 350.0, 400.0, 100.0, 100.0, 75.0], 3, 0.06) if damped else None,
    )


def manoeuvre() -> tuple[Tensor, Tensor]:
    """Return commands and times of the paper's manoeuvre: a constant wrench for 15 s, then none."""
    times = STEP * torch.arange(STEPS + 1, dtype=torch.float64)
    command = torch.zeros(STEPS + 1, 6, dtype=torch.float64)
    command[: STEPS // 2] = torch.tensor(WRENCH, dtype=torch.float64)
    return command, times


def damping_of(truth: GreyBox, nu: Tensor) -> Tensor:
    """Return what the damping matrices say, (N, 6)."""
    return damping_force(nu, truth.known_linear, truth.known_quadratic)


def samples(truth: GreyBox, command: Tensor, times: Tensor) -> tuple[Tensor, Tensor]:
    """Return velocities of the manoeuvre and their damping, (3000, 6) each."""
    with torch.no_grad():
        still = torch.zeros(6, dtype=torch.float64)
        engine = "torch" if toolchain.compiler() is None else "compiled"
        run = truth.rollout(still, still, command, times, engine=engine)
        nu = run.nu[:STEPS]
        return nu, damping_of(truth, nu)


def standard_work(seed: int = 0) -> Work:
    """Return the work, with networks trained to 2 per mille on the manoeuvre, so that they damp as the matrices do."""
    truth = GreyBox(vehicle(True), actuation="wrench")
    command, times = manoeuvre()
    nu, damping = samples(truth, command, times)
    bank = DampingBank.from_description(NETWORKS, seed)
    fit_damping(bank, DampingProblem(nu, damping), seed=seed, callback=lambda r: max(r.train) < 2e-3)
    model = GreyBox(vehicle(False), (), bank, actuation="wrench")
    eta0 = torch.tensor([0, 0, 0, 1.0, 0, 0, 0], dtype=torch.float64)
    return Work(model, truth, eta0, torch.zeros(6, dtype=torch.float64), command, times)
