"""Free-running error by horizon: windows restarted from measured states, compared with persistence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.effects import Sensed
from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.signals.noise import noise_std
from auvnn.metrics.commands.stated import as_stated
from auvnn.metrics.coordinates import Coordinates, coordinates, names_of, spread
from auvnn.metrics.free_run import initial_states, predict
from auvnn.metrics.likely_states import likely_states
from auvnn.metrics.windows import MAX_STEP, VELOCITY, Windows, cut_windows
from auvnn.models import GreyBox
from auvnn.models.free_running.rollout import LIMIT
from auvnn.models.free_running.stiffness import fastest_rate, followed

Array = NDArray[np.float64]
HORIZONS = ("0.5", "1", "2", "5", "10", "full")
NAMES = ("u", "v", "w", "p", "q", "r")
CUT, EXCITED = 10.0, 3.0
WARMUP = 3.0
# Steps are not cut below this, s: a model that asks for more is beyond what a comparison should wait for.
SHORTEST_STEP = 0.001


@dataclass(frozen=True)
class Scale:
    """What errors are measured by: standard deviation of each velocity, and which count as excited.

    Where a velocity has no sensor, the coordinate that it moves stands in its place where that was measured: x, y, z for
    u, v, w and phi, theta, psi for p, q, r, with the standard deviation of its change over 5 s.

    Attributes:
        std: (6,).
        excited: (6,).
        names: of the six channels.
    """

    std: Array
    excited: NDArray[np.bool_]
    names: tuple[str, ...] = NAMES


def scale_of(log: Log) -> Scale:
    """Return each velocity's standard deviation over a log, and whether it is over three times its noise."""
    nu = np.concatenate([run.nu for run in log.runs])
    noise = np.nanmean([np.asarray(noise_std(run.t, run.nu)) for run in log.runs], axis=0)
    std = np.nanstd(nu, axis=0)
    if log.estimated:
        names = names_of(log)
        moves, rough = spread(log, names)
        std, noise = np.where(np.isfinite(moves), moves, std), np.where(np.isfinite(moves), rough, noise)
        given = {n for run in log.runs for n in run.given}
        counts = np.array([n not in log.estimated and n not in given for n in names])
        return Scale(std, counts & (std > EXCITED * np.nan_to_num(noise)) & (std > 1e-9), names)
    return Scale(std, (std > EXCITED * np.nan_to_num(noise)) & (std > 1e-9))


@dataclass(frozen=True)
class Rolled:
    """Free runs of one horizon.

    Attributes:
        windows: what was run.
        predicted: (B, L, 6) velocities as the sensors would report them.
        squared: (B, 6) sum of squared errors over all samples but the first, cut where a window diverged.
        held: (B, 6) the same for holding the initial velocity.
        count: (B, 6) samples.
        diverged: (B,) whether the window left what is physical.
    """

    windows: Windows
    predicted: Array
    squared: Array
    held: Array
    count: Array
    diverged: NDArray[np.bool_]

    def nrmse(
        self, scale: Scale, chosen: NDArray[np.bool_] | slice = slice(None), held: bool = False
    ) -> Array:
        """Return each velocity's error over its standard deviation, (6,); NaN where it is not excited.

        Args:
            scale: of the velocities.
            chosen: windows that count.
            held: of holding the initial velocity, in the place of the model.
        """
        squared = (self.held if held else self.squared)[chosen].sum(0)
        with np.errstate(invalid="ignore", divide="ignore"):
            value = np.sqrt(squared / self.count[chosen].sum(0)) / scale.std
        return np.where(scale.excited, value, np.nan)

    def total(
        self, scale: Scale, chosen: NDArray[np.bool_] | slice = slice(None), held: bool = False
    ) -> float:
        """Return the mean error of the excited velocities.

        Args:
            scale: of the velocities.
            chosen: windows that count.
            held: of holding the initial velocity, in the place of the model.
        """
        value = self.nrmse(scale, chosen, held)
        return float(np.nanmean(value)) if np.isfinite(value).any() else float("nan")


def roll(model: GreyBox, log: Log, horizon: str, scale: Scale, engine: str = "torch") -> Rolled | None:
    """Run a model free over the windows of one horizon; None where no stretch is long enough.

    Windows start every half horizon, from measured states. Outliers of single samples do not count. Between samples
    commands go as the model states, and are held where it does not.

    Args:
        model: that is run.
        log: measurements.
        horizon: "full", or seconds as text.
        scale: of the velocities.
        engine: as in `rollout`.
    """
    windows = horizon_windows(log, horizon, model.actuation)
    return None if windows is None else roll_windows(model, as_stated(model, windows), scale, engine)


