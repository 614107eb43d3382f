"""One log under laws of a stochastic force: where a search begins, and what explanations are worth there."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.commands.uncertain import in_closed_loop
from auvnn.diagnosis.noise_law.first_law import first_law
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis, judged
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED, LawFits
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import STEPS
from auvnn.diagnosis.noise_law.likelihood.sums import CELL, ForceSums, force_sums
from auvnn.diagnosis.noise_law.predicted_by_inputs import InputPrediction, predicted_by_inputs
from auvnn.diagnosis.stages.state import Setting
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Steps of the fit without any name.
NULL_STEPS = 25


@dataclass(frozen=True)
class Judge:
    """From an explanation and a law to what both are worth.

    Attributes:
        layout: stated values.
        windows: of the log, without a law.
        sigma: (18,) the sensors' white noise.
        cell: the time over which the force is constant, s.
        response: (6, 6) accelerations by the forces of the law.
        last: sums that were worked out last, with what they are about: a law is often estimated where steps have led.
    """

    layout: Layout
    windows: Windows
    sigma: Array
    cell: float
    response: Array | None
    last: list[tuple[FittedHypothesis, ForceSums]] = field(default_factory=list, compare=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Go to another process without sums."""
        return {**self.__dict__, "last": []}

    def __call__(self, explanation: FittedHypothesis, law: ForceLaw, held: bool = False) -> Hypothesis:
        """Return an explanation with the law that is most likely with it, or with the one given, and what they are worth.

        Args:
            explanation: the explanation.
            law: to begin from.
            held: whether the law stays as it is.
        """
        return judged(self.layout, explanation, self.sums(explanation), self.sigma, law, 0 if held else STEPS)

    def sums(self, explanation: FittedHypothesis) -> ForceSums:
        """Return what the windows say of parameters and force, linear about an explanation's trajectories.

        Args:
            explanation: the explanation.
        """
        for known, sums in self.last:
            if known.fitted is explanation.fitted and known.around is explanation.around:
                return sums
        about = replace(self.windows, law=None, around=explanation.around)
        self.last.clear()
        self.last.append((explanation, force_sums(explanation, about, self.sigma, self.cell, self.response)))
        return self.last[0][1]


class UnderLaw:
    """One log under laws of the force.

    Args:
        asked: what is asked.
        windows: of the log, without a law.
        closed_loop: whether commands are known to answer the motion; else it is asked of the fit without any name.
    """

    def __init__(self, asked: Setting, windows: Windows, *, closed_loop: bool = False) -> None:
        """Begin without a law."""
        self.layout, self.windows, self.base, self.say = asked.layout, windows, list(asked.base), asked.say
        self.pool = asked.pool
        self.in_closed_loop = closed_loop
        self.sigma = self.weights = np.full(18, np.inf)
        self.cell = CELL
        self.response: Array | None = None

    def begin(self, first: FittedHypothesis, sigma: Array, steps: int = NULL_STEPS) -> Hypothesis | None:
        """Return an explanation under the law of the force; None where no variance is above zero.

        Args:
            first: the fit without any effect, beside which names are sought; or one with names that stand.
            sigma: (18,) the sensors' white noise.
            steps: of its fit under the law; with none its parameters stay.
        """
        self.say("estimating the law of the force that is left")
        # Fits without the force weigh errors as the first one did.
        self.sigma, self.weights = sigma, first.fitted.sigma
        self.response = GreyBox(first.fitted.model.vehicle).prepare().inverse.detach().numpy()
        found = first_law(first, self.windows, sigma, self.response)
        if found is None:
            return None
        self.cell = found.cell
        # All names are compared with it: it must not gain by steps that names take first.
        null = self.fits().settled(self.judged(found.explanation, found.law), steps)
        with suppress(*UNSOLVED):
            self.in_closed_loop = self.in_closed_loop or in_closed_loop(null.explanation, self.windows)
        return null

    def about(self, explanation: FittedHypothesis, law: ForceLaw | None = None) -> Windows:
        """Return the windows, linear about an explanation's trajectories, with a law or without."""
        return replace(self.windows, law=law, around=explanation.around)

    def fits(self) -> LawFits:
        """Return what fits under laws of the force."""
        return LawFits(self.windows, self.weights, self.judge)

    @property
    def judge(self) -> Judge:
        """Who says what an explanation is worth under a law."""
        return Judge(self.layout, self.windows, self.sigma, self.cell, self.response)

    def judged(self, explanation: FittedHypothesis, law: ForceLaw) -> Hypothesis:
        """Return an explanation with the law that is most likely with it, and what they are worth.

        Args:
            explanation: the explanation.
            law: to begin from.
        """
        return self.judge(explanation, law)

    def _sums(self, explanation: FittedHypothesis) -> ForceSums:
        """Return what the windows say of parameters and force, linear about an explanation's trajectories."""
        return self.judge.sums(explanation)

    def predicted(self, found: Hypothesis) -> InputPrediction | None:
        """Return what measured inputs predict of the force that an explanation leaves; None where that is little."""
        self.say("asking how much of the force measured inputs predict")
        about, law = self.about(found.explanation), found.estimate.law
        sums, closed = self._sums(found.explanation), self.in_closed_loop
        told = predicted_by_inputs(found.weighed, about, sums, law, closed_loop=closed)
        return told if told is not None and told.matters else None
