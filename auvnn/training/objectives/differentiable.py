"""Free running through torchdiffeq: the gradient of short runs' error by automatic differentiation."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor, nn
from torch.func import functional_call

from auvnn.errors import ConfigError, InputError
from auvnn.estimation.window_simulation import window_error
from auvnn.metrics.free_run import moved
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.models.free_running.torchdiffeq_solver import FIXED, solve
from auvnn.progress import Progress
from auvnn.training.objectives.base import Refined, Tell
from auvnn.training.objectives.free_running import FreeRunning
from auvnn.training.objectives.weights import get_weights, set_weights
from auvnn.training.objectives.windows import Shots
from auvnn.training.schemes.base import positive, whole

# Share of a step by which the windows' spacing in time may differ before they have no common time axis.
SAME_TIMES = 1e-3
MOST_RETREATS = 6
# A gradient this many times the median of those before it has exploded.
EXPLODED = 1e3
# A loss this many times the least so far has exploded too.
LOUDER = 1e3
# Epochs between two looks at the windows left out, which cost as much as several epochs.
EVERY = 5
# Bounds how far weights may go of which the windows say nothing, in the subnetworks' scaled numbers.
PRIOR = 0.1


class Differentiable(FreeRunning):
    """The same error as `rollout`, made small by Adam along gradients through torchdiffeq's solver.

    The runs of all windows are one batch; their initial states are parameters in addition to the weights. The weights
    are moved along the axes of their information, w = w_0 + L^-T z with L L^T = J^T J + 1 / prior^2, worked out
    once: weights of such small networks are so unequal that no common step size would serve them. An epoch
    whose loss or gradient is not finite or explodes is taken back: the best parameters are restored and the
    step is halved, and after six such retreats training ends.

    Args:
        window: length of the windows, s.
        epochs: passes over all windows at most.
        learning_rate: first step size, in standard errors of the weights; it falls to zero along a cosine.
        method: fixed-step method of torchdiffeq.
        patience: epochs without a better error on the windows left out, after which it stops.
        start: as for `rollout`.

    Reference: Chen et al. (2018), Neural ordinary differential equations; here the solver's own operations are
    differentiated, not the adjoint equation.
    """

    name = "rollout_torchdiffeq"
    option_names = ("window", "epochs", "learning_rate", "method", "patience", "start")

    def __init__(
        self,
        *,
        window: float = 5.0,
        epochs: int = 60,
        learning_rate: float = 0.3,
        method: str = "rk4",
        patience: int = 20,
        start: str = "best",
    ) -> None:
        """Check the options."""
        super().__init__(window, patience, start)
        self.epochs = whole(epochs, "epochs")
        self.learning_rate = positive(learning_rate, "learning_rate")
        if method not in FIXED:
            raise ConfigError(f"objective.method={method}: there are {', '.join(FIXED)}")
        self.method = method

    def descend(self, model: GreyBox, shots: Shots, judge: Shots, warnings: list[str], tell: Tell) -> Refined:
        """Step until nothing is gained; see the class."""
        return _Descent(self, model, shots, judge, warnings, tell).run()


class _Descent:
    """One training under way."""

    def __init__(
        self,
        options: Differentiable,
        model: GreyBox,
        shots: Shots,
        judge: Shots,
        warnings: list[str],
        tell: Tell,
    ) -> None:
        self.options, self.model, self.shots, self.judge = options, model, shots, judge
        self.warnings, self.tell = warnings, tell
        _, sigma = shots.settle(model)
        _, self.scale = judge.settle(model)
        self.times, self.offset = common_times(shots.windows)
        self.weight = torch.as_tensor(np.where(np.isfinite(sigma), 1.0 / sigma, 0.0))
        self.count = float((shots.windows.mask * (self.weight > 0)).sum())
        # In units of what the initial states are known by, so that one step size serves states and weights.
        unit = np.where(np.isfinite(sigma[:12]), sigma[:12], 0.0)
        self.unit = torch.as_tensor(unit)
        self.change = nn.Parameter(torch.zeros(len(shots.windows), 12, dtype=torch.float64))
        information = shots.sums(model, sigma, weights=True).hessian
        factor = np.linalg.cholesky(information + PRIOR**-2 * np.eye(len(information)))
        self.factor = torch.as_tensor(factor)
        assert model.damping is not None
        model.requires_grad_(False)
        self.first = torch.as_tensor(get_weights(model))
        self.shapes = {f"damping.{n}": p.shape for n, p in model.damping.named_parameters()}
        self.along = nn.Parameter(torch.zeros_like(self.first))
        self.free = [self.along, self.change]

    def weights(self) -> Tensor:
        """Return all weights of the subnetworks, (P,)."""
        step = torch.linalg.solve_triangular(self.factor.mT, self.along[:, None], upper=True)
        return self.first + step[:, 0]

    def optimiser(self, rate: float) -> torch.optim.Optimizer:
        """Return a fresh optimiser; the initial states, fitted already, move less."""
        return torch.optim.Adam(
            [{"params": [self.along], "share": 1.0}, {"params": [self.change], "share": 0.1}], lr=rate
        )

    def loss(self) -> Tensor:
        """Return the mean weighted squared error of all windows."""
        windows = self.shots.windows
        initial = moved(self.shots.initial, self.change * self.unit)
        weights = self.weights().split([shape.numel() for shape in self.shapes.values()])
        named = {n: w.view(s) for (n, s), w in zip(self.shapes.items(), weights, strict=True)}
        run = _Run(self.model, self.options.method)
        eta, nu = functional_call(
            run,
            {f"model.{n}": w for n, w in named.items()},
            ((initial[:, :7], initial[:, 7:]), windows, self.times, self.offset),
        )
        error = window_error(self.model, windows, eta, nu)
        return (error * self.weight).square().sum() / self.count

    def run(self) -> Refined:
        """Descend until nothing is gained."""
        options, rate, retreats, since = self.options, self.options.learning_rate, 0, 0
        optimiser, reason = self.optimiser(rate), "epoch limit reached"
        best, judged, train, sizes = self._state(), [self.judge.judge(self.model, self.scale)], [], []
        for epoch in range(options.epochs):
            optimiser.zero_grad()
            loss = self.loss()
            good = bool(torch.isfinite(loss))
            if good:
                loss.backward()
                slopes = [p.grad for p in self.free if p.grad is not None]
                size = float(torch.sqrt(sum((s.square().sum() for s in slopes), torch.zeros(()))))
                usual = float(np.median(sizes)) if sizes else math.inf
                good = (
                    math.isfinite(size)
                    and size < EXPLODED * usual
                    and float(loss.detach()) < LOUDER * _least(train)
                )
            if not good:
                retreats, rate = retreats + 1, rate / 2
                self._restore(best)
                optimiser = self.optimiser(rate)
                if retreats >= MOST_RETREATS:
                    reason = (
                        f"the loss or its gradient was not finite or exploded {MOST_RETREATS} times, though the "
                        "step was halved each time; the best weights before are kept"
                    )
                    break
                continue
            train.append(math.sqrt(float(loss.detach())))
            sizes.append(size)
            fall = 0.5 + 0.5 * math.cos(math.pi * epoch / options.epochs)
            for group in optimiser.param_groups:
                group["lr"] = rate * fall * group["share"]
            optimiser.step()
            since += 1
            if epoch % EVERY == EVERY - 1:
                self._write()
                judged.append(self.judge.judge(self.model, self.scale))
                words = f"rollout epoch {epoch + 1}: error on windows left out {judged[-1]:.4g}"
                self.tell(Progress(words, epoch + 1, options.epochs, rough=True))
                if judged[-1] < min(judged[:-1]):
                    since, best = 0, self._state()
            if since >= options.patience:
                reason = "the error on the windows left out no longer falls"
                break
        self._restore(best)
        self.model.requires_grad_(True)
        return Refined(self.model, tuple(train), tuple(judged), reason, tuple(self.warnings))

    def _state(self) -> list[Tensor]:
        return [p.detach().clone() for p in self.free]

    def _restore(self, values: list[Tensor]) -> None:
        with torch.no_grad():
            for parameter, value in zip(self.free, values, strict=True):
                parameter.copy_(value)
        self._write()

    def _write(self) -> None:
        """Put the present weights into the model."""
        set_weights(self.model, self.weights().detach().numpy())


class _Run(nn.Module):
    """Free runs of a model through torchdiffeq, as a module, so that its weights can be given from outside."""

    def __init__(self, model: GreyBox, method: str) -> None:
        super().__init__()
        self.model, self.method = model, method

    def forward(
        self, state: tuple[Tensor, Tensor], windows: Windows, times: Tensor, offset: Tensor
    ) -> tuple[Tensor, Tensor]:
        return solve(
            self.model, state, windows.inputs, times, self.method, warmup=windows.warmup, offset=offset
        )


def _least(train: list[float]) -> float:
    return min(train) ** 2 if train else math.inf


def common_times(windows: Windows) -> tuple[Tensor, Tensor]:
    """Return the time axis that all windows share, (warmup + L,), and each window's offset to it, (B,).

    Raises:
        InputError: the windows are not evenly sampled alike; torchdiffeq takes one time axis for a batch.
    """
    offset = windows.times[:, windows.warmup]
    relative = windows.times - offset[:, None]
    longest = int(np.argmax(windows.length))
    axis = relative[longest]
    steps = float((axis[1:] - axis[:-1]).median())
    # Rows after the end of a shorter window do not count, but their time goes on here.
    rows = torch.arange(axis.shape[0])[None, :]
    inside = rows < windows.warmup + torch.as_tensor(windows.length)[:, None]
    if bool(((relative - axis).abs() * inside > SAME_TIMES * steps).any()):
        raise InputError(
            "the log is not evenly sampled, and torchdiffeq takes one time axis for all windows: "
            "use objective=rollout"
        )
    return axis, offset
