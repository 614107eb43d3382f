"""What a manoeuvre can identify at once, by the information in its windows, and what subnetworks absorb."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.damping.bank import DampingBank
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.stated_priors import Layout, lay_out
from auvnn.effects import effect_class
from auvnn.estimation.nuisance_elimination import carry_of
from auvnn.logs import Log
from auvnn.metrics.derivative import choose_derivative
from auvnn.models import GreyBox
from auvnn.training.confounding.confounded_effects import traces
from auvnn.training.fit_damping import fit_damping
from auvnn.training.objectives.windows import Shots
from auvnn.training.problem import DampingProblem
from auvnn.training.targets import targets

Array = NDArray[np.float64]


# Standard deviations of good sensors (noise=realistic), in the order of the windows' channels; no accelerations.
SIGMA = np.array([0.05, 0.05, 0.01, 0.003, 0.003, 0.008] + [0.006] * 3 + [0.003] * 3 + [np.inf] * 6)


GROUPS = {
    "damping": ("linear_damping", "quadratic_damping"),
    "added mass": ("added_mass",),
    "restoring": ("net_buoyancy", "cg_offset"),
}


# Wrenches are compared in these units, N and N m, so that no degree of freedom drowns the others.
WRENCH = np.array([5.0, 5.0, 5.0, 1.0, 1.0, 1.0])


SWALLOWED = ("added_mass", "net_buoyancy", "cg_offset", "ocean_current", "thruster_lag")


# Known this much better than before counts as identified; correlated more than this as confounded.
IDENTIFIED, CONFOUNDED = 0.5, 0.9


SCHEME = {"scheme": "levenberg_marquardt", "restarts": 1, "max_iterations": 60}


# Standard deviation of the networks' weights beforehand, in their scaled numbers: next to nothing is known.
WEIGHT = 3.0


def _listed(shares: Mapping[str, Any]) -> str:
    rows = [(n, s["share"]) for n, s in shares.items() if s["share"] is not None]
    return ", ".join(f"{100 * v:.0f} % of {n}" for n, v in sorted(rows, key=lambda r: -r[1]))


def information(model: GreyBox, log: Log, prior: float, networks: bool = True) -> dict[str, Any]:
    """Return standard errors, correlations and confused groups of all parameters on one log.

    Args:
        model: the vehicle with its damping.
        log: noise-free, with accelerations.
        prior: relative standard deviation of the coefficients beforehand.
        networks: whether to work out as well what is left where the damping is six networks.
    """
    names = [n for group in GROUPS.values() for n in group if n not in model.effect_names]
    layout = lay_out(model, names)
    shots = Shots(layout.model, windows_for(model, log))
    labels, before = _parameters(layout, names, prior)
    total = shots.sums(layout.model, SIGMA, weights=False, names=names).hessian
    total = total * before[:, None] * before  # in units of what was known before
    alone = 1.0 / np.sqrt(np.diag(total) + 1.0)
    covariance = np.linalg.inv(total + np.eye(len(before)))
    joint = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(joint, joint)
    open_ = _with_networks(model, log, [n for n in names if n not in GROUPS["damping"]], prior, networks)
    rows = []
    for k, (effect, name, unit) in enumerate(labels):
        free = open_.get((effect, name))
        near = int(np.argmax(np.abs(correlation[k] - np.eye(len(before))[k] * correlation[k])))
        rows.append(
            {
                "effect": effect,
                "parameter": name,
                "unit": unit,
                "prior_std": before[k],
                "std_alone": alone[k] * before[k],
                "std_together": joint[k] * before[k],
                "alone_over_prior": alone[k],
                "together_over_prior": joint[k],
                "with_networks_over_prior": free,
                "verdict": _verdict(alone[k], joint[k]),
                "verdict_with_networks": None if free is None else _verdict(alone[k], free),
                "most_like": f"{labels[near][0]} {labels[near][1]}",
                "correlation": correlation[k, near],
            }
        )
    pairs = [
        {
            "first": " ".join(labels[i][:2]),
            "second": " ".join(labels[j][:2]),
            "correlation": correlation[i, j],
        }
        for i in range(len(before))
        for j in range(i)
        if abs(correlation[i, j]) > CONFOUNDED
    ]
    of = {g: [k for k, (e, _, _) in enumerate(labels) if e in members] for g, members in GROUPS.items()}
    return {
        "parameters": rows,
        "confounded_pairs": sorted(pairs, key=lambda p: -abs(p["correlation"])),
        "groups": {g: _left(total, of, g) for g in GROUPS},
        "condition_number": float(np.linalg.cond(total + np.eye(len(before)))),
    }


def _with_networks(
    model: GreyBox, log: Log, names: Sequence[str], prior: float, wanted: bool
) -> dict[tuple[str, str], float]:
    """Return standard errors over the prior's where the damping is six networks of which nothing is known."""
    if not wanted:
        return {}
    vehicle = replace(model.vehicle, damping_elements=(), linear_damping=None, quadratic_damping=None)
    bare = GreyBox(vehicle, model.copied_effects(), None, model.actuation)
    nu, target, _ = targets(bare, log, choose_derivative(log))
    bank = DampingBank.from_description("mlp", 0)
    fit_damping(bank, DampingProblem(torch.tensor(nu), torch.tensor(target)), scheme=SCHEME)
    effects = [effect_class(n).build(vehicle, model.actuation) for n in names]
    learned = GreyBox(vehicle, [*model.copied_effects(), *effects], bank, model.actuation)
    shots = Shots(learned, windows_for(learned, log))
    before = np.array(
        [prior if p.null == 1.0 else p.scale for n in names for p in learned.effect(n).parameters_of]
    )
    total = shots.sums(learned, SIGMA, weights=True, names=names).hessian
    k, free = len(before), np.concatenate([before, np.full(len(total) - len(before), WEIGHT)])
    total = total * free[:, None] * free + np.eye(len(free))
    std = np.sqrt(np.diag(np.linalg.inv(total))[:k])
    labels = [(n, p.name) for n in names for p in learned.effect(n).parameters_of]
    return dict(zip(labels, std.tolist(), strict=True))


