"""Damping subnetworks as a step of the loop: trained one step ahead, accepted by free running on what was left out.

Polynomials of drag are linear in their parameters, so that a fold can be left out by one Newton step. Networks are not:
they are trained again without each fold, on what the model fitted without that fold leaves. Whatever is fitted beside
them later keeps to that: each fold is judged with the networks that have not seen it.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.damping.bank import DampingBank
from auvnn.errors import InputError
from auvnn.improvement.loop.judge import Judge
from auvnn.improvement.loop.state import ALL, State, banked, fold_models, laid_out
from auvnn.metrics.derivative import Derivative
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import carried_over
from auvnn.training.fit_damping import fit_damping
from auvnn.training.problem import DampingProblem
from auvnn.training.targets import Targets

Array = NDArray[np.float64]
FORM = "mlp"
# One starting point and few iterations: they are trained once for each fold, and stop when a part left out says so.
SCHEME = {"scheme": "levenberg_marquardt", "restarts": 1, "max_iterations": 60}
TRAINED = "networks trained again without each fold"
# Samples that networks are trained on, at most: more cost time and say little more.
SAMPLES = 20_000


def trained(base: GreyBox, judge: Judge, state: State, how: Derivative) -> State:
    """Return a state with damping subnetworks beside what it has, judged on what was left out.

    Args:
        base: the model as given; it has no subnetworks.
        judge: of the log.
        state: to which they are added.
        how: how accelerations are obtained.

    Raises:
        InputError: the model has subnetworks already, or the log has too few folds to stop a training by.
    """
    if base.damping is not None or state.recipe.banks:
        raise InputError("the model has subnetworks already: train them again with auvnn train")
    folds = judge.folds.numbers
    if len(folds) < 3:
        raise InputError("too little can be left out to train subnetworks and to judge them")
    models = (
        dict.fromkeys(folds, state.model)
        if state.fit is None
        else fold_models(base, judge, state.recipe, state.layout, state.fit)
    )
    banks = {fold: _bank(model, judge, how, fold) for fold, model in models.items()}
    banks[ALL] = _bank(state.model, judge, how, None)
    recipe = replace(state.recipe, banks=banks)
    layout, names, _ = laid_out(base, recipe)
    left = judge.left_out({f: _with(models[f], banks[f]) for f in models}, recipe.effects, TRAINED)
    model = banked(state.model, recipe)
    return State(recipe, layout, state.fit, names, state.theta, model, left)


def _with(model: GreyBox, bank: DampingBank) -> GreyBox:
    return carried_over(
        GreyBox(model.vehicle, model.copied_effects(), copy.deepcopy(bank), model.actuation), model
    )


def _bank(model: GreyBox, judge: Judge, how: Derivative, absent: int | None) -> DampingBank:
    """Return networks trained on what a model leaves, without a fold; the next fold says when to stop."""
    folds = judge.folds.numbers
    stop = folds[0] if absent is None else folds[(folds.index(absent) + 1) % len(folds)]
    each = Targets(model, how)
    nu, target, number = [], [], []
    for run in judge.log.runs:
        own = judge.folds.at(run.number, run.t)
        keep = np.ones(run.samples, dtype=bool) if absent is None else own != absent
        seen, wanted = each(run.cleaned)
        nu.append(seen[keep])
        target.append(wanted[keep])
        number.append((own[keep] == stop).astype(np.int64))
    step = max(1, sum(map(len, nu)) // SAMPLES)
    problem = DampingProblem(
        *(torch.tensor(np.concatenate(x)[::step]) for x in (nu, target)),
        run=torch.tensor(np.concatenate(number)[::step]),
    )
    bank = DampingBank.from_description(FORM, 0)
    fit_damping(bank, problem, scheme=SCHEME, held_out=[1], seed=0)
    return bank.requires_grad_(True)
