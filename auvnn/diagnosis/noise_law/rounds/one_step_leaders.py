"""Effects fitted one step ahead: which of them explain most of the accelerations, and the values from which to fit them.

A large effect is seldom where its slope at the null points: of fins that are mounted far off, those that the stated model
has beyond the stall have no slope at all. Fits under a law of the force, which explains whatever is not there yet, stay
near the null then. Fits to accelerations at the measured states have neither windows that diverge nor a force that takes
up what is missing: they are biased by the sensors' noise, and lead from far away to near the truth, in a fraction of a
second each. What leads there is fitted under the law, too, and from there.

Reference: Klein and Morelli (2006), Aircraft System Identification, section 5, for equation error before output error.
"""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.one_step.refit import OneStepRefit, RefittedEffect
from auvnn.diagnosis.stages.state import Setting
from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.metrics.derivative import choose_derivative

Array = NDArray[np.float64]
# Samples that are looked at, roughly, at most, and length of the stretches that are left out of a longer log, s.
SAMPLES, STRETCH = 6000, 15.0
# What is raised where accelerations or slopes are missing, or sums of them cannot be solved.
UNFITTED = (InputError, *UNSOLVED)


def fitted_one_step(asked: Setting) -> dict[str, Array]:
    """Return the values of effects fitted one step ahead, each alone; the one that explains most comes first.

    Effects that explain nothing are left out; without accelerations there are none.

    Args:
        asked: model, log and effects.
    """
    asked.say("fitting effects one step ahead")
    try:
        log = thinned(asked.log)
        beside = OneStepRefit(asked.model, log, choose_derivative(log, None))
    except UNFITTED:
        return {}
    found = dict(zip(asked.usable, asked.pool.run(_alone, beside, asked.usable), strict=True))
    fell = {name: one for name, one in found.items() if one is not None and one.fell > 0.0}
    return {n: np.array([*fell[n].values.values()]) for n in sorted(fell, key=lambda n: -fell[n].fell)}


def _alone(beside: OneStepRefit, name: str) -> RefittedEffect | None:
    """Return an effect fitted one step ahead, None where it cannot be: a task of an executor."""
    with suppress(*UNFITTED):
        return beside.alone(name, judged=False)
    return None


def thinned(log: Log) -> Log:
    """Return a log of about as many samples as are looked at: of a longer one, stretches that are evenly spread.

    Args:
        log: measurements.
    """
    every = math.ceil(log.samples / SAMPLES)
    if every == 1:
        return log
    parts = []
    for run in log.runs:
        rows = max(round(STRETCH / run.dt), 1)
        for k, begin in enumerate(range(0, len(run), rows)):
            if k % every == 0 and len(run) - begin >= min(rows, len(run)) // 2:
                parts.append(run.cut(slice(begin, begin + rows), len(parts)))
    return Log.from_runs(parts, name=log.name)
