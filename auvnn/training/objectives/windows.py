"""Short free runs to train on: which windows, which channels, and how well a model follows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.errors import InputError
from auvnn.estimation.sensitivity import Response, respond
from auvnn.estimation.window_normal_equations import CHUNK, LOOSE, TRUST, motion
from auvnn.estimation.window_simulation import output_error
from auvnn.logs import Log
from auvnn.metrics.commands.stated import as_stated
from auvnn.metrics.free_run import initial_states, moved
from auvnn.metrics.windows import ACCELERATION, POSITION, Windows, cut_windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# History from which the state of lagging actuators is worked out, s.
HISTORY = 3.0
# A window whose error is beyond this many standard deviations of the motion has left what is physical.
LOST = 100.0
# Fewest windows in which there is anything to learn.
FEWEST = 4


def training_windows(model: GreyBox, log: Log, horizon: float) -> Windows:
    """Cut a log into windows that follow one another, judged by velocity and attitude.

    Measured accelerations are left out, because the velocities of a window hold what they say and more;
    positions, because they are known far worse than the velocities that they are the sums of, unless these have no
    sensor.

    Args:
        model: for its actuation and its lags.
        log: that is cut.
        horizon: length of the windows, s.

    Raises:
        InputError: no stretch is long enough, or there are too few windows.
    """
    lagging = model.using("respond") or model.using("command") or model.using("steer")
    warmup = HISTORY if lagging else 0.0
    windows = cut_windows(log, horizon, warmup=warmup, kind=model.actuation, partial=True)
    if len(windows) < FEWEST:
        raise InputError(
            f"{log.name} gives only {len(windows)} windows of {horizon:g} s to train on: "
            "use a longer log or a shorter objective.window"
        )
    mask = windows.mask.clone()
    if not any(n in windows.estimated for n in "uvw"):
        mask[..., POSITION] = 0.0
    mask[..., ACCELERATION] = 0.0
    return as_stated(model, replace(windows, nu_dot=None, mask=mask))


@dataclass(frozen=True)
class ShootingSums:
    """Normal equations of the subnetworks' weights over all windows, best initial states taken out.

    Attributes:
        hessian: (P, P).
        slope: (P,).
        cost: (B,) weighted squared error by window, after its initial state is fitted.
        channel: (18,) squared error in SI units, the same way.
        count: (18,) samples.
        change: (B, 12) best change of the initial states.
        follow: (B, 12, P) how that change falls with the weights: change - follow @ dw.
    """

    hessian: Array
    slope: Array
    cost: Array
    channel: Array
    count: Array
    change: Tensor
    follow: Tensor


class Shots:
    """Windows with separate initial states, which are fitted along (multiple shooting).

    Args:
        model: for the states that the first measurements stand for.
        windows: B windows.
    """

    def __init__(self, model: GreyBox, windows: Windows) -> None:
        """Start from the measured states."""
        self.windows, self.initial = windows, initial_states(model, windows)
        self.floor = TRUST * motion(windows) + 1e-9
        self.size = np.maximum(motion(windows), 1e-6)

    def usable(self, model: GreyBox) -> NDArray[np.bool_]:
        """Return which windows the model can follow at all, (B,)."""
        error = output_error(model, self.windows, self.initial)
        return (error.abs().amax(1) < LOST * torch.as_tensor(self.size)).all(-1).numpy()

    def keep(self, chosen: NDArray[np.bool_]) -> None:
        """Go on with some of the windows."""
        index = np.flatnonzero(chosen)
        self.windows, self.initial = self.windows.pick(index), self.initial[torch.as_tensor(index)]

    def cost(self, model: GreyBox, initial: Tensor, sigma: Array) -> float:
        """Return the weighted squared error of all windows from given states; infinite where one diverges.

        Args:
            model: that is run.
            initial: states of the windows, (B, 13).
            sigma: standard deviation of each channel, (18,); infinite where it does not count.
        """
        total = float((output_error(model, self.windows, initial) * _weights(sigma)).square().sum())
        return total if np.isfinite(total) else np.inf

    def settle(
        self, model: GreyBox, sigma: Array | None = None, rounds: int = 2
    ) -> tuple[ShootingSums, Array]:
        """Fit the initial states alone; return the sums without weights and each channel's error, (18,).

        Args:
            model: that is run.
            sigma: standard deviation of each channel, (18,); from the errors themselves where None.
            rounds: of Gauss-Newton steps.
        """
        fixed = sigma
        if sigma is None:
            seen = self.windows.mask.sum((0, 1)).numpy() > 0
            sigma = np.where(seen, 100 * self.floor + 1e-6, np.inf)
        sums = self.sums(model, sigma, weights=False)
        for _ in range(rounds):
            initial = moved(self.initial, sums.change)
            if np.isfinite(self.cost(model, initial, sigma)):
                self.initial = initial
            if fixed is None:
                sigma = self.spread(sums, 0)
            sums = self.sums(model, sigma, weights=False)
        return sums, sigma

    def judge(self, model: GreyBox, sigma: Array) -> float:
        """Return the root mean square of the weighted error with initial states that fit; infinite if any diverges.

        The initial states go along with the model from one call to the next.
        """
        sums = self.sums(model, sigma, weights=False)
        value = float(np.sqrt(np.abs(sums.cost.sum()) / max(sums.count[np.isfinite(sigma)].sum(), 1.0)))
        if not np.isfinite(value):
            return np.inf
        initial = moved(self.initial, sums.change)
        if np.isfinite(self.cost(model, initial, sigma)):
            self.initial = initial
        return value

    def spread(self, sums: ShootingSums, parameters: int) -> Array:
        """Return each channel's root-mean-square error for the degrees of freedom spent, (18,)."""
        spent = (12 * len(sums.cost) + parameters) * sums.count / max(sums.count.sum(), 1.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            value = np.sqrt(sums.channel / np.maximum(sums.count - spent, 0.25 * sums.count))
        return np.where(sums.count > 0, np.maximum(value, self.floor), np.inf)

    def sums(self, model: GreyBox, sigma: Array, *, weights: bool, names: Sequence[str] = ()) -> ShootingSums:
        """Linearise towards the initial states, effects' parameters and, if asked for, the subnetworks' weights.

        Args:
            model: about which it is linearised.
            sigma: standard deviation of each channel, (18,); infinite where it does not count.
            weights: whether by the subnetworks' weights too.
            names: effects by whose parameters.
        """
        used = np.flatnonzero(np.isfinite(sigma) & (self.windows.mask.sum((0, 1)).numpy() > 0))
        scale = torch.as_tensor(1.0 / sigma[used])
        parts = []
        for begin in range(0, len(self.windows), CHUNK):
            part = slice(begin, begin + CHUNK)
            answer = respond(model, self.windows.pick(part), self.initial[part], names, weights=weights)
            parts.append(_projected(answer, used, scale))
        hessian, slope = sum(p[0] for p in parts), sum(p[1] for p in parts)
        channel = np.zeros(18)
        channel[used] = sum(p[3] for p in parts)
        return ShootingSums(
            np.asarray(hessian),
            np.asarray(slope),
            np.concatenate([p[2] for p in parts]),
            channel,
            self.windows.mask.sum((0, 1)).numpy(),
            torch.cat([p[4] for p in parts]),
            torch.cat([p[5] for p in parts]),
        )


def _weights(sigma: Array) -> Tensor:
    return torch.as_tensor(np.where(np.isfinite(sigma), 1.0 / sigma, 0.0))


def _projected(answer: Response, used: NDArray[np.int64], scale: Tensor) -> tuple:
    """Take the best initial state out of one chunk of windows; see `Sums` for what comes back."""
    error, state = answer.error[..., used] * scale, answer.state[:, :, used] * scale[:, None]
    slopes = answer.parameters[:, :, used] * scale[:, None]
    count, rows = len(error), error.shape[1] * len(used)
    loose = torch.diag(torch.as_tensor(1.0 / LOOSE)).expand(count, 12, 12)
    q, r = torch.linalg.qr(torch.cat([state.reshape(count, rows, 12), loose], dim=1))
    both = torch.cat([error.reshape(count, rows, 1), slopes.reshape(count, rows, -1)], dim=-1)
    along = q[:, :-12].mT @ both
    # One product over all windows at once: their own matrices are not needed.
    flat, projected = both.flatten(0, 1), along.flatten(0, 1)
    total = flat.mT @ flat - projected.mT @ projected
    cost = both[..., 0].square().sum(1) - along[..., 0].square().sum(1)
    solved = torch.linalg.solve_triangular(r, along, upper=True)
    remaining = answer.left(solved[..., 0])
    remaining = torch.where(answer.error != 0, remaining, torch.zeros_like(remaining))[..., used]
    return (
        total[1:, 1:].numpy(),
        total[1:, 0].numpy(),
        cost.numpy(),
        remaining.square().sum((0, 1)).numpy(),
        solved[..., 0],
        solved[..., 1:],
    )
