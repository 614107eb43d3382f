"""How accelerations are obtained where they were not measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import DerivativeEntry
from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log
from auvnn.logs.signals.derivatives import bandwidth_hz

METHODS = ("measured", "local_polynomial")


# Times that noise is drawn to find out what it leaves.
REPEATS = 4


@dataclass(frozen=True)
class Derivative:
    """How accelerations are obtained.

    Attributes:
        method: "measured", or "local_polynomial": the slope of the measured velocity beside the slope of what
            the model's acceleration adds up to, by the same filter, so that smoothing makes no difference
            between them. (The filter's smoothed value is another filter than its slope: a model's acceleration
            that went through the one would differ from a measured velocity that went through the other.)
        half_width: samples on either side of the centre.
        order: of the polynomial.
    """

    method: str
    half_width: int = 4
    order: int = 2

    def describe(self, dt: float) -> DerivativeEntry:
        """Return what the answers state of it; figures are comparable only at equal bandwidth."""
        if self.method == "measured":
            return {"method": "measured", "bandwidth_hz": 0.5 / dt}
        return {
            "method": f"local polynomial of order {self.order} over {2 * self.half_width + 1} samples",
            "bandwidth_hz": bandwidth_hz(dt, self.half_width, self.order),
        }


def choose_derivative(log: Log, options: Mapping[str, Any] | None = None) -> Derivative:
    """Return how to obtain accelerations from a log: measured ones where there are any.

    Args:
        log: the log.
        options: `method`, `half_width` and `order` in any part; the rest by default: nine samples of second
            order, or 0.2 s on either side where that is longer.

    Raises:
        ConfigError: an unknown option or method.
        InputError: measured accelerations are asked for and not there.
    """
    measured = all(run.nu_dot is not None for run in log.runs)
    return chosen_derivative(log.name, measured, float(np.median([run.dt for run in log.runs])), options)


def chosen_derivative(
    name: str, measured: bool, dt: float, options: Mapping[str, Any] | None = None
) -> Derivative:
    """Return what `choose_derivative` does for a log of this name and median step, s, whose accelerations are measured.

    Args:
        name: of the log, for messages.
        measured: whether it has accelerations.
        dt: median step, s.
        options: `method`, `half_width` (s) and `order`; those that are None or not given are chosen.

    Raises:
        ConfigError: an unknown option or method.
        InputError: measured accelerations are asked for and not there.
    """
    given = {k: v for k, v in dict(options or {}).items() if v is not None}
    for key in given:
        if key not in ("method", "half_width", "order"):
            raise ConfigError(unknown_name("derivative option", key, ("method", "half_width", "order")))
    method = given.get("method", "measured" if measured else "local_polynomial")
    if method not in METHODS:
        raise ConfigError(unknown_name("derivative method", str(method), METHODS))
    if method == "measured" and not measured:
        raise InputError(f"{name} has no columns du ... dr: use derivative.method=local_polynomial")
    width = int(given.get("half_width", max(4, round(0.2 / dt))))
    return Derivative(method, width, int(given.get("order", 2)))


def integrated(
    t: NDArray[np.float64], begin: NDArray[np.float64], end: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the trapezoidal integral of a signal, (N, k), zero at the start and NaN where the signal is.

    Args:
        t: s, (N,).
        begin: (N, k), the signal as each interval begins.
        end: (N, k), the signal as the interval before each sample ends; `begin` where it does not jump.
    """
    end = begin if end is None else end
    steps = 0.5 * np.diff(t)[:, None] * (begin[:-1] + end[1:])
    total = np.concatenate([np.zeros((1, begin.shape[1])), np.cumsum(np.nan_to_num(steps), axis=0)])
    return np.where(np.isfinite(begin), total, np.nan)
