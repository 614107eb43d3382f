"""What is uncertain in a model besides the effect that is asked for: its coefficients, by their stated amounts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.effects import EFFECTS, Parameter, effect_class
from auvnn.estimation.priors import Priors
from auvnn.models import GreyBox
from auvnn.models.joint_covariance import JointCovariance

Array = NDArray[np.float64]

# Groups of the model file's `uncertainty` and the effect that varies each.
GROUPS = ("added_mass", "linear_damping", "quadratic_damping", "inertia")
# Numbers that are exact unless the model file says how uncertain they are, and the effect that varies each.
EXACT = {"mass": "trapped_water", "buoyancy": "net_buoyancy", "thrust": "thruster_gain", "fins": "fin_gain"}
# A candidate is all but free, so that its prior neither pulls the estimate nor leaves it without bound.
FREE = 10.0
# What is merely uncertain stays within this many of its stated standard deviations. Without that limit a stated
# coefficient takes on absurd values to imitate what is missing, and the missing effect finds nothing left to explain.
REACH = 4.0
SHAPELESS = 1e4
# A parameter whose standard error the log brings down by less than this share of its prior's is not determined.
DETERMINED = 0.99
# Share of independence in correlations, so that they can be inverted: a hundred times less than what is known of either.
SINGULAR = 1e-6


@dataclass(frozen=True)
class Layout:
    """Which columns of the parameter vector belong to which effect.

    Attributes:
        model: holds all the effects named, candidates at their nulls.
        names: effects in order of their columns.
        columns: effect to columns.
        nuisance: effects that stand for stated uncertainty.
        means: what was stated of each effect's parameters before anything was fitted.
        spreads: nuisance effect, or one that the model had, to the standard deviations of its parameters.
        joint: how these go together, where a fit has said so; None where they are independent.
    """

    model: GreyBox
    names: tuple[str, ...]
    columns: dict[str, NDArray[np.int64]]
    nuisance: tuple[str, ...]
    means: dict[str, Array]
    spreads: dict[str, Array]
    joint: JointCovariance | None = None

    def described(self, name: str) -> tuple[Parameter, ...]:
        """Return the parameters of an effect, or of one of its stand-ins, `name@number`."""
        if "@" not in name:
            return self.model.effect(name).parameters_of
        every = [p for effect in self.model.members for p in effect.parameters_of]
        return tuple(every[column] for column in self.columns[name])

    def of(self, names: Sequence[str]) -> NDArray[np.int64]:
        """Return the columns of several effects, joined."""
        parts = [self.columns[n] for n in names]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)

    def places(self, names: Sequence[str]) -> dict[str, NDArray[np.int64]]:
        """Return where each effect's parameters are in the joined ones of several effects, in the order given."""
        ends = np.cumsum([len(self.columns[n]) for n in names])
        return {n: np.arange(end - len(self.columns[n]), end) for n, end in zip(names, ends, strict=True)}


def has_stated_uncertainty(model: GreyBox) -> dict[str, float]:
    """Return the relative standard deviation of each coefficient group that the vehicle has at all."""
    known = {"added_mass": True, "inertia": True}
    vehicle = model.vehicle
    elements = len(vehicle.damping_elements) > 0
    known["linear_damping"] = vehicle.linear_damping is not None or elements
    known["quadratic_damping"] = vehicle.quadratic_damping is not None or elements
    return {
        g: float(vehicle.uncertainty[g]) for g in GROUPS if known[g] and vehicle.uncertainty.get(g, 0.0) > 0
    }


def exact_unless_stated(model: GreyBox) -> dict[str, Array]:
    """Return what the model file says is uncertain of numbers that are exact otherwise: effect to deviations, (p,).

    Each is varied by the effect that is the same as another value of it: the mass by water that moves along, the
    buoyancy by a net buoyancy, the centres by an offset of the centre of gravity, thrust and fins by their gains.
    Relative amounts, but of the centres: a share of the vehicle's length.
    """
    vehicle = model.vehicle
    of = {
        k: float(vehicle.uncertainty.get(k, 0.0)) for k in (*EXACT, "center_of_gravity", "center_of_buoyancy")
    }
    out: dict[str, Array] = {}
    centres = vehicle.length * float(np.hypot(of.pop("center_of_gravity"), of.pop("center_of_buoyancy")))
    sizes = {"mass": float(vehicle.mass), "buoyancy": float(vehicle.buoyancy), "thrust": 1.0, "fins": 1.0}
    for key, share in of.items():
        if share > 0.0 and not (key == "fins" and not vehicle.fins):
            kind = effect_class(EXACT[key])
            out[EXACT[key]] = np.full(len(kind.describe(vehicle, model.actuation)), share * sizes[key])
    if centres > 0.0:
        out["cg_offset"] = np.full(3, centres)
    return out