def horizon_windows(log: Log, horizon: str, kind: str) -> Windows | None:
    """Return the windows of one horizon, "full" or seconds; None where no stretch is long enough.

    Args:
        log: measurements.
        horizon: "full", or seconds as text.
        kind: of commands: "thrusters" or "wrench".
    """
    length = np.inf if horizon == "full" else float(horizon)
    try:
        return cut_windows(log, length, None if np.isinf(length) else 0.5 * length, warmup=WARMUP, kind=kind)
    except InputError:
        return None


def roll_windows(model: GreyBox, windows: Windows, scale: Scale, engine: str = "torch") -> Rolled:
    """Run a model free over windows that have been cut; `engine` as in `rollout`.

    Args:
        model: that is run.
        windows: B of them.
        scale: of the velocities.
        engine: as in `rollout`.
    """
    with torch.no_grad():
        start = initial_states(model, windows)
        first = windows.inputs.command[:, windows.warmup]
        rate = fastest_rate(model, start[:, :7], start[:, 7:], first)
        step = max(followed(MAX_STEP, rate), SHORTEST_STEP)
        if windows.estimated:
            start = likely_states(model, windows, step)
        eta, nu = predict(model, windows, start, step, engine)
        seen = model.sense(Sensed(eta[..., :3], eta[..., 3:], nu))
    return scored(windows, seen.nu.numpy(), scale, coordinates(windows, seen, scale.names))


def scored(windows: Windows, seen: Array, scale: Scale, instead: Coordinates | None = None) -> Rolled:
    """Return free runs with their errors, whoever predicted them.

    Args:
        windows: what was run.
        seen: (B, L, 6) predicted velocities as the sensors would report them; not finite once one has run away.
        scale: of the log.
        instead: coordinates that stand in the place of velocities without a sensor.
    """
    measured, mask = windows.nu.numpy(), windows.mask[..., VELOCITY].numpy().copy()
    gap, stay = measured - seen, measured - measured[:, :1]
    if instead is not None:
        gap[..., instead.places], stay[..., instead.places] = instead.gap, instead.stay
        mask[..., instead.places] = instead.mask
    mask[:, 0] = 0.0
    sound = (np.isfinite(seen) & (np.abs(seen) < LIMIT)).all(axis=-1)
    gone = np.maximum.accumulate(~sound, axis=1)
    diverged = gone.any(axis=1)
    error = np.where(gone[..., None], CUT * scale.std, gap)
    error[diverged] = np.clip(error[diverged], -CUT * scale.std, CUT * scale.std)
    return Rolled(
        windows,
        np.where(gone[..., None], np.nan, seen),
        (error**2 * mask).sum(1),
        (stay**2 * mask).sum(1),
        mask.sum(1),
        np.asarray(diverged),
    )


def rollout_table(
    model: GreyBox, log: Log, scale: Scale, horizons: tuple[str, ...] = HORIZONS
) -> tuple[dict[str, dict], dict[str, Rolled]]:
    """Return `rollout` of the comparison, and the runs behind it.

    Args:
        model: that is run.
        log: measurements.
        scale: of the velocities.
        horizons: "full", or seconds as text.
    """
    out: dict[str, dict] = {}
    kept: dict[str, Rolled] = {}
    for horizon in horizons:
        rolled = roll(model, log, horizon, scale)
        if rolled is None:
            out[horizon] = {
                **{n: {"rmse": None, "nrmse": None} for n in (*NAMES, *scale.names)},
                "total": None,
                "persistence": None,
                "noise_floor": None,
                "diverged": 0,
                "windows": 0,
            }
            continue
        with np.errstate(invalid="ignore", divide="ignore"):
            rmse = np.sqrt(rolled.squared.sum(0) / rolled.count.sum(0))
        nrmse = rolled.nrmse(scale)
        out[horizon] = {
            # Of a velocity without a sensor nothing is known; what stands in its place has a separate name.
            **{n: {"rmse": float("nan"), "nrmse": float("nan")} for n in NAMES if n not in scale.names},
            **{n: {"rmse": float(rmse[k]), "nrmse": float(nrmse[k])} for k, n in enumerate(scale.names)},
            "total": rolled.total(scale),
            "persistence": rolled.total(scale, held=True),
            "diverged": int(rolled.diverged.sum()),
            "windows": len(rolled.windows),
        }
        kept[horizon] = rolled
    return out, kept
