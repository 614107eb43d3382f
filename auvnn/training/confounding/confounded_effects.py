"""Have the damping subnetworks learned something that is not damping?

A function of the velocity can take up more than drag: a force that is there at rest, a current on a run of one
heading, a Munk moment. Three looks at what was learned tell:

- at rest: damping vanishes with the velocity, d(0) = 0;
- power: damping takes energy, nu . d(nu) >= 0, wherever the log has been;
- regression: along the log, d is laid out into what a drag can give (linear and quadratic laws with every
  coupling, and fore and aft unlike), and beside that into what the subnetworks could take up of the wrench that
  an effect would have had. An effect that accounts for most of what no drag gives was learned in its place.

All three count only beyond what the log leaves open (`training.learned`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.effects import EFFECTS
from auvnn.logs import Log
from auvnn.metrics.one_step import Derivative, accelerations, choose_derivative, inertia_of
from auvnn.models import GreyBox
from auvnn.training.confounding.network_posterior import NetworkPosterior, curves
from auvnn.training.targets import targets

Array = NDArray[np.float64]
AXES = ("X", "Y", "Z", "K", "M", "N")
UNITS = ("N", "N", "N", "N m", "N m", "N m")
# Effects of which a function of the velocity can take up a part; those of them that there are, are tried.
SUSPECTS = ("constant_force", "ocean_current", "net_buoyancy", "cg_offset", "added_mass", "body_lift")
# Standard errors beyond which something is taken for real, and the share of the learned wrench from which on it
# matters.
SURE, SIZE = 4.0, 0.05
# Negative power counts from this share of the largest on, in at least this share of the samples.
POWER, SAMPLES = 0.01, 0.005
# Share of what no drag gives that an effect must account for; and of the best effect's share that makes a rival.
SHARE, RIVAL, SAME = 0.4, 0.8, 0.9
# The same of a force at rest, whose standard error leaves out that the form cannot bend to everything.
REST_SURE, REST_SIZE = 5.0, 0.1
# Share of an effect's own trace that no drag could imitate, below which the log cannot tell.
TOLD = 0.01


@dataclass(frozen=True)
class ConfoundedEffect:
    """An effect that the subnetworks may have learned.

    Attributes:
        effect: name.
        share: of what no drag gives, by energy over the log, that it accounts for.
        size: of its wrench, relative to all that was learned.
        parameters: name to {value, std, unit}.
        found: whether it is beyond doubt and matters.
    """

    effect: str
    share: float
    size: float
    parameters: dict[str, dict[str, Any]]
    found: bool


@dataclass(frozen=True)
class Confounding:
    """What subnetworks have learned besides damping.

    Attributes:
        rest: (6,) d(0), N and N m.
        rest_std: (6,) its standard errors.
        rest_share: (6,) |d(0)| relative to the root mean square of each learned force.
        driving: share of the samples at which they add energy beyond doubt.
        worst: (power in W, velocity (6,)) where they add most.
        beyond: share of the learned wrench, by energy, that no drag gives.
        suspects: best first.
        surfaces: one curve per degree of freedom, with its band and the range that the log covered.
    """

    rest: Array
    rest_std: Array
    rest_share: Array
    driving: float
    worst: tuple[float, Array]
    beyond: float
    suspects: tuple[ConfoundedEffect, ...]
    surfaces: list[dict[str, Any]] = field(default_factory=list)

    @property
    def at_rest(self) -> list[int]:
        """Degrees of freedom in which there is a force at rest."""
        sure = np.abs(self.rest) > REST_SURE * self.rest_std
        return np.flatnonzero(sure & (self.rest_share > REST_SIZE)).tolist()

    @property
    def named(self) -> list[ConfoundedEffect]:
        """The effect that was learned in place of damping, and those that cannot be told from it; may be empty."""
        found = [s for s in self.suspects if s.found]
        near = [s for s in found if s.share >= RIVAL * found[0].share]
        # Of those that do equally well, the one with the fewest parameters claims least.
        return sorted(near, key=lambda s: (s.share < SAME * near[0].share, len(s.parameters)))

    def words(self) -> list[str]:
        """Return what there is to warn of, in plain sentences; nothing where the subnetworks are honest drag."""
        out = []
        named = self.named
        if named:
            first, *others = named
            out.append(
                f"the damping subnetworks have learned something that is not damping: {_described(first)} accounts "
                f"for {100 * first.share:.0f} % of what no drag gives"
                + (f"; so may {', '.join(_described(o) for o in others)}" if others else "")
                + f". Train again with effects: {first.effect} in the model"
            )
        if self.at_rest:
            forces = ", ".join(
                f"{AXES[k]} {self.rest[k]:.3g} +- {self.rest_std[k]:.1g} {UNITS[k]}" for k in self.at_rest
            )
            cause = (
                ""
                if named
                else ": a constant force, buoyancy, an offset centre of gravity or a current does so"
            )
            out.append(f"the damping subnetworks push at rest, which no damping does ({forces}){cause}")
        if self.driving >= SAMPLES:
            power, nu = self.worst
            velocity = ", ".join(f"{value:.2g}" for value in nu)
            out.append(
                f"the learned damping adds energy at {100 * self.driving:.1f} % of the samples, most at "
                f"nu = ({velocity}): {power:.3g} W; the form 'dissipative' cannot do so"
            )
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "at_rest": {
                a: {"value": v, "std": s, "share": r}
                for a, v, s, r in zip(AXES, self.rest, self.rest_std, self.rest_share, strict=True)
            },
            "adds_energy_share": self.driving,
            "beyond_drag_share": self.beyond,
            "suspects": [vars(s) for s in self.suspects],
            "named": [s.effect for s in self.named],
        }


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
    parameters = {
        p.name: {"value": p.null + v * s, "std": d * s, "unit": p.unit}
        for p, v, d, s in zip(described, estimate, std, scale, strict=True)
    }
    return ConfoundedEffect(name, share, relative, parameters, sure and share > SHARE and relative > SIZE)


def _described(suspect: ConfoundedEffect) -> str:
    """Return an effect with those of its parameters that are beyond doubt."""
    null = 1.0 if suspect.effect == "added_mass" else 0.0
    parts = [
        f"{n} {p['value']:.3g} +- {p['std']:.1g}{'' if p['unit'] == '1' else ' ' + p['unit']}"
        for n, p in suspect.parameters.items()
        if abs(p["value"] - null) > SURE * p["std"]
    ]
    return f"{suspect.effect} ({', '.join(parts)})" if parts else suspect.effect


__all__ = ["ConfoundedEffect", "Confounding", "confounded_effects", "traces"]
