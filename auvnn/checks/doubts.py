"""What to doubt about a model and a log before their numbers are believed."""

from __future__ import annotations

import numpy as np
import torch

from auvnn.checks import actuators, unseen_current
from auvnn.logs import Log
from auvnn.metrics.windows import MAX_STEP
from auvnn.models import GreyBox
from auvnn.models.free_running.stiffness import fastest_rate, followed, slow_log, words

_STATES = 64  # of the log at which the model is linearised


def doubts(model: GreyBox, log: Log) -> list[str]:
    """Return warnings on a model and a log together: actuators, a current, a stiff model.

    Args:
        model: the model.
        log: measurements with the commands that drive the model.
    """
    return [*actuators.doubts(model, log), *unseen_current.doubts(model, log), *stiff(model, log)]


def stiff(model: GreyBox, log: Log) -> list[str]:
    """Warn where the model settles faster than its runs step, or a time constant is far below the log's step."""
    found = slow_log(model, float(np.median([run.dt for run in log.runs])))
    rates = []
    for run in log.runs:
        command = run.thrusters if model.actuation == "thrusters" else run.wrench
        if command is None or command.shape[1] != model.actuators.size:
            continue
        good = np.flatnonzero(run.valid & np.isfinite(command).all(1))
        rows = good[np.linspace(0, len(good) - 1, min(_STATES, len(good))).astype(int)] if len(good) else good
        eta = np.where(np.isfinite(run.eta[rows]), run.eta[rows], 0.0)
        rates.append(fastest_rate(model, *(torch.tensor(x) for x in (eta, run.nu[rows], command[rows]))))
    fastest = max(rates, default=0.0)
    if followed(MAX_STEP, fastest) < MAX_STEP:
        found.append(words(fastest, MAX_STEP))
    return found