def _parameters(
    layout: Layout, names: Sequence[str], prior: float
) -> tuple[list[tuple[str, str, str]], Array]:
    labels, before = [], []
    for name in names:
        for parameter in layout.model.effect(name).parameters_of:
            labels.append((name, parameter.name, parameter.unit))
            before.append(prior if parameter.null == 1.0 else parameter.scale)
    return labels, np.array(before)


def _verdict(alone: float, joint: float) -> str:
    if joint < IDENTIFIED:
        return "identified"
    return "confounded" if alone < IDENTIFIED else "not excited"


def _left(total: Array, of: Mapping[str, list[int]], group: str) -> dict[str, float]:
    """Return the share of a group's information that is its own, and what each other group imitates of it."""
    own = of[group]
    whole = max(float(np.trace(total[np.ix_(own, own)])), 1e-300)

    def imitated(others: list[int]) -> float:
        cross = total[np.ix_(own, others)]
        inner = total[np.ix_(others, others)] + np.eye(len(others))
        return float(np.clip(np.trace(cross @ carry_of(inner, cross.T).T) / whole, 0.0, 1.0))

    rest = [k for name, columns in of.items() if name != group for k in columns]
    return {"own": 1.0 - imitated(rest), **{n: imitated(c) for n, c in of.items() if n != group}}


def swallowed(
    model: GreyBox, log: Log, effect: str, seed: int = 0, elsewhere: Log | None = None
) -> dict[str, Any]:
    """Return the share of an effect's trace in a log that six networks of the velocity can be trained to give.

    For each parameter the trace is the wrench that a model without it lacks, sample by sample; networks of the
    paper's size are fitted to it on the first half of the runs, and the share is R2 in units of 5 N and 1 N m,
    without a mean taken off. On the other half it shows what of that was learned by heart.

    Args:
        model: the vehicle with its damping.
        log: noise-free, with accelerations.
        effect: name.
        seed: of the networks.
        elsewhere: a log of another manoeuvre on which to judge the same networks.

    Returns:
        `share`, the mean over parameters that leave any trace; `each` of them; `held_out`, the mean on the runs
        that were not fitted; `elsewhere`, the median share there.
    """
    trace, described = traces(model, log, choose_derivative(log), effect)
    nu = np.concatenate([run.nu for run in log.runs])
    half = sum(run.samples for run in log.runs[: (len(log.runs) + 1) // 2])
    far = None
    if elsewhere is not None:
        far = (
            traces(model, elsewhere, choose_derivative(elsewhere), effect)[0],
            np.concatenate([run.nu for run in elsewhere.runs]),
        )
    each, held, away = {}, {}, {}
    for k, parameter in enumerate(described):
        wanted = trace[..., k] * parameter.scale
        size = np.sqrt(np.mean((wanted[:half] / WRENCH) ** 2, axis=0))
        # A trace below a hundredth of the largest in its wrench is integration error.
        if not size.max() > 1e-4:
            continue
        bank = DampingBank.from_description("mlp", seed)
        learned = np.where(size > 1e-6 * size.max(), wanted, 0.0)
        fit_damping(
            bank,
            DampingProblem(torch.tensor(nu[:half]), torch.tensor(learned[:half])),
            scheme=SCHEME,
            seed=seed,
        )
        each[parameter.name] = _share(bank, nu[:half], wanted[:half])
        if half < len(nu):
            held[parameter.name] = _share(bank, nu[half:], wanted[half:])
        if far is not None:
            away[parameter.name] = _share(bank, far[1], far[0][..., k] * parameter.scale)
    return {
        "share": float(np.mean(list(each.values()))) if each else None,
        "each": each,
        "held_out": float(np.mean(list(held.values()))) if held else None,
        "elsewhere": float(np.median(list(away.values()))) if away else None,
    }


def _share(bank: DampingBank, nu: Array, wanted: Array) -> float:
    with torch.no_grad():
        given = bank(torch.tensor(nu)).numpy()
    left = np.sum(((wanted - given) / WRENCH) ** 2)
    return float(1.0 - left / np.sum((wanted / WRENCH) ** 2))
