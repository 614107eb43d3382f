"""Windows over which the model as stated can be run: one that runs away tells nothing, and must not stop the others."""

from __future__ import annotations

import numpy as np
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.errors import InputError
from auvnn.estimation.prediction_error import SINGULAR
from auvnn.logs import Log
from auvnn.metrics.commands.stated import as_stated
from auvnn.metrics.free_run import initial_states, predict
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.models.free_running.limits import LIMIT

# Lengths that are tried where the usual one is too long, s; share of the windows that must hold, and least number.
SHORTER = (2.0, 1.0, 0.5)
MOST, LEAST = 0.5, 4


def windows_that_hold(
    model: GreyBox, log: Log, window: float | None, driven: GreyBox | None = None
) -> tuple[Windows, list[str]]:
    """Return the windows of a log over which a model runs free without leaving what is physical, and remarks on that.

    Where it leaves that in more than half of them, shorter ones are taken, unless a length was asked for.

    Args:
        model: as stated.
        log: the log.
        window: length that was asked for, s.
        driven: the model by whose statement commands go between samples; None where they are held.

    Raises:
        InputError: too few windows, or the model runs away in all of them.
    """

    def cut(length: float | None) -> Windows:
        found = windows_for(model, log, length)
        return found if driven is None else as_stated(driven, found)

    windows = cut(window)
    if len(windows) < LEAST:
        cure = "record a longer log" if window is None else "choose a shorter window, or record a longer log"
        raise InputError(f"{log.name} gives only {len(windows)} windows of free running: {cure}")
    for length in (window, *(SHORTER if window is None else ())):
        if length is not None and length != window:
            windows = cut(length)
        good = _holds(model, windows)
        if good.all() and length == window:
            return windows, []
        if good.mean() >= MOST and good.sum() >= LEAST:
            gone = int((~good).sum())
            notes = (
                []
                if length == window
                else [f"windows of {length:g} s were taken: over longer ones the model runs away"]
            )
            if gone:
                notes.append(
                    f"{gone} of {len(good)} windows are left out: the model as given runs away in them"
                )
            return (windows.pick(good) if gone else windows), notes
    raise InputError(
        f"{model.vehicle.name} runs away from {log.name} within {length or SHORTER[-1]:g} s of free running: check the "
        "signs and sizes of its mass, added mass, damping and thrust"
    )


def _holds(model: GreyBox, windows: Windows) -> np.ndarray:
    """Return in which windows the model stays within what is physical from the measured states, (B,)."""
    with torch.no_grad():
        try:
            lean = model.without_absent()
            eta, nu = predict(lean, windows, initial_states(lean, windows))
        except SINGULAR:
            return np.zeros(len(windows), dtype=bool)
    fine = torch.isfinite(nu).all(-1) & torch.isfinite(eta).all(-1) & (nu.abs().amax(-1) < LIMIT)
    return fine.all(-1).numpy()
