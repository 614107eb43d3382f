"""Linear or quadratic drag in degrees of freedom in which the model states none."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from auvnn.effects.base import AXES, Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.effects.sizes import translational_drag, usual_speeds
from auvnn.physics.drag import element_transform

KINDS = ("linear", "quadratic")


class UnstatedDamping(Effect):
    """Drag of a kind that the model file does not state: D_L <- D_L + diag(d), D_Q <- D_Q + diag(q), q on |nu_i| nu_i.

    Factors on the stated damping (`linear_damping`, `quadratic_damping`) cannot say that a coefficient is not zero.
    Models often have one of the two kinds alone, or none in some degrees of freedom. The coefficients are those where
    nothing is stated; where the file states both kinds everywhere, all twelve are there, and a diagnosis asks for the
    factors instead. A plausible size is half of the drag of the other kind at a usual speed, 0.16 sqrt(g L), for turning
    0.128 sqrt(g / L); of a bluff body where nothing is stated at all. Reference: Fossen (2011), section 6.4.
    """

    name = "unstated_damping"
    cause = "there is linear or quadratic drag where the model states none"
    symbol = "D_L, D_Q"
    reference = "Fossen (2011), section 6.4"
    confused_with = (
        "drag_curve",
        "linear_damping",
        "quadratic_damping",
        "thrust_inflow_loss",
        "thruster_gain",
    )
    manoeuvre = "coast_down"
    told_apart_by = "coasting without thrust over at least four to one in speed"

    @classmethod
    def lacks(cls, vehicle: Any, actuation: str) -> tuple[str, ...]:
        """Return what keeps it from being asked for: a model file that states both kinds everywhere."""
        return ("damping that is not stated",) if _stated(vehicle).all() else ()

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one coefficient for each kind and degree of freedom that is not stated."""
        sizes, stated, out = _plausible(vehicle), _stated(vehicle), []
        for k, kind in enumerate(KINDS):
            for i, axis in enumerate(AXES):
                if not stated[k, i] or stated.all():
                    size = float(sizes[k, i])
                    out.append(Parameter(f"{kind}_{axis}", _unit(kind, axis), 0.0, size, 0.0, 200.0 * size))
        return tuple(out)

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep where each coefficient stands in its matrix."""
        place = np.zeros((len(self.parameters_of), 2, 6, 6))
        for j, p in enumerate(self.parameters_of):
            kind, _, axis = p.name.partition("_")
            i = AXES.index(axis)
            place[j, KINDS.index(kind), i, i] = 1.0
        self.keep("place", place)

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Add to the damping, of which there may have been none."""
        more = torch.tensordot(self.theta, self.kept("place"), dims=1).to(body.added_mass)
        if self._has("linear"):
            body = body.but(linear=more[0] if body.linear is None else body.linear + more[0])
        if self._has("quadratic"):
            body = body.but(quadratic=more[1] if body.quadratic is None else body.quadratic + more[1])
        return body

    def _has(self, kind: str) -> bool:
        return any(p.name.startswith(kind) for p in self.parameters_of)


def _unit(kind: str, axis: str) -> str:
    """Return the unit of a coefficient."""
    if axis in "XYZ":
        return "N s/m" if kind == "linear" else "N s2/m2"
    return "N m s" if kind == "linear" else "N m s2"


def _coefficients(vehicle: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return what is stated of both kinds in each degree of freedom, (2, 6), displaced elements in it."""
    out = np.zeros((2, 6))
    for k, kind in enumerate(KINDS):
        matrix = getattr(vehicle, f"{kind}_damping")
        if matrix is not None:
            out[k] += np.diag(matrix)
        for element in vehicle.damping_elements:
            place, axes = (torch.tensor(np.array(x)) for x in (element.position, element.axes))
            # What resists a unit of velocity in each degree of freedom: T^T D |T nu|^k T nu.
            reach = np.abs(element_transform(place, axes).numpy())
            out[k] += np.asarray(getattr(element, kind)) @ reach ** (2 + k)
    return np.where(out > 1e-9 * out.max(), out, 0.0)


def _stated(vehicle: Any) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return whether the model file states each kind in each degree of freedom, (2, 6)."""
    return np.abs(_coefficients(vehicle)) > 0.0


def _plausible(vehicle: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return plausible sizes of the coefficients, (2, 6)."""
    linear, quadratic = _coefficients(vehicle)
    speed, along = usual_speeds(vehicle), translational_drag(vehicle)
    arm = 0.25 * float(vehicle.length)
    # Of a bluff body: the drag across the hull at a quarter of its length gives the moments.
    bluff = np.concatenate([along, np.full(3, along.max() * arm**3)])
    known = np.where(quadratic > 0.0, quadratic, np.where(linear > 0.0, linear / speed, bluff))
    return 0.5 * np.stack([known * speed, known])
