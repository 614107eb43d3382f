"""The default scheme: every degree of freedom as a separate small least-squares problem, all at once."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.damping.bank import DampingBank
from auvnn.damping.base import AXES, DampingForm
from auvnn.damping.mlp import MLP
from auvnn.damping.polynomial import Polynomial
from auvnn.errors import ConfigError
from auvnn.training.least_squares.batched import REASONS, LeastSquares, Rules
from auvnn.training.least_squares.forms import pack, unpack
from auvnn.training.least_squares.linear import solve_triangles
from auvnn.training.least_squares.networks import Problems
from auvnn.training.schemes.base import (
    SampleSums,
    Scheme,
    SchemeTask,
    State,
    positive,
    relative_errors,
    whole,
)

MOST_HIDDEN = 200


class LevenbergMarquardt(Scheme):
    """Deterministic, fast, and without a learning rate.

    The networks' normal equations are built by hand (`networks.py`), those of other forms by automatic
    differentiation (`forms.py`), and polynomials are solved for at once (`linear.py`). Several starting
    points run side by side; every `halve_every` iterations the worse half of them is dropped.

    Args:
        restarts: starting points of each degree of freedom.
        halve_every: iterations after which the worse half of the starting points is dropped.
        max_iterations: iterations at most.
        tolerance: a problem has converged when its squared error fell by less than this share
        window: within this many iterations.
        patience: accepted steps without a better held-out error after which a problem stops.
        damping: first value of the damping parameter mu.
        goal: stop a degree of freedom at this relative error; None: go on until it converges.
    """

    name = "levenberg_marquardt"
    sums_suffice = True

    def __init__(
        self,
        *,
        restarts: int = 4,
        halve_every: int = 20,
        max_iterations: int = 300,
        tolerance: float = 1e-3,
        window: int = 20,
        patience: int = 30,
        damping: float = 0.3,
        goal: float | None = None,
    ) -> None:
        """Check the options."""
        self.rules = Rules(
            restarts=whole(restarts, "restarts"),
            halve_every=whole(halve_every, "halve_every"),
            max_iterations=whole(max_iterations, "max_iterations"),
            tolerance=positive(tolerance, "tolerance", zero=True),
            window=whole(window, "window", least=2),
            patience=whole(patience, "patience"),
            damping=positive(damping, "damping"),
            goal=None if goal is None else positive(goal, "goal"),
        )
        self.warnings = []

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this scheme."""
        return {name: getattr(self.rules, name) for name in Rules.__dataclass_fields__}

    def begin(self, task: SchemeTask) -> None:
        """Solve what is linear, and set up the iteration for the rest."""
        self.task = task
        self._solvers: list[tuple[DampingForm, LeastSquares]] = []
        self.warnings = []
        generator = torch.Generator().manual_seed(task.seed)
        for form in task.bank.groups():
            if not list(form.parameters()):
                continue
            if type(form) is Polynomial:
                theta, doubts = solve_triangles(form, task.train.triangles(form))
                unpack(form, theta)
                self.warnings += doubts
                continue
            start = _inner(form) if task.warm else None
            held = None if task.held_out is None else _problems(form, task.held_out)
            spread = task.spread[list(form.axes)]
            solver = LeastSquares(_problems(form, task.train), held, spread, self.rules, start, generator)
            self._solvers.append((form, solver))
        self._fixed = relative_errors(task.bank, task.train, task.spread)
        self._fixed_held = None
        if task.held_out is not None:
            self._fixed_held = relative_errors(task.bank, task.held_out, task.spread)

    def step(self) -> None:
        """Do one iteration in every form that is still running."""
        for _, solver in self._solvers:
            solver.step()

    def finished(self) -> str | None:
        """Return the reasons, axis by axis where they differ."""
        if any(solver.running for _, solver in self._solvers):
            return None
        reasons: dict[str, list[int]] = {}
        for form, solver in self._solvers:
            for axis, reason in zip(form.axes, solver.reasons(), strict=True):
                reasons.setdefault(REASONS[reason], []).append(axis)
        if not reasons:
            return "solved directly"
        if len(reasons) == 1:
            return next(iter(reasons))
        words = {reason: " ".join(AXES[axis] for axis in sorted(axes)) for reason, axes in reasons.items()}
        return "; ".join(f"{axes}: {reason}" for reason, axes in words.items())

    def errors(self) -> tuple[Tensor, Tensor | None]:
        """Return the leading start's relative errors, on the training and on the held-out samples."""
        train = self._fixed.clone()
        held = None if self._fixed_held is None else self._fixed_held.clone()
        for form, solver in self._solvers:
            _, _, cost, score = solver.best()
            axes = list(form.axes)
            train[axes] = cost.sqrt() / self.task.spread[axes]
            if held is not None:
                held[axes] = score.sqrt() / self.task.spread[axes]
        return train, held

    def save(self) -> State:
        """Return the state of every form's iteration."""
        tensors: dict[str, Tensor] = {}
        plain: dict[str, Any] = {}
        for number, (_, solver) in enumerate(self._solvers):
            state, counters = solver.save()
            tensors.update({f"{number}.{name}": tensor for name, tensor in state.items()})
            plain[str(number)] = counters
        return tensors, plain

    def load(self, tensors: dict[str, Tensor], plain: dict[str, Any]) -> None:
        """Take up what `save` returned."""
        for number, (_, solver) in enumerate(self._solvers):
            head = f"{number}."
            own = {name[len(head) :]: tensor for name, tensor in tensors.items() if name.startswith(head)}
            solver.load(own, plain[str(number)])

    def finish(self) -> DampingBank:
        """Write the best parameters into the bank and return it."""
        for form, solver in self._solvers:
            theta, beta, _, _ = solver.best()
            if type(form) is MLP:
                _write_network(form, theta, beta)
            else:
                unpack(form, theta)
        return self.task.bank


def _problems(form: DampingForm, samples: SampleSums) -> Problems:
    if type(form) is MLP and form.hidden > MOST_HIDDEN:
        raise ConfigError(
            f"levenberg_marquardt takes networks of up to {MOST_HIDDEN} hidden units, not {form.hidden}: "
            "use scheme=adam, or fewer"
        )
    return samples.problems(form)


def _inner(form: DampingForm) -> Tensor:
    """Return the inner parameters that a form has now, one row per axis."""
    if type(form) is not MLP:
        return pack(form)
    layers = torch.cat([form.hidden_weight, form.hidden_bias[..., None]], -1)
    return layers.detach().cpu().double().flatten(1)


def _write_network(form: MLP, theta: Tensor, beta: Tensor) -> None:
    layers = theta.view(len(form.axes), form.hidden, 13)
    with torch.no_grad():
        form.hidden_weight.copy_(layers[..., :12])
        form.hidden_bias.copy_(layers[..., 12])
        form.output_weight.copy_(beta[:, : form.hidden])
        if form.output_bias is not None:
            form.output_bias.copy_(beta[:, form.hidden])
