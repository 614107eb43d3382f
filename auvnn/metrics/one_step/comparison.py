"""Measured and predicted accelerations through the same filter, asked again as parameters move."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from auvnn.logs import Run
from auvnn.logs.signals.derivatives import LocalPolynomial
from auvnn.metrics.derivative import Derivative
from auvnn.metrics.one_step.replay import OneStepReplay, accelerations, velocities
from auvnn.models import GreyBox

Array = NDArray[np.float64]


class RunComparison:
    """Measured and predicted acceleration of one run through the same filter; asked again as parameters move.

    Args:
        model: the model; where its parameters change later, `update` before asking again.
        run: measurements, as they are to be compared: `Run.cleaned` is without spikes of single samples.
        derivative: how accelerations are obtained.

    Raises:
        InputError: the run lacks the commands that drive the model.
    """

    def __init__(self, model: GreyBox, run: Run, derivative: Derivative) -> None:
        """Filter what was measured."""
        self.replay = OneStepReplay(model, run)
        self._filter: LocalPolynomial | None = None
        if derivative.method == "measured":
            assert run.nu_dot is not None
            self.measured = run.nu_dot
        else:
            self._filter = LocalPolynomial(run.t, derivative.half_width, derivative.order)
            self.measured = self._filter(np.where(run.valid[:, None], run.nu, np.nan))[1]

    def predicted(self) -> Array:
        """Return the model's acceleration, (N, 6), m/s2 and rad/s2; NaN where a sample is missing."""
        return LogComparison([self]).predicted()

    def filtered(self, rate: Array) -> Array:
        """Return what the filter makes of the model, (N, 6), m/s2 and rad/s2.

        Args:
            rate: where accelerations are measured, those of the model; else the velocities that they add up to.
        """
        return rate if self._filter is None else self._filter(rate)[1]

    @property
    def differentiates(self) -> bool:
        """Whether accelerations are differentiated velocities, and not measured."""
        return self._filter is not None


class LogComparison:
    """The runs of a log in turn, the model being asked once for many of them.

    Args:
        parts: the runs, compared with one model in one way.
    """

    def __init__(self, parts: Sequence[RunComparison]) -> None:
        """Keep the runs."""
        self.parts = list(parts)

    @classmethod
    def of(cls, model: GreyBox, runs: Iterable[Run], derivative: Derivative) -> LogComparison:
        """Return the comparison of runs.

        Args:
            model: as `RunComparison` has it.
            runs: measurements.
            derivative: how accelerations are obtained.
        """
        return cls([RunComparison(model, run, derivative) for run in runs])

    def update(self, hooks: Collection[str]) -> None:
        """Work out again what depends on the parameters of effects with these hooks."""
        for part in self.parts:
            part.replay.update(hooks)

    def predicted(self) -> Array:
        """Return the model's acceleration, (N, 6), m/s2 and rad/s2; NaN where a sample is missing."""
        replays = [part.replay for part in self.parts]
        asked = velocities if self.parts[0].differentiates else accelerations
        pairs = zip(self.parts, asked(replays), strict=True)
        return np.concatenate([part.filtered(rate) for part, rate in pairs])

    def gap(self) -> Array:
        """Return measured minus predicted acceleration, (N, 6)."""
        return np.concatenate([part.measured for part in self.parts]) - self.predicted()
