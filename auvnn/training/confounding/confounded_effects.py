"""Have the damping subnetworks learned something that is not damping?

A function of the velocity can take up more than drag: a force that is there at rest, a current on a run of one
heading, a Munk moment. Three looks at what was learned tell:

- at rest: damping vanishes with the velocity, d(0) = 0;
- power: damping takes energy, nu . d(nu) >= 0, wherever the log has been;
- regression: along the log, d is laid out into what a drag can give (linear and quadratic laws with every
  coupling, and fore and aft unlike), and beyond that into what the subnetworks could take up of the wrench that
  an effect would have had. An effect that accounts for most of what no drag gives was learned in its place.

All three count only beyond what the log leaves open (`training.learned`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import Parameters
from auvnn.effects import EFFECTS
from auvnn.logs import Log
from auvnn.metrics.derivative import Derivative, choose_derivative
from auvnn.metrics.one_step import accelerations, inertia_of
from auvnn.models import GreyBox
from auvnn.training.confounding.confounding import (
    POWER,
    SHARE,
    SIZE,
    SURE,
    TOLD,
    ConfoundedEffect,
    Confounding,
)
from auvnn.training.confounding.network_posterior import NetworkPosterior, curves
from auvnn.training.targets import targets

Array = NDArray[np.float64]
# Effects of which a function of the velocity can take up a part; those of them that there are, are tried.
SUSPECTS = ("constant_force", "ocean_current", "net_buoyancy", "cg_offset", "added_mass", "body_lift")


def confounded_effects(model: GreyBox, log: Log, derivative: Derivative | None = None) -> Confounding | None:
    """Look for what is not damping in a model's subnetworks, along a log.

    Args:
        model: with subnetworks that were trained on this log or one like it.
        log: measurements.
        derivative: how accelerations are obtained; by default chosen from the log.

    Returns:
        What was found, or None where the model has learned nothing.
    """
    bank = model.damping
    if bank is None or not list(bank.parameters()):
        return None
    how = derivative or choose_derivative(log)
    nu, target, run = targets(model, log, how)
    good = np.isfinite(nu).all(1) & np.isfinite(target).all(1)
    learned = NetworkPosterior(bank, nu[good], target[good], run[good].astype(np.int64))
    if not np.any(learned.wrench):
        return None
    size = np.sqrt(np.mean(learned.wrench**2, axis=0))
    size = np.maximum(size, 1e-9 * size.max())
    rest, rest_std = (x[0] for x in learned.at(np.zeros((1, 6))))
    driving, worst = _power(learned)
    chosen = np.flatnonzero(good)[learned.rows]
    basis = [np.linalg.qr(_drag(learned.nu, k))[0] for k in range(6)]
    left = _without(learned.wrench[..., None], basis)[..., 0] / size
    whole = float(np.sum((learned.wrench / size) ** 2))
    suspects = [
        _confounded_effect(model, log, how, name, chosen, learned, basis, size, left)
        for name in _candidates(model, log)
    ]
    found = sorted((s for s in suspects if s is not None), key=lambda s: -s.share)
    return Confounding(
        rest,
        rest_std,
        np.abs(rest) / size,
        driving,
        worst,
        float(np.sum(left**2)) / whole,
        tuple(found),
        curves(learned, nu[good]),
    )


def _candidates(model: GreyBox, log: Log) -> list[str]:
    there = set(EFFECTS.names())
    return [
        name
        for name in SUSPECTS
        if name in there
        and name not in model.effect_names
        and all(all(c in run.channels for run in log.runs) for c in _own(EFFECTS.get(name).channels))
    ]


def _own(channels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the channels that a log may lack: every log has an attitude."""
    return tuple(c for c in channels if c not in ("phi", "theta", "psi"))


def _power(learned: NetworkPosterior) -> tuple[float, tuple[float, Array]]:
    """Return the share of samples that add energy beyond doubt, and the worst of them."""
    power = (learned.nu * learned.wrench).sum(-1)
    std = learned.std(np.einsum("ni,nip->np", learned.nu, learned.slope))
    drives = (power < -SURE * std) & (power < -POWER * np.abs(power).max())
    if not drives.any():
        return 0.0, (0.0, np.zeros(6))
    at = int(np.argmin(np.where(drives, power, 0.0)))
    return float(drives.mean()), (-float(power[at]), learned.nu[at])


