"""The forces behind an answer: what each effect exerts over a log, and what the actuators do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.window_simulation import Thrust, substeps_of
from auvnn.metrics.free_run import predict
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.physics.attitude import quat_to_matrix
from auvnn.physics.fins import fin_force

Array = NDArray[np.float64]
AXES = ("X", "Y", "Z", "K", "M", "N")
# A degree of freedom that the actuators hardly drive is measured by this share of the one that they drive most.
LEAST = 0.1
# An effect acts most in the degrees of freedom in which it has so large a share of its largest share of the actuators'.
MOST = 0.5


def forces_of(
    found: FittedHypothesis,
    windows: Windows,
    names: Sequence[str],
    stated: Mapping[str, Array] | None = None,
) -> dict[str, Array]:
    """Return the root mean square force of each effect along the fitted motion, (6,), N and N m.

    It is what the equations of motion lose without the effect, nothing else changed: M (nu_dot with - nu_dot without)
    at the same states and commands. An effect of the sensors exerts none.

    Args:
        found: the fit.
        windows: those it was fitted to.
        names: effects in it.
        stated: of effects that the model has with other values, these: what is lost then is the change.
    """
    model = found.fitted.model
    with torch.no_grad():
        lean = model.without_absent()
        eta, nu = predict(lean, windows, found.fitted.initial)
        seen = torch.as_tensor(np.arange(nu.shape[1]) < windows.length[:, None])
        whole = _rate(lean, windows, eta, nu)
        out = {}
        for name in names:
            if stated is not None and name in stated:
                less = model.rebuilt(model.copied_effects())
                set_parameters(less, [name], stated[name])
                less = less.without_absent()
            else:
                less = model.sharing([e for e in model.members if e.name != name]).without_absent()
            change = whole - _rate(less, windows, eta, nu)
            wrench = (change @ _inertia(model).mT)[seen]
            finite = torch.isfinite(wrench).all(-1)
            out[name] = (
                torch.sqrt((wrench[finite] ** 2).mean(0)).numpy() if finite.any() else np.full(6, np.nan)
            )
    return out


def actuators_of(model: GreyBox, windows: Windows) -> Array:
    """Return the root mean square wrench that commands and fins stand for, actuators settled, (6,), N and N m."""
    command = windows.inputs.command[:, windows.warmup :]
    with torch.no_grad():
        wrench = model.actuators.static(command) @ model.actuators.allocation.mT + fins_of(model, windows)
    seen = torch.as_tensor(np.arange(command.shape[1]) < windows.length[:, None])
    kept = wrench[seen]
    kept = kept[torch.isfinite(kept).all(-1)]
    return torch.sqrt((kept**2).mean(0)).numpy() if len(kept) else np.zeros(6)


def fins_of(model: GreyBox, windows: Windows) -> Tensor:
    """Return the wrench of the fins in still water at the measured velocities, (B, L, 6); zeros without fins."""
    angles = windows.inputs.fins
    if angles is None:
        return torch.zeros(1, windows.inputs.command.shape[1] - windows.warmup, 6, dtype=torch.float64)
    vehicle = model.vehicle
    place, axis, area, slope, stall = (
        torch.tensor(np.array([getattr(f, n) for f in vehicle.fins]), dtype=torch.float64)
        for n in ("position", "axis", "area", "lift_slope", "stall")
    )
    density = float(vehicle.water_density)
    return fin_force(windows.nu, angles[:, windows.warmup :], place, axis, area, slope, stall, density)


def exerts_less(
    found: FittedHypothesis,
    windows: Windows,
    further: str,
    names: Sequence[str],
    stated: Mapping[str, Array] | None = None,
    times: float = 1.0,
) -> bool:
    """Whether an effect exerts less than others together, or than several times that, where it acts most.

    What the form of an effect gets wrong is less than what the effect does itself, in the degrees of freedom in which it
    acts: a thrust curve of another shape leaves a mean force that is a part of what the curve changes.

    Args:
        found: the fit.
        windows: those it was fitted to.
        further: the effect.
        names: the others; all are in the fit.
        stated: of effects that the model has with other values, these: what counts then is the change.
        times: by which the force of the others is multiplied.
    """
    forces = forces_of(found, windows, [further, *names], stated)
    own, others = forces[further], np.sqrt(sum(forces[name] ** 2 for name in names))
    share = np.nan_to_num(share_of(own, actuators_of(found.fitted.model, windows)))
    acts = (share > 0.0) & (share >= MOST * share.max())
    return bool(acts.any() and (own < times * others)[acts].all())


def share_of(force: Array, actuators: Array) -> Array:
    """Return a force as a share of the actuators' in each degree of freedom, (6,); NaN where they do nothing.

    Args:
        force: (6,), N and N m.
        actuators: (6,) theirs.
    """
    most = np.repeat([actuators[:3].max(), actuators[3:].max()], 3)
    scale = np.maximum(actuators, LEAST * most)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(scale > 0, force / scale, np.nan)


def _rate(model: GreyBox, windows: Windows, eta: Tensor, nu: Tensor) -> Tensor:
    """Return the acceleration at given states, (B, L, 6)."""
    _, thrust = Thrust(model)(windows, substeps_of(windows))
    return model.nu_dot(
        eta[..., :3],
        quat_to_matrix(eta[..., 3:]),
        nu,
        thrust,
        windows.inputs.rows(windows.warmup),
        windows.times[:, windows.warmup :],
    )


def _inertia(model: GreyBox) -> Tensor:
    """Return mass and added mass, (6, 6); of an effect that changes them in time, the vehicle's own."""
    return (GreyBox(model.vehicle) if model.time_varying else model).prepare().total
