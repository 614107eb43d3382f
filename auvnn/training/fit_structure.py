"""Fit any of the paper's structures to a log, one step ahead: equation 14 and its like."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn

from auvnn.damping.bank import DampingBank
from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.models import GreyBox, Inputs
from auvnn.models.structures.base import Structure, learned_parameters
from auvnn.models.structures.damping import OneNetwork, velocity_features
from auvnn.models.structures.networks import Networks
from auvnn.models.structures.parallel import Parallel
from auvnn.models.structures.separate import Separate
from auvnn.physics.attitude import quat_to_matrix
from auvnn.physics.products import matvec
from auvnn.training.fit_damping import fit_damping
from auvnn.training.least_squares.batched import REASONS, LeastSquares, Rules
from auvnn.training.least_squares.joint import fit_jointly
from auvnn.training.least_squares.shared_network import SharedProblems
from auvnn.training.problem import DampingProblem


@dataclass(frozen=True)
class OneStepData:
    """What one-step training is given, sample by sample: states, what drove them, and measured accelerations.

    Attributes:
        position: NED, m, (N, 3).
        rotation: body to NED, (N, 3, 3).
        nu: (N, 6).
        thrust: of the actuators (or the wrench), N and N m, (N, n).
        nu_dot: (N, 6).
        run: run numbers (N,).
    """

    position: Tensor
    rotation: Tensor
    nu: Tensor
    thrust: Tensor
    nu_dot: Tensor
    run: Tensor

    @classmethod
    def of(cls, log: Log, model: GreyBox) -> OneStepData:
        """Return the usable samples of a log with measured accelerations, driven as the model is.

        Raises:
            InputError: the log has no accelerations, or no usable sample.
        """
        parts: list[tuple[Any, ...]] = []
        for run in log.runs:
            command = run.wrench if model.actuation == "wrench" else run.thrusters
            if run.nu_dot is None or command is None:
                raise InputError(
                    f"{log.name}: measured accelerations and {model.actuation} commands are needed here; "
                    "log du ... dr, or train by `auvnn train`, which estimates accelerations"
                )
            position = np.zeros((run.samples, 3)) if run.position is None else np.nan_to_num(run.position)
            columns = (position, run.quaternion, run.nu, command, run.nu_dot)
            good = run.valid & np.all([np.isfinite(c).all(-1) for c in columns], axis=0)
            parts.append((*(c[good] for c in columns), np.full(int(good.sum()), run.number)))
        joined = [torch.tensor(np.concatenate(column)) for column in zip(*parts, strict=True)]
        position, quaternion, nu, command, nu_dot, number = joined
        if not len(nu):
            raise InputError(f"{log.name}: no sample is complete: nothing to fit")
        return cls(position, quat_to_matrix(quaternion), nu, model.actuators.static(command), nu_dot, number)

    def predicted(self, model: GreyBox) -> Tensor:
        """Return the acceleration that a model gives at the measured states, (N, 6)."""
        with torch.no_grad():
            zero = torch.zeros((), dtype=self.nu.dtype)
            return model.nu_dot(self.position, self.rotation, self.nu, self.thrust, Inputs(self.thrust), zero)

    def damping_wrench(self, known: GreyBox) -> Tensor:
        """Return D(nu) nu = M (nu_dot of the known model - nu_dot measured), (N, 6): equation 14 of the paper."""
        return matvec(known.prepare().total, self.predicted(known) - self.nu_dot)


@dataclass(frozen=True)
class StructureFit:
    """How the fit of a structure went.

    Attributes:
        parameters: numbers that were fitted.
        samples: that they were fitted to.
        rmse: one-step error of the acceleration, (6,), m/s2 and rad/s2.
        relative_rmse: the same over the standard deviation of what the known model leaves, (6,).
        seconds: wall time.
        stopped: in words.
        details: of the damping fit, where that is what it was.
    """

    parameters: int
    samples: int
    rmse: tuple[float, ...]
    relative_rmse: tuple[float, ...]
    seconds: float
    stopped: str
    details: Mapping[str, Any]


def fit_structure(
    model: GreyBox,
    log: Log,
    *,
    scheme: str | Mapping[str, Any] = "levenberg_marquardt",
    held_out: Collection[int] | None = None,
    weight: Tensor | None = None,
    seed: int = 0,
    restarts: int = 2,
    max_iterations: int = 150,
    progress: Callable[[str], None] | None = None,
) -> StructureFit:
    """Fit what a structure learns to a log with measured accelerations; the model is changed in place.

    Damping banks are fitted by `fit_damping` to equation 14, one network with several outputs by the same iteration
    with a shared hidden layer (`SharedProblems`). The networks of figure 3 are joint least-squares problems:
    `fit_jointly` from several starting points, the best of which is kept.

    Args:
        model: a structure.
        log: what to fit to.
        scheme: of damping banks.
        held_out: runs that decide when to stop (of damping banks).
        weight: of the squared error of the damping wrench, (6,) (of damping banks).
        seed: of the starting points.
        restarts: starting points of joint problems.
        max_iterations: of joint problems.
        progress: called with the state of the work, in words.
    """
    began = time.perf_counter()
    data = OneStepData.of(log, model)
    bare = copy.deepcopy(model)
    _silence(bare)
    spread = (data.nu_dot - data.predicted(bare)).std(0).clamp_min(1e-12)
    details: dict[str, Any] = {}
    if not learned_parameters(model):
        stopped = "nothing to fit"
    elif isinstance(model.damping, DampingBank):
        problem = DampingProblem(data.nu, data.damping_wrench(bare), weight=weight, run=data.run)
        bank = model.damping
        fit = fit_damping(bank, problem, scheme=scheme, held_out=held_out, seed=seed)
        stopped = fit.stopped_because
        details = {"iterations": fit.iterations, "relative_rmse_of_wrench": list(fit.relative_rmse),
                   "warnings": list(fit.warnings)}  # fmt: skip
    else:
        fit_it = _fit_shared if isinstance(model, Parallel | OneNetwork) else _fit_joint
        stopped = fit_it(model, bare, data, spread, seed, restarts, max_iterations, progress)
    error = (data.predicted(model) - data.nu_dot).square().mean(0).sqrt()
    count = sum(p.numel() for p in learned_parameters(model))
    return StructureFit(
        count, len(data.nu), tuple(error.tolist()), tuple((error / spread).tolist()),
        time.perf_counter() - began, stopped, details,
    )  # fmt: skip


class _Nothing(nn.Module):
    def forward(self, nu: Tensor) -> Tensor:
        return torch.zeros_like(nu)


def _silence(model: GreyBox) -> None:
    """Make a copy of a structure say what it would without its learned part."""
    if isinstance(model, Structure):
        for part in model.learned.values():
            if isinstance(part, Networks):
                with torch.no_grad():
                    part.output_weight.zero_()
                    part.output_bias.zero_()
    elif model.damping is not None:
        model.damping = cast(DampingBank, _Nothing())


def _fit_joint(
    model: GreyBox,
    bare: GreyBox,
    data: OneStepData,
    spread: Tensor,
    seed: int,
    restarts: int,
    max_iterations: int,
    progress: Callable[[str], None] | None,
) -> str:
    assert isinstance(model, Structure)
    best: tuple[float, dict[str, Tensor], str] | None = None
    for number in range(restarts):
        generator = torch.Generator().manual_seed(1000 * seed + number)

        def told(iteration: int, cost: float, number: int = number) -> None:
            if progress is not None and iteration % 20 == 0:
                progress(
                    f"{model.structure}, start {number}, iteration {iteration}: relative error {cost**0.5:.3g}"
                )

        module, inputs, target, scale = _task(model, bare, data, spread, generator)
        names = {n: p for n, p in module.named_parameters() if p.requires_grad and "theta" not in n}
        fit = fit_jointly(module, names, inputs, target, scale, max_iterations=max_iterations, progress=told)
        if best is None or fit.cost < best[0]:
            state = {k: v.clone() for k, v in model.learned.state_dict().items()}
            best = (fit.cost, state, fit.stopped)
    if best is None:
        raise InputError(f"restarts={restarts}: give at least 1")
    model.learned.load_state_dict(best[1])
    return best[2]


def _fit_shared(
    model: GreyBox,
    bare: GreyBox,
    data: OneStepData,
    spread: Tensor,
    seed: int,
    restarts: int,
    max_iterations: int,
    progress: Callable[[str], None] | None,
) -> str:
    """Fit one network with several outputs as the six are fitted: starts side by side, the output layer solved for."""
    assert isinstance(model, Parallel | OneNetwork)
    if isinstance(model, Parallel):
        wrench = data.thrust @ model.actuators.allocation.mT
        x, y = model.features(data.nu, wrench, data.rotation), data.nu_dot - data.predicted(bare)
    else:
        x, y = velocity_features(data.nu), data.damping_wrench(bare)
    network = cast(Networks, next(iter(model.learned.values())))
    generator = torch.Generator().manual_seed(1000 * seed)
    network.fit_to_data(x, y, generator)
    scale = y.std(0).clamp_min(1e-12)
    rules = Rules(max(1, restarts), 20, max_iterations, 1e-3, 20, 30, 0.3, None)
    problems = SharedProblems(x / network.input_scale, y / scale, network.hidden)
    solver = LeastSquares(problems, None, torch.ones(1, dtype=torch.float64), rules, None, generator)
    while solver.running:
        solver.step()
        if progress is not None and solver.iteration % 50 == 0:
            error = float(solver.best()[2]) ** 0.5
            progress(f"{model.structure}, iteration {solver.iteration}: relative error {error:.3g}")
    theta, beta, _, _ = solver.best()
    layer = beta.view(network.outputs, network.hidden + 1) * (scale / network.output_scale)[:, None]
    hidden = theta.view(network.hidden, -1)
    with torch.no_grad():
        network.hidden_weight.copy_(hidden[:, :-1])
        network.hidden_bias.copy_(hidden[:, -1])
        network.output_weight.copy_(layer[:, :-1])
        network.output_bias.copy_(layer[:, -1])
    return REASONS[solver.reasons()[0]]


class _Whole(nn.Module):
    """A model's acceleration as a function of what changes from sample to sample."""

    def __init__(self, model: GreyBox) -> None:
        super().__init__()
        self.model = model

    def forward(self, position: Tensor, rotation: Tensor, nu: Tensor, thrust: Tensor) -> Tensor:
        zero = torch.zeros((), dtype=nu.dtype)
        return self.model.nu_dot(position, rotation, nu, thrust, Inputs(thrust), zero)


def _task(
    model: Structure, bare: GreyBox, data: OneStepData, spread: Tensor, generator: torch.Generator
) -> tuple[nn.Module, tuple[Tensor, ...], Tensor, Tensor]:
    """Return what is fitted, its inputs, targets and scales, from a fresh starting point."""
    if isinstance(model, Separate):
        wrench = data.damping_wrench(bare)
        if "velocity" in model.learned:
            cast(Networks, model.learned["velocity"]).fit_to_data(
                velocity_features(data.nu), wrench, generator
            )
        if "gravity" in model.learned:
            gravity = cast(Networks, model.learned["gravity"])
            rest = torch.zeros_like(wrench) if "velocity" in model.learned else wrench
            gravity.fit_to_data(data.rotation[:, 2, :], rest, generator)
            gravity.output_scale.copy_(wrench.square().mean(0).sqrt().clamp_min(1e-9))
        if "inverse_inertia" in model.learned:
            with torch.no_grad():
                for parameter in model.learned["inverse_inertia"].parameters():
                    parameter.zero_()
    return _Whole(model), (data.position, data.rotation, data.nu, data.thrust), data.nu_dot, spread