def lay_out(model: GreyBox, candidates: Sequence[str], learned: Array | None = None) -> Layout:
    """Return the model with nuisance terms and candidates in it, those not there yet at their nulls.

    Args:
        model: as known.
        candidates: effects that can be asked for.
        learned: standard deviations (252,) of `learned_drag`, where damping was learned.
    """
    uncertain = has_stated_uncertainty(model)
    effects = model.copied_effects()
    present = [str(e.name) for e in effects]
    further = {n: s for n, s in exact_unless_stated(model).items() if n not in present}
    groups = [*uncertain, *([] if learned is None else ["learned_drag"]), *further]
    for name in dict.fromkeys([*groups, *candidates]):
        if name in present:
            continue
        effects.append(effect_class(name).build(model.vehicle, model.actuation))
    full = model.rebuilt(effects)
    columns, means, at = {}, {}, 0
    for effect in full.members:
        size = len(effect.parameters_of)
        columns[str(effect.name)] = np.arange(at, at + size)
        means[str(effect.name)] = effect.theta.detach().numpy().copy()
        at += size
    spreads = {g: s * np.maximum(np.abs(means[g]), 1e-3) for g, s in uncertain.items()}
    if learned is not None:
        spreads["learned_drag"] = learned
    spreads |= further
    for effect in model.members:
        # What the model has was fitted or stated: were it all but free, it would absorb what is missing.
        if str(effect.name) not in spreads and str(effect.name) in EFFECTS:
            spreads[str(effect.name)] = effect.standard_deviations()
            groups.append(str(effect.name))
    return Layout(full, tuple(columns), columns, tuple(groups), means, spreads, model.joint)


def priors(layout: Layout, names: Sequence[str], free: Sequence[str] = ()) -> Priors:
    """Return the priors of the named effects' parameters, joined in the order given.

    Args:
        layout: of the model.
        names: effects.
        free: those of them that are asked for: their stated uncertainty is left out.
    """
    mean, precision, reach = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for name in names:
        stated_values = layout.means[name]
        mean.append(stated_values)
        spread = None if name in free else layout.spreads.get(name)
        if spread is not None:
            precision.append(spread**-2)
            reach.append(REACH * spread)
        else:
            # A shape's null is only a place to start from: an onset may be anywhere in the log.
            loose = np.where(shapes(layout, name), SHAPELESS, FREE)
            precision.append((loose * scales(layout, name)) ** -2)
            reach.append(np.full(len(stated_values), np.inf))
    joint, whole = None, np.concatenate(precision)
    if (correlations := correlation_of(layout, names, free)) is not None:
        unit = np.sqrt(whole)
        joint = np.asarray(np.linalg.inv(correlations) * unit[:, None] * unit, dtype=np.float64)
    return Priors(np.concatenate(mean), whole, np.concatenate(reach), joint)


def correlation_of(layout: Layout, names: Sequence[str], free: Sequence[str] = ()) -> Array | None:
    """Return the correlations of the priors of the named effects' parameters, (P, P); None where there are none.

    What was fitted before is known by its saved covariance: the correlations of that, at the standard deviations that
    hold now. Effects that are asked for, and all that the model states, are independent of it.

    Args:
        layout: of the model.
        names: effects, in order of their parameters.
        free: those of them that are asked for.
    """
    if layout.joint is None:
        return None
    labels = []
    for name in names:
        known = name not in free and name in layout.spreads
        labels += [f"{name}.{p.name}" if known else "" for p in layout.described(name)]
    found = layout.joint.correlation(labels)
    if not (found - np.eye(len(labels))).any():
        return None
    # Parameters that were told apart no better than to rounding still have a precision.
    return (1.0 - SINGULAR) * found + SINGULAR * np.eye(len(labels))


def correlation_root(layout: Layout, names: Sequence[str], free: Sequence[str] = ()) -> Array | None:
    """Return L, (P, P), with L L^T = `correlation_of`; None where there are no correlations.

    Args:
        layout: stated values, and what is known of them together.
        names: effects whose P parameters are asked for, in order.
        free: effects of which nothing is taken as known.
    """
    found = correlation_of(layout, names, free)
    return None if found is None else np.asarray(np.linalg.cholesky(found), dtype=np.float64)


def shapes(layout: Layout, name: str) -> NDArray[np.bool_]:
    """Return which of an effect's parameters are shapes, (p,)."""
    return np.array([p.shape for p in layout.described(name)])


def one_sided(layout: Layout, name: str) -> NDArray[np.bool_]:
    """Return which of an effect's parameters have nothing below their nulls, (p,)."""
    return np.array([p.low == p.null and not p.shape for p in layout.described(name)])


def initial_guess(layout: Layout, name: str, estimate: Array) -> Array:
    """Return where to begin the fit of an effect, (p,): what its test estimates, on the side of its null that there is.

    A lag, however short, holds back the acceleration that is measured at the instant of a new command. The slope at the
    null knows nothing of that, and may point to where there is no lag: what matters is to leave the null.

    Args:
        layout: stated values.
        name: the effect.
        estimate: (p,) of its test at the null; NaN where it has none.
    """
    null = np.array([p.null for p in layout.described(name)])
    finite = np.where(np.isfinite(estimate), estimate, layout.means[name])
    return np.where(one_sided(layout, name), null + np.abs(finite - null), finite)


def scales(layout: Layout, name: str) -> Array:
    """Return the plausible departure of an effect's parameters from their nulls, (p,)."""
    return np.array([p.scale for p in layout.described(name)])