def _drag(nu: Array, axis: int) -> Array:
    """Return what a drag along one axis can be made of, (N, 43), each column of unit size.

    nu_j, |nu_k| nu_j for all j and k, and nu_i^2 for a body whose two ends differ.
    """
    size = np.sqrt(np.mean(nu**2, axis=0))
    x = nu / np.where(size > 0, size, 1.0)
    products = (np.abs(x)[:, :, None] * x[:, None, :]).reshape(len(x), -1)
    columns = np.concatenate([x, products, x[:, [axis]] ** 2], axis=1)
    norm = np.linalg.norm(columns, axis=0)
    return columns[:, norm > 1e-9] / norm[norm > 1e-9]


def _without(series: Array, basis: list[Array]) -> Array:
    """Take out of (N, 6, k) what each channel's basis can give."""
    return np.stack([series[:, k] - q @ (q.T @ series[:, k]) for k, q in enumerate(basis)], axis=1)


def traces(model: GreyBox, log: Log, how: Derivative, name: str) -> tuple[Array, list[Any]]:
    """Return the wrench that subnetworks would take up of each parameter of an effect, per unit, (N, 6, p).

    That is the slope at the null of M (nu_dot measured - nu_dot of the model with the effect).

    Args:
        model: with its subnetworks.
        log: N samples in all.
        how: accelerations are obtained.
        name: of the effect, with p parameters.
    """
    described = list(EFFECTS.get(name).describe(model.vehicle, model.actuation))
    none = _lacking(model, log, how)
    columns = []
    for parameter in described:
        step = 1e-3 * parameter.scale
        step = step if parameter.null + step <= parameter.high else -step
        with_it = model.with_effects({name: {parameter.name: parameter.null + step}})
        columns.append((none - _lacking(with_it, log, how)) / step)
    return np.stack(columns, axis=-1), described


def _lacking(model: GreyBox, log: Log, how: Derivative) -> Array:
    parts = []
    for run in log.runs:
        measured, predicted = accelerations(model, run, how)
        parts.append((predicted - measured) @ inertia_of(model, run).T)
    return np.concatenate(parts)


def _confounded_effect(
    model: GreyBox,
    log: Log,
    how: Derivative,
    name: str,
    rows: NDArray[np.int64],
    learned: NetworkPosterior,
    basis: list[Array],
    size: Array,
    left: Array,
) -> ConfoundedEffect | None:
    """Regress what no drag gives on what could be taken up of one effect; None where a drag could give all of it."""
    trace, described = traces(model, log, how, name)
    trace = learned.within_reach(np.nan_to_num(trace[rows])) / size[:, None]
    scale = np.array([p.scale for p in described])
    own = _without(trace, basis).reshape(-1, len(scale)) * scale
    total = trace.reshape(-1, len(scale)) * scale
    told = (own**2).sum(0) > TOLD * np.maximum((total**2).sum(0), 1e-12)
    told &= (total**2).sum(0) > 1e-12
    if not told.any():
        return None
    own, total, scale = own[:, told], total[:, told], scale[told]
    described = [p for p, kept in zip(described, told, strict=True) if kept]
    gram = own.T @ own
    inverse = np.linalg.pinv(gram, rcond=1e-8, hermitian=True)
    estimate = inverse @ (own.T @ left.ravel())
    share = 1.0 - float(np.sum((left.ravel() - own @ estimate) ** 2)) / max(float(np.sum(left**2)), 1e-300)
    # What no drag gives is a linear function of d, and d to first order one of the weights.
    linear = inverse @ (own.T @ (learned.slope / size[:, None]).reshape(len(own), -1))
    covariance = learned.covariance(linear)
    std = np.sqrt(np.diag(covariance))
    statistic = float(estimate @ np.linalg.pinv(covariance, rcond=1e-10, hermitian=True) @ estimate)
    relative = float(np.sqrt(np.sum((total @ estimate) ** 2) / np.sum((learned.wrench / size) ** 2)))
    sure = statistic / len(estimate) > SURE**2 and bool((np.abs(estimate) > SURE * std).any())
    parameters: Parameters = {
        p.name: {"value": float(p.null + v * s), "std": float(d * s), "unit": p.unit}
        for p, v, d, s in zip(described, estimate, std, scale, strict=True)
    }
    return ConfoundedEffect(name, share, relative, parameters, sure and share > SHARE and relative > SIZE)


__all__ = ["ConfoundedEffect", "Confounding", "confounded_effects", "traces"]
