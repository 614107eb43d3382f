"""Free running through the own integrator: multiple shooting over short windows, by damped Gauss-Newton."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.metrics.free_run import moved
from auvnn.models import GreyBox
from auvnn.progress import Progress
from auvnn.training.objectives.base import Refined, Tell
from auvnn.training.objectives.free_running import FreeRunning
from auvnn.training.objectives.weights import get_weights, set_weights
from auvnn.training.objectives.windows import ShootingSums, Shots
from auvnn.training.schemes.base import positive, whole

Array = NDArray[np.float64]
# A step that no damping makes good is given up after this many trials.
TRIALS = 8


class Shooting(FreeRunning):
    """The error of free runs over short windows, whose initial states are fitted along.

    minimises sum over windows and samples of |(y - y_hat(x0, w)) / sigma|^2 + |(w - w_0) / prior|^2

    with y velocity and attitude, x0 each window's own initial state, w all weights of the subnetworks and w_0
    those of the one-step fit; sigma follows the errors that are left, channel by channel. No derivative is
    taken of what was measured, so noise stays where it is: in the outputs. A step that makes the error larger,
    or lets a run diverge, is taken back and tried again shorter. The weights that do best on windows left out
    are kept, and training ends when those no longer gain.

    Args:
        window: length of the windows, s.
        iterations: steps at most.
        prior: standard deviation of the weights about the one-step fit, in the subnetworks' scaled numbers.
        patience: steps without a better error on the windows left out, after which it stops.
        start: `best`, or `given`: where accelerations were measured, whether a one-step fit on accelerations
            estimated from the velocities may take the place of the given one if it follows windows better.

    Reference: Bock (1983) for multiple shooting; Ljung (1999), section 7, for the prediction error.
    """

    name = "rollout"
    option_names = ("window", "iterations", "prior", "patience", "start")

    def __init__(
        self,
        *,
        window: float = 5.0,
        iterations: int = 12,
        prior: float = 0.1,
        patience: int = 4,
        start: str = "best",
    ) -> None:
        """Check the options."""
        super().__init__(window, patience, start)
        self.iterations = whole(iterations, "iterations")
        self.prior = positive(prior, "prior")

    def descend(self, model: GreyBox, shots: Shots, judge: Shots, warnings: list[str], tell: Tell) -> Refined:
        """Step until nothing is gained; see the class."""
        return _Descent(self, model, shots, judge, warnings, tell).run()


class _Descent:
    """One training under way."""

    def __init__(
        self,
        options: Shooting,
        model: GreyBox,
        shots: Shots,
        judge: Shots,
        warnings: list[str],
        tell: Tell,
    ) -> None:
        self.options, self.model, self.shots, self.judge = options, model, shots, judge
        self.warnings, self.tell = warnings, tell
        self.first = self.best = get_weights(model)
        _, self.sigma = shots.settle(model)
        _, self.scale = judge.settle(model)

    def run(self) -> Refined:
        """Step until nothing is gained."""
        options, damping, since = self.options, 1e-3, 0
        weights, reason = self.first, "iteration limit reached"
        judged = [self.judge.judge(self.model, self.scale)]
        train: list[float] = []
        sums = self.shots.sums(self.model, self.sigma, weights=True)
        for number in range(1, options.iterations + 1):
            if not train:
                train.append(_error(sums))
            taken = self._step(sums, weights, damping)
            if taken is None:
                reason = "no step lowers the error, or every one lets a run diverge"
                break
            weights, damping, gain = taken
            self.sigma = self.shots.spread(sums, 0)
            sums = self.shots.sums(self.model, self.sigma, weights=True)
            train.append(_error(sums))
            judged.append(self.judge.judge(self.model, self.scale))
            words = f"rollout step {number}: error on windows left out {judged[-1]:.4g}"
            self.tell(Progress(words, number, options.iterations, rough=True))
            if judged[-1] < min(judged[:-1]):
                since = 0 if judged[-1] < 0.999 * min(judged[:-1]) else since + 1
                self.best = weights
            else:
                since += 1
            if since >= options.patience:
                reason = "the error on the windows left out no longer falls"
                break
            if gain < 1e-6:
                reason = "converged: the error no longer falls"
                break
        set_weights(self.model, self.best)
        return Refined(self.model, tuple(train), tuple(judged), reason, tuple(self.warnings))

    def _step(self, sums: ShootingSums, weights: Array, damping: float) -> tuple[Array, float, float] | None:
        """Take one step; return weights, damping and relative gain, or None where no step is good."""
        precision = self.options.prior**-2
        away = weights - self.first
        hessian = sums.hessian + precision * np.eye(len(weights))
        slope = sums.slope - precision * away
        scale = np.diag(hessian)
        now = self.shots.cost(self.model, moved(self.shots.initial, sums.change), self.sigma)
        now += precision * float(away @ away)
        for _ in range(TRIALS):
            step = np.linalg.solve(hessian + damping * np.diag(scale), slope)
            set_weights(self.model, weights + step)
            trial = moved(self.shots.initial, sums.change - sums.follow @ torch.as_tensor(step))
            then = self.shots.cost(self.model, trial, self.sigma)
            then += precision * float((away + step) @ (away + step))
            if then < now:
                self.shots.initial = trial
                return weights + step, max(damping / 4, 1e-9), 1 - then / now
            damping *= 8
        set_weights(self.model, weights)
        return None


def _error(sums: ShootingSums) -> float:
    """Return the root mean square of the weighted error."""
    return float(np.sqrt(sums.cost.sum() / max(sums.count.sum(), 1.0)))
