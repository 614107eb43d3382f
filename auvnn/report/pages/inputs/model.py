"""The figures of a model: the values of its effects, and the forces that resist each motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure

from auvnn.models import Inputs
from auvnn.report.page import Page, Plot
from auvnn.report.pages.common import INTERVALS
from auvnn.report.panels import NoData
from auvnn.report.plots.damping_curves import damping_curves
from auvnn.report.plots.parameters import parameters
from auvnn.report.view import View

# Velocities over which damping is drawn where no log says better, m/s and rad/s.
SPEED, RATE = 1.5, 1.0
STATED = ("linear damping", "quadratic damping", "damping elements")


class ModelPage(Page):
    """What a model holds, drawn."""

    kind = "model"

    def title(self, view: View) -> str:
        """Return the heading."""
        return f"Model of {view.answer.vehicle.name}"

    def brief(self, view: View) -> list[str]:
        """Return what drives it and what it holds."""
        return [view.answer.card().line]

    def plots(self, view: View) -> list[Plot]:
        """Return the effects' values, where there are any, and the damping."""
        model, out = view.answer, []
        if model.effect_names:
            out.append(
                Plot("parameters", "Values of the effects", lambda: parameters(model.values()), INTERVALS)
            )
        words = (
            "Force and moment that resist each motion alone, in still water; the other velocities are zero."
        )
        out.append(Plot("damping", "Damping", lambda: _damping(model), words))
        return out


def _damping(model: Any) -> Figure:
    curves = []
    for axis in range(6):
        reach = SPEED if axis < 3 else RATE
        nu = np.linspace(-reach, reach, 81)
        states = torch.zeros(len(nu), 6, dtype=model.known_mass.dtype)
        states[:, axis] = torch.as_tensor(nu)
        with torch.no_grad():
            stated = _stated(model, states)[:, axis]
            learned = None if model.damping is None else model.damping(states)[:, axis].numpy()
        curve: dict[str, Any] = {"nu": nu, "learned": stated if learned is None else stated + learned}
        curves.append(curve | ({} if learned is None else {"nominal": stated}))
    if not any(np.any(c["learned"]) for c in curves):
        raise NoData("the model states no damping")
    words = "stated" if model.damping is None else "stated and learned"
    return damping_curves(curves, words=words)


def _stated(model: Any, states: Any) -> np.ndarray:
    """Return the stated drag at velocities (N, 6), with what effects make of its coefficients at the start of a run."""
    position, rotation = (
        torch.zeros(len(states), 3).to(states),
        torch.eye(3).expand(len(states), 3, 3).to(states),
    )
    thrust = states.new_zeros(len(states), model.actuators.size)
    terms = model.wrenches(position, rotation, states, thrust, Inputs(thrust), states.new_zeros(len(states)))
    found = [-terms[name].numpy() for name in STATED if name in terms]
    return sum(found, np.zeros(tuple(states.shape)))


PAGE = ModelPage()
