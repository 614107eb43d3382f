"""How far explanations that the data prefer would move what was found.

A search ends with names beside which further ones cost too little, or are not sure enough, to be named. They are likely
nevertheless, and with one of them in the model the values of the others are not the same. Where the model's shapes are
not those of the log, that moves values by more than the noise does. The explanations of the last round are therefore
averaged by their posterior probabilities, and what lies between them is part of the standard errors.

Reference: Hoeting, Madigan, Raftery and Volinsky (1999), Bayesian model averaging: a tutorial, Statistical Science 14(4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis

Array = NDArray[np.float64]


def averaged(layout: Layout, current: Hypothesis, rivals: Sequence[Hypothesis]) -> FittedHypothesis:
    """Return an explanation with what lies between it and those with one name more, in each parameter.

    Args:
        layout: which columns belong to which effect.
        current: the explanation that is answered.
        rivals: explanations with one name more, each at the law that is most likely with it.
    """
    explanation = current.explanation
    names, theta = explanation.names, explanation.fitted.theta
    apart = np.zeros((1 + len(rivals), len(theta)))
    for k, rival in enumerate(rivals, start=1):
        theirs = layout.places(rival.explanation.names)
        for name, at in layout.places(names).items():
            apart[k, at] = rival.explanation.fitted.theta[theirs[name]] - theta[at]
    weight: Array = softmax([current.evidence, *(h.evidence for h in rivals)])
    known = 0.0 if explanation.systematic is None else explanation.systematic
    return replace(explanation, systematic=np.hypot(known, np.sqrt(weight @ apart**2)))
