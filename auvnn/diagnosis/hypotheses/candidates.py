"""What a diagnosis takes from a log: effects that it can judge, and windows of free running."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from auvnn.effects import EFFECTS
from auvnn.effects.registering import names_of
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log
from auvnn.metrics.windows import Windows, cut_windows
from auvnn.models import GreyBox

HORIZON, WARMUP = 5.0, 3.0
# Where velocities have no sensor, windows must be long beside the time in which the drag forgets how they began.
UNSEEN, MANY = 10.0, 60
# Share of a step between samples that the integrator then takes at most at once.
STEPS = 0.25


def candidates_for(
    model: GreyBox, log: Log, wanted: str | Sequence[str] | None, *, stated: bool = False
) -> tuple[list[str], dict[str, list[str]]]:
    """Return the effects that can be asked for, and for the others which channels they lack.

    Args:
        model: for its vehicle and actuation.
        log: for the channels that it has.
        wanted: one name or several; the whole catalogue where None.
        stated: whether effects that the model has are asked for too, for values other than it states. Not those with a
            shape: their tests hold where the effect is absent.
    """
    wanted = names_of(wanted)
    if isinstance(wanted, str):
        wanted = [wanted]
    names = EFFECTS.names() if wanted is None else list(dict.fromkeys(wanted))
    needs: dict[str, list[str]] = {}
    usable = []
    # A glider's wrench is worked out from its ballast, the water and its attitude: no actuator stands behind it.
    of_actuators = {"command", "delay", "respond", "thrust"}
    for name in names:
        kind = EFFECTS.get(name)
        absent = [c for c in kind.channels if not _has(log, c)]
        absent += kind.lacks(model.vehicle, model.actuation)
        if model.vehicle.glides and of_actuators & {*kind.hooks()}:
            absent += ["thrusters"]
        needs[name] = absent
        there = name in model.effect_names
        if not absent and (
            not there or (stated and not any(p.shape for p in model.effect(name).parameters_of))
        ):
            usable.append(name)
    return usable, needs


def _has(log: Log, channel: str) -> bool:
    if channel in ("phi", "theta", "psi"):
        return True
    return all(channel in run.channels for run in log.runs)


def windows_for(model: GreyBox, log: Log, window: float | None = None) -> Windows:
    """Cut a log for fitting: windows of 5 s, or shorter where that leaves fewer than twelve.

    Where velocities have no sensor, 10 s, and sixty samples at least.

    Args:
        model: says which commands drive it.
        log: the log.
        window: another length, s. Where disturbances rather than sensors limit the prediction, short windows
            tell more: errors that a disturbance leaves grow with time, those of a sensor do not.

    Raises:
        ConfigError: a length that is no positive number.
        InputError: no run is as long.
    """
    check_window_length(window)
    if window is not None:
        longest = max(run.duration for run in log.runs)
        if window > longest:
            raise InputError(
                f"window={window:g} s is longer than every run of {log.name} (the longest has {longest:.4g} s): "
                "choose a shorter window, or record longer runs"
            )
    most = HORIZON
    if any(n in log.estimated for n in "uvw"):
        most = max(UNSEEN, MANY * float(np.median([run.dt for run in log.runs])))
    horizon = float(np.clip(log.duration / 12, 1.0, most)) if window is None else float(window)
    windows = cut_windows(log, horizon, warmup=WARMUP, kind=model.actuation, partial=True)
    if log.estimated:
        # A slow log is of a slow vehicle; where these steps turn out too long, the search takes shorter ones.
        longest = STEPS * float(np.median([run.dt for run in log.runs]))
        windows = replace(windows, max_step=max(windows.max_step, longest))
    return windows


def check_window_length(window: float | None) -> None:
    """Refuse a length of windows that is no positive number.

    Raises:
        ConfigError: it is not.
    """
    if window is None:
        return
    if isinstance(window, bool) or not isinstance(window, (int, float)) or not 0 < window < np.inf:
        raise ConfigError(f"window={window} must be a number of seconds above zero")
