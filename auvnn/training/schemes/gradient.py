"""What the gradient schemes share: epochs, mini-batches, and the way back from a loss that is not finite."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor
from torch.func import functional_call

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError, ModelError
from auvnn.training.schemes.base import Samples, Scheme, SchemeTask, State, positive, relative_errors, whole

SCHEDULES = ("constant", "cosine")
MOST_RETREATS = 10


class GradientScheme(Scheme):
    """Gradient descent by automatic differentiation on the sum of the six relative squared errors.

    An epoch whose loss or gradient is not finite, or whose error is a thousand times the best, is taken back:
    the best parameters are restored, the step is halved, and after ten such retreats the scheme stops.

    Args:
        epochs: passes over the samples at most.
        learning_rate: first step size.
        schedule: `constant`, or `cosine` down to zero at the last epoch.
        batch_size: samples of a step; None: all of them.
        patience: epochs without a better error (held-out, where there is one) after which it stops.
        goal: stop when the worst relative error is down to this; None: no goal.
    """

    def __init__(
        self,
        *,
        epochs: int = 2000,
        learning_rate: float = 1e-2,
        schedule: str = "constant",
        batch_size: int | None = None,
        patience: int = 500,
        goal: float | None = None,
    ) -> None:
        """Check the options."""
        self.epochs = whole(epochs, "epochs")
        self.learning_rate = positive(learning_rate, "learning_rate")
        if schedule not in SCHEDULES:
            raise ConfigError(f"scheme option 'schedule' is {schedule!r}: there are {', '.join(SCHEDULES)}")
        self.schedule = schedule
        self.batch_size = None if batch_size is None else whole(batch_size, "batch_size")
        self.patience = whole(patience, "patience")
        self.goal = None if goal is None else positive(goal, "goal")
        self.warnings = []

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this scheme."""
        return {
            "epochs": self.epochs,
            "learning_rate": self.learning_rate,
            "schedule": self.schedule,
            "batch_size": self.batch_size,
            "patience": self.patience,
            "goal": self.goal,
        }

    def optimiser(self, parameters: list[Tensor]) -> torch.optim.Optimizer:
        """Return the optimiser of this scheme over the parameters."""
        raise TypeError(f"training scheme '{type(self).__name__}' does not name its optimiser")

    def begin(self, task: SchemeTask) -> None:
        """Draw the first weights, and evaluate them."""
        self.task, self.bank = task, task.bank
        if not task.warm:
            self.bank.reset(task.seed)
        self._generator = torch.Generator().manual_seed(task.seed)
        like = self.bank.input_scale
        assert isinstance(task.train, Samples)  # others are for schemes that say `sums_suffice`
        weight = task.train.weight
        # A mean over each axis' own samples: missing ones must not make the others count less.
        weight = weight * len(weight) / weight.sum(0).clamp_min(1e-300) / task.spread.square()
        self._train = Samples(task.train.nu.to(like), task.train.target.to(like), weight.to(like))
        self._parameters = dict(self.bank.named_parameters())
        self._epoch = self._retreats = self._since_best = 0
        self._factor = 1.0
        self._stopped: str | None = None if self._parameters else "there is nothing to learn"
        self._optimiser = self.optimiser(list(self._parameters.values())) if self._parameters else None
        self._best = {name: tensor.detach().clone() for name, tensor in self._parameters.items()}
        self._best_errors = self._errors()

    def _errors(self) -> tuple[Tensor, Tensor | None]:
        held = self.task.held_out
        train = relative_errors(self.bank, self.task.train, self.task.spread)
        return train, None if held is None else relative_errors(self.bank, held, self.task.spread)

    def _loss(self, rows: Tensor | slice) -> Tensor:
        data = self._train
        scales = {"input_scale": torch.ones_like(data.nu[0]), "output_scale": torch.ones_like(data.nu[0])}
        output = functional_call(self.bank, scales, (data.nu[rows],))
        return (data.weight[rows] * (output - data.target[rows]).square()).mean(0).sum()

    def step(self) -> None:
        """Do one epoch; take it back if it went wrong."""
        if self._optimiser is None:
            return
        share = self._epoch / self.epochs
        rate = self.learning_rate * self._factor
        for group in self._optimiser.param_groups:
            group["lr"] = rate * (0.5 + 0.5 * math.cos(math.pi * share) if self.schedule == "cosine" else 1.0)
        self._epoch += 1
        samples = len(self._train.nu)
        batches: list[Tensor | slice] = [slice(None)]
        if self.batch_size is not None and self.batch_size < samples:
            batches = list(torch.randperm(samples, generator=self._generator).split(self.batch_size))
        finite = all(self._descend(rows) for rows in batches)
        train, held = self._errors() if finite else self._best_errors
        score, best = (_score(*pair) for pair in ((train, held), self._best_errors))
        if not finite or not math.isfinite(score) or score > 1e3 * max(best, 1e-12):
            self._retreat()
        elif score < best:
            self._best_errors, self._since_best = (train, held), 0
            self._best = {name: tensor.detach().clone() for name, tensor in self._parameters.items()}
        else:
            self._since_best += 1
        self._stopped = self._stopped or self._reason()

    def _descend(self, rows: Tensor | slice) -> bool:
        """Take one step; return False, and take none, if the loss or its slope is not finite."""
        assert self._optimiser is not None  # step() returns before
        self._optimiser.zero_grad()
        loss = self._loss(rows)
        loss.backward()
        slopes = [tensor.grad for tensor in self._parameters.values() if tensor.grad is not None]
        if not bool(torch.isfinite(loss)) or not all(bool(torch.isfinite(slope).all()) for slope in slopes):
            return False
        self._optimiser.step()
        return True

    def _retreat(self) -> None:
        self._retreats += 1
        self._factor *= 0.5
        with torch.no_grad():
            for name, tensor in self._parameters.items():
                tensor.copy_(self._best[name])
        # The moments belong to the path that failed.
        self._optimiser = self.optimiser(list(self._parameters.values()))
        if self._retreats >= MOST_RETREATS:
            self._stopped = (
                f"the loss was not finite or exploded {MOST_RETREATS} times, though the step was halved "
                "each time; the best weights before are kept"
            )

    def _reason(self) -> str | None:
        if self.goal is not None and float(self._best_errors[0].max()) <= self.goal:
            return "goal reached"
        if self._since_best >= self.patience:
            return f"the error has not fallen for {self.patience} epochs"
        return "epoch limit reached" if self._epoch >= self.epochs else None

    def finished(self) -> str | None:
        """Return why the scheme stopped, or None."""
        return self._stopped

    def errors(self) -> tuple[Tensor, Tensor | None]:
        """Return the best relative errors so far."""
        return self._best_errors

    def save(self) -> State:
        """Return parameters, the best ones, the optimiser's moments and the random numbers' state."""
        train, held = self._best_errors
        tensors = {f"now.{name}": tensor.detach() for name, tensor in self._parameters.items()}
        tensors |= {f"best.{name}": tensor for name, tensor in self._best.items()}
        tensors |= {"best_train": train, "random": self._generator.get_state()}
        if held is not None:
            tensors["best_held_out"] = held
        moments = {} if self._optimiser is None else self._optimiser.state_dict()["state"]
        for number, state in moments.items():
            tensors |= {f"moment.{number}.{name}": v for name, v in state.items() if isinstance(v, Tensor)}
        plain = {
            "epoch": self._epoch,
            "retreats": self._retreats,
            "since_best": self._since_best,
            "factor": self._factor,
            "stopped": self._stopped,
        }
        return tensors, plain

    def load(self, tensors: dict[str, Tensor], plain: dict[str, Any]) -> None:
        """Take up what `save` returned."""
        with torch.no_grad():
            for name, tensor in self._parameters.items():
                tensor.copy_(tensors[f"now.{name}"])
                self._best[name] = tensors[f"best.{name}"].to(tensor).clone()
        self._best_errors = (tensors["best_train"].clone(), tensors.get("best_held_out"))
        self._generator.set_state(tensors["random"].clone())
        self._epoch, self._retreats = int(plain["epoch"]), int(plain["retreats"])
        self._since_best, self._factor = int(plain["since_best"]), float(plain["factor"])
        self._stopped = plain["stopped"]
        moments: dict[int, dict[str, Tensor]] = {}
        for name, tensor in tensors.items():
            if name.startswith("moment."):
                _, number, key = name.split(".", 2)
                moments.setdefault(int(number), {})[key] = tensor.clone()
        if moments and self._optimiser is None:
            raise ModelError(
                "the checkpoint trains parameters, but there is nothing to learn here: start again"
            )
        if self._optimiser is not None:
            whole_state = self._optimiser.state_dict()
            self._optimiser.load_state_dict({"state": moments, "param_groups": whole_state["param_groups"]})

    def finish(self) -> DampingBank:
        """Write the best parameters into the bank and return it."""
        with torch.no_grad():
            for name, tensor in self._parameters.items():
                tensor.copy_(self._best[name])
        return self.bank


def _score(train: Tensor, held: Tensor | None) -> float:
    """Return the one number by which epochs are compared."""
    return float((train if held is None else held).square().mean().sqrt())
