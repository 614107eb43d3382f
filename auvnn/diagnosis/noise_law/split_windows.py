"""Shorter windows for fits under a stochastic force: each window in parts, with the same rows, commands and sensors.

A force takes the vehicle away from the free running about which a window is linear, the farther the longer it lasts. Over
two seconds the windows are nearly linear, and what they say of one another's forces is kept by filtering
(`law_likelihood`).
"""

from __future__ import annotations

from dataclasses import replace

import torch

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.stages.state import Setting
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.window_parts import split
from auvnn.estimation.window_simulation import run_windows
from auvnn.metrics.windows import Windows

# Length that parts are to have, s, and steps of the fit over parts.
SPAN, STEPS = 2.0, 6


def fitted_over_parts(
    asked: Setting, first: FittedHypothesis, windows: Windows
) -> tuple[FittedHypothesis, Windows]:
    """Return an explanation fitted again over parts of its windows, and these.

    Args:
        asked: layout and what is free anyway.
        first: the explanation.
        windows: those it was fitted to.
    """
    parts, whole, begins = split(windows, SPAN)
    if len(parts) == len(windows):
        return first, windows
    eta, nu, _ = run_windows(first.fitted.model, windows, first.fitted.initial)
    states = torch.cat([eta, nu], dim=-1)[torch.as_tensor(whole), torch.as_tensor(begins)]
    model = asked.layout.model.rebuilt(asked.layout.model.copied_effects())
    set_parameters(model, first.names, first.fitted.theta)
    return (
        fit_hypothesis(
            asked.layout, parts, asked.base, first.effects, start=replace(first.fitted, initial=states),
            guess=replace(asked.layout, model=model), sigma=first.fitted.sigma, iterations=STEPS,
        ),
        parts,
    )  # fmt: skip
