"""What the commands between samples leave uncertain: the wrench by which plausible laws of them differ.

Part of it changes as the commands do. Another part is noise: a controller answers the noise of its sensors, and one that
is faster than the log does so between samples too. Whether it is faster cannot be asked of such a log by its likelihood:
the command at the end of an interval answers the noise of the very measurement that the interval's motion is compared
with, so that holding looks better than it is (Ljung 1999, System identification, section 13.4, on output errors in
closed loop). The noise is therefore counted as uncertain whatever the likelihood says of the holding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import f as f_distribution
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.commands.holding import LINEAR
from auvnn.diagnosis.noise_law.commands.law import Holding
from auvnn.diagnosis.residuals.forces import fins_of
from auvnn.effects.base import AXES
from auvnn.estimation.window_normal_equations import linearise
from auvnn.metrics.commands.paths import between
from auvnn.metrics.free_run import away
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# The difference of white noise from the mean of its neighbours has so many times its variance.
NEIGHBOURS = 1.5
# Share of that difference which must answer the sensors' noise, and its lag-one correlation below which it is white: of
# white noise that is -2/3, of single steps -1/2, and more of what is smooth.
ANSWERS, WHITE = 0.05, -0.52
# Share of what is fast in a command that is enough where its step answers too; levels at which chance is rejected.
CLOSED, ALPHA_FAST, ALPHA_STEP = 0.01, 1e-3, 0.05


@dataclass(frozen=True)
class UncertainWrench:
    """What the commands between samples leave uncertain, N and N m.

    Attributes:
        smooth: (6,) rms of what changes as the commands do.
        white: (6,) rms of what is independent from interval to interval.
        step: length of an interval, s.
        closed_loop: whether commands, as they were read, answer the sensors' noise.
    """

    smooth: Array
    white: Array
    step: float
    closed_loop: bool = False

    def over(self, time: Array) -> Array:
        """Return the rms of a force with given correlation times, (6,) s, that has the same power at low frequencies.

        Noise of variance s^2 over intervals h has there the density s^2 h, an Ornstein-Uhlenbeck force 2 s^2 T.
        """
        share = np.minimum(1.0, self.step / (2.0 * np.maximum(time, 1e-9)))
        return np.sqrt(self.smooth**2 + share * self.white**2)

    def to_dict(self) -> dict[str, float]:
        """Return the rms by degree of freedom, those with none left out."""
        whole = np.hypot(self.smooth, self.white)
        return {axis: float(value) for axis, value in zip(AXES, whole, strict=True) if value > 0.0}


def uncertain_wrench(end: FittedHypothesis, windows: Windows, held: Holding) -> UncertainWrench:
    """Return what the commands between samples leave uncertain.

    For smooth commands and such as go straight: the difference between cubic and straight line, and that between the
    mean thrust of a straight line (by Simpson's rule, exact for a quadratic curve) and the thrust of the mean command.
    For commands that change somewhere within an interval: the difference between held and straight line. For averaged
    ones: the difference between straight line and average. For all of them, held ones too: the noise of the sensors
    that they answer.

    Args:
        end: the explanation that leaves least.
        windows: of commands at the log's samples, as read.
        held: how commands go by this log.
    """
    model = end.fitted.model
    times = windows.times[:, windows.warmup :]
    step = float(np.median((times[:, 1] - times[:, 0]).numpy()))
    smooth, white = np.zeros(6), noise_answered(end, windows)
    if held.name == "averaged":
        white = np.maximum(white, law_differences(model, windows, held))
    elif held.changes:
        smooth = law_differences(model, windows, held)
    return UncertainWrench(smooth, white, step, in_closed_loop(end, windows))


def law_differences(model: GreyBox, windows: Windows, held: Holding) -> Array:
    """Return the rms of the wrench by which other laws of the commands differ from the one that was found, (6,).

    Args:
        model: whose actuators turn commands into a wrench.
        windows: of commands at the log's samples, as read.
        held: how commands go by this log; not held ones, which leave nothing open.
    """
    command = windows.inputs.command
    following = torch.cat([command[:, 1:], command[:, -1:]], dim=1)

    def line(share: float) -> Tensor:
        return _thrust(model, command + share * (following - command), windows)

    with torch.no_grad():
        straight = between(windows, LINEAR, "linear", curves=held.curves)
        if held.name == "ahead":
            return _rms([_wrench(model, windows) - _wrench(model, straight)], windows)
        if held.name == "averaged":
            return _rms([_wrench(model, straight) - _wrench(model, held.applied(windows))], windows)
        along = _thrust(model, straight.inputs.command, windows)
        cubic = between(windows, LINEAR, "smooth", curves=held.curves)
        bent = _wrench(model, cubic) - _wrench(model, straight)
        return _rms([bent, (line(0.0) + 4.0 * line(0.5) + line(1.0)) / 6.0 - along], windows)


def noise_answered(end: FittedHypothesis, windows: Windows) -> Array:
    """Return the rms of the wrench with which the commands answer the sensors' noise, (6,), N and N m.

    What differs from the mean of both neighbours is taken for fast, in commands and fins as in the errors of the
    measurements, and the one is regressed on the other. Where that explains a part of a command, and what is fast of it
    goes from sample to sample as white noise does, all of that counts: the rest answers noise that the log does not have,
    of the measurements between its samples.

    Args:
        end: the explanation whose errors stand for the noise.
        windows: those it was fitted to.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    fitted, given = end.fitted, windows.inputs
    told = _fast_errors(end, windows)
    if told is None:
        return np.zeros(6)
    usable, regressors = told

    def answered(values: Tensor) -> Tensor:
        """Return values without what answers the noise; where chance would do as much, as they are."""
        rows = values[:, windows.warmup :]
        target = _fast(rows)[usable].numpy()
        gains = np.linalg.lstsq(regressors, target, rcond=1e-8)[0]
        fitted_rows = regressors @ gains
        whole, share = (target**2).sum(0), regressors.shape[1] / len(regressors)
        own = np.maximum((fitted_rows**2).sum(0) - share * whole, 0.0)
        kept = np.sqrt(own / np.maximum((fitted_rows**2).sum(0), 1e-300) / NEIGHBOURS)
        # A controller that answers this noise answers that of the measurements between samples too.
        all_noise = (own > ANSWERS * whole) & (_lag_one_correlation(_fast(rows), usable) < WHITE)
        less = torch.zeros_like(rows)
        less[usable] = torch.as_tensor(np.where(all_noise, target / np.sqrt(NEIGHBOURS), fitted_rows * kept))
        return torch.cat([values[:, : windows.warmup], rows - less], dim=1)

    calm = replace(
        windows,
        inputs=replace(
            given,
            command=answered(given.command),
            fins=None if given.fins is None else answered(given.fins),
        ),
    )
    with torch.no_grad():
        return _rms([_wrench(fitted.model, windows) - _wrench(fitted.model, calm)], windows)


def in_closed_loop(end: FittedHypothesis, windows: Windows) -> bool:
    """Whether commands or fin angles answer the sensors' noise at their own sample, as only a controller's do.

    What is fast in the errors predicts a part of what is fast in a command. A small part counts too where errors predict
    the command's step from the sample before as well: where most errors are the model's own, and where fins follow
    slowly, the part is small. Where a velocity is held, the bends of a smooth command are predicted in open loop, too.

    Args:
        end: the explanation whose errors stand for the noise.
        windows: those it was fitted to.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    told, given = _fast_errors(end, windows), windows.inputs
    if told is None:
        return False
    usable, regressors = told
    for values in (given.command, given.fins):
        if values is None:
            continue
        rows = values[:, windows.warmup :]
        step = torch.cat([torch.zeros_like(rows[:, :1]), rows[:, 1:] - rows[:, :-1]], dim=1)
        share, chance = _predicted(_fast(rows)[usable].numpy(), regressors)
        a_part = (share > CLOSED) & (chance < ALPHA_FAST)
        steps = _predicted(step[usable].numpy(), regressors)[1] < ALPHA_STEP
        if ((share > ANSWERS) | (a_part & steps)).any():
            return True
    return False


def _predicted(target: Array, regressors: Array) -> tuple[Array, Array]:
    """Return the share of targets, (N, n), that regressors, (N, c), predict beyond chance, and the p-values, (n,).

    By the F test of a linear regression; a target that does not change is not predicted.
    """
    target = target - target.mean(0)
    left = target - regressors @ np.linalg.lstsq(regressors, target, rcond=1e-8)[0]
    count, own = regressors.shape
    whole = (target**2).sum(0)
    share = np.where(whole > 0.0, 1.0 - (left**2).sum(0) / np.maximum(whole, 1e-300), 0.0)
    ratio = share / own / (np.maximum(1.0 - share, 1e-12) / (count - own))
    return share - own / count, f_distribution.sf(ratio, own, count - own)


def _fast_errors(end: FittedHypothesis, windows: Windows) -> tuple[Tensor, Array] | None:
    """Return the samples (B, L) that have both neighbours, and the fast part of the errors there, (N, c).

    None where there are too few of them. Of an explanation about filtered trajectories the errors are those that these
    leave: free running with a model that is far off may not stay finite.
    """
    fitted = end.fitted
    if end.around is not None:
        error = away(end.around, torch.cat([windows.eta, windows.nu], dim=-1))
    else:
        error = torch.cat([r.error for r in linearise(fitted.model, windows, fitted.initial, ())])
    if not torch.isfinite(error[windows.mask[..., : error.shape[-1]] > 0]).all():
        raise np.linalg.LinAlgError("free running grows without bound")
    known = windows.mask[..., : error.shape[-1]] > 0
    fast, usable = _fast(torch.where(known, error, torch.zeros_like(error))), _inner(known, windows)
    regressors = fast[usable].numpy()
    size = regressors.std(axis=0) if len(regressors) else np.zeros(fast.shape[-1])
    moving = size > 0.0
    if not moving.any() or len(regressors) <= 2 * moving.sum():
        return None
    return usable, regressors[:, moving] / size[moving]


def _fast(values: Tensor) -> Tensor:
    """Return what differs from the mean of both neighbours, (B, L, ...); zero at the ends."""
    out = torch.zeros_like(values)
    out[:, 1:-1] = values[:, 1:-1] - 0.5 * (values[:, :-2] + values[:, 2:])
    return out


def _lag_one_correlation(fast: Tensor, usable: Tensor) -> Array:
    """Return the correlation of what is fast with what is at the next sample, (n,)."""
    pairs = usable[:, :-1] & usable[:, 1:]
    one, other = fast[:, :-1][pairs].numpy(), fast[:, 1:][pairs].numpy()
    return (one * other).sum(0) / np.maximum(0.5 * (one**2 + other**2).sum(0), 1e-300)


def _inner(known: Tensor, windows: Windows) -> Tensor:
    """Return which samples, (B, L), have both neighbours in their window, and measurements."""
    some = known.any(-1) & torch.as_tensor(np.arange(known.shape[1]) < windows.length[:, None])
    out = torch.zeros_like(some)
    out[:, 1:-1] = some[:, :-2] & some[:, 1:-1] & some[:, 2:]
    return out


def _rms(differences: list[Tensor], windows: Windows) -> Array:
    """Return the rms of several independent wrenches together, (6,), over the windows' intervals."""
    # The last interval of a window lacks the sample that its cubic goes through.
    count = differences[0].shape[1]
    seen = torch.as_tensor(np.arange(count) < windows.length[:, None] - 2)
    square = torch.stack([d**2 for d in differences]).sum(0)[seen]
    known = square[torch.isfinite(square).all(-1)]
    return torch.sqrt(known.mean(0)).numpy() if len(known) else np.zeros(6)


def _wrench(model: GreyBox, windows: Windows) -> Tensor:
    """Return the wrench of commands and fins, (B, L - 1, 6)."""
    return _thrust(model, windows.inputs.command, windows) + fins_of(model, windows)[:, :-1]


def _thrust(model: GreyBox, command: Tensor, windows: Windows) -> Tensor:
    """Return the wrench of commands, actuators settled, (B, L - 1, 6)."""
    return (model.actuators.static(command) @ model.actuators.allocation.mT)[:, windows.warmup : -1]
