"""Does a model with other actuators predict the log better? Free running decides, which no feedback deceives.

A controller answers the noise of its sensors, so that under feedback commands and measured accelerations hang together
by the noise too, and a regression of one on the other is biased, at worst to the wrong sign. Free running from a measured
state knows only the commands: a thruster that is really exchanged or reversed sends it the wrong way.

Reference: Ljung (1999), System Identification, section 13.4, on feedback and bias.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.logs import Log
from auvnn.metrics.commands.stated import as_stated
from auvnn.metrics.rollouts import Scale, horizon_windows, roll_windows, scale_of
from auvnn.models import GreyBox

Array = NDArray[np.float64]
HORIZON = "5"
# Standard errors, over the windows, by which the change has to predict better.
GAIN = 3.0


def predicts_better(model: GreyBox, log: Log, allocation: Array) -> bool:
    """Whether a model with another allocation follows a log better in free running than it does as it is.

    Args:
        model: as stated.
        log: measurements.
        allocation: (6, n) from thrusts, N, to force and moment, N and N m, with the change.
    """
    windows, scale = horizon_windows(log, HORIZON, model.actuation), scale_of(log)
    if windows is None:
        return False
    windows = as_stated(model, windows)
    changed = model.rebuilt(model.copied_effects())
    changed.actuators.allocation.copy_(changed.actuators.allocation.new_tensor(allocation))
    before, after = (_squares(roll_windows(m, windows, scale).squared, scale) for m in (model, changed))
    gain = before - after
    # Windows overlap by half: two of them say little more than one.
    return bool(gain.sum() > GAIN * np.sqrt(2.0 * len(gain)) * gain.std())


def _squares(squared: Array, scale: Scale) -> Array:
    """Return each window's squared error over the excited velocities' variances, (B,)."""
    return (squared / scale.std**2)[:, scale.excited].sum(1)
