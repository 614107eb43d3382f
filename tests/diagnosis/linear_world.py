"""Logs as plain linear algebra: windows of errors that are linear in every parameter, made with numpy alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, has_stated_uncertainty, lay_out, priors, scales
from auvnn.estimation.prediction_error import Fitted
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.models import GreyBox
from tests.small_logs import small_vehicle

STATED = 0.15
GROUPS = ["added_mass", "linear_damping", "quadratic_damping", "inertia"]
CANDIDATES = ["ocean_current", "net_buoyancy", "thruster_lag", "added_mass", "cg_offset"]


def layout(candidates=CANDIDATES, uncertainty=STATED) -> Layout:
    """Return the layout of the small vehicle: four uncertain groups and some candidates."""
    return lay_out(GreyBox(small_vehicle(uncertainty=uncertainty)), candidates)


@dataclass
class World:
    """Sensitivities of B windows of n white unit-variance errors to all P parameters, (B, n, P)."""

    layout: Layout
    jacobian: np.ndarray
    run: np.ndarray

    @classmethod
    def random(cls, at: Layout, windows=150, samples=20, strength=4.0, mixing=0.7, seed=0, runs=3) -> World:
        """Return a world whose parameters all look alike to some degree.

        Args:
            at: the parameters.
            windows: B.
            samples: n.
            strength: the whole log's length of a parameter's trace at its plausible size, in standard errors.
            mixing: share of each parameter's trace that is one of a few shapes that all have.
            seed: of the draw.
            runs: the windows belong to.
        """
        random = np.random.default_rng(seed)
        size = np.concatenate([scales(at, n) for n in at.names])
        own = random.normal(size=(windows, samples, len(size)))
        common = random.normal(size=(windows, samples, 3)) @ random.normal(size=(3, len(size))) / np.sqrt(3)
        trace = np.sqrt(1 - mixing**2) * own + mixing * common
        return cls(
            at, trace * strength / np.sqrt(windows * samples) / size, np.arange(windows) * runs // windows
        )

    @property
    def means(self) -> np.ndarray:
        """Stated values of all parameters, (P,)."""
        return np.concatenate([self.layout.means[n] for n in self.layout.names])

    def drawn(self, random: np.random.Generator, **changed: float | np.ndarray) -> np.ndarray:
        """Return true parameters: uncertain ones drawn by their stated amounts, the rest at the null plus a change."""
        truth = self.means.copy()
        for name, share in has_stated_uncertainty(self.layout.model).items():
            columns = self.layout.columns[name]
            truth[columns] *= 1 + share * random.normal(size=len(columns))
        for name, change in changed.items():
            truth[self.layout.columns[name]] = self.layout.means[name] + change
        return truth

    def errors(
        self, truth: np.ndarray, random: np.random.Generator, noise: Callable | None = None
    ) -> np.ndarray:
        """Return measured minus predicted at the stated values, (B, n); the noise is white unless given."""
        draw = noise or (lambda random, shape: random.normal(size=shape))
        return self.jacobian @ (truth - self.means) + draw(random, self.jacobian.shape[:2])

    @cached_property
    def hessian(self) -> np.ndarray:
        """J^T J by window, (B, P, P)."""
        return np.einsum("bni,bnj->bij", self.jacobian, self.jacobian)

    def statistics(self, errors: np.ndarray, at: np.ndarray | None = None) -> Statistics:
        """Return the sums at parameters `at`; the stated ones by default."""
        e = errors if at is None else errors - self.jacobian @ (at - self.means)
        windows, samples = e.shape
        zeros = np.zeros((windows, 18))
        count = zeros.copy()
        count[:, 6] = samples
        return Statistics(
            self.hessian,
            np.einsum("bni,bn->bi", self.jacobian, e),
            np.sum(e**2, 1),
            zeros,
            count,
            zeros,
            zeros,
            self.run,
            np.arange(windows),
        )

    def fitted_null(self, errors: np.ndarray, base: list[str], free: tuple[str, ...] = ()) -> np.ndarray:
        """Return all parameters with the base fitted by dense least squares, its prior as more rows, (P,)."""
        theta, columns = self.means.copy(), self.layout.of(base)
        if len(columns):
            pull = np.diag(np.sqrt(priors(self.layout, base, free).precision))
            flat = self.jacobian.reshape(-1, len(theta))[:, columns]
            theta[columns] += np.linalg.solve(flat.T @ flat + pull**2, flat.T @ errors.ravel())
        return theta

    @cached_property
    def _model(self) -> GreyBox:
        return self.layout.model.rebuilt(self.layout.model.copied_effects())

    def at(self, theta: np.ndarray, names: list[str]) -> Layout:
        """Return the layout with some effects' parameters at `theta`, until it is called again."""
        model = self._model
        set_parameters(model, names, theta)
        return replace(self.layout, model=model)


def fitted(world, errors, effects):
    """Return the explanation that a dense least-squares fit gives, and its columns in the world."""
    names = [*GROUPS, *(e for e in effects if e not in GROUPS)]
    columns = world.layout.of(names)
    held = priors(world.layout, names, effects)
    flat = world.jacobian.reshape(-1, world.jacobian.shape[-1])[:, columns]
    theta = world.means[columns] + np.linalg.solve(
        flat.T @ flat + np.diag(held.precision), flat.T @ errors.ravel()
    )
    everything = world.means.copy()
    everything[columns] = theta
    sums = world.statistics(errors, everything).columns(columns)
    sigma = np.where(np.arange(18) == 6, 1.0, np.inf)
    fit = Fitted(
        world.layout.model, tuple(names), theta, torch.zeros(len(errors), 13), sigma, sums, held, 0.0, True, 1
    )
    return FittedHypothesis(
        tuple(effects), fit, tuple(names), 0.0, np.zeros(len(errors)), np.full(len(errors), 20.0)
    ), columns


def drawn(world, seed, **changed):
    random = np.random.default_rng(seed)
    return world.errors(world.drawn(random, **changed), random)
