"""How the wrench that a model lacks would look if one effect or another had changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.func import functional_call, jacrev, vmap

import auvnn.estimation.point_slopes  # noqa: F401  registers Inputs with torch's function transforms
from auvnn.effects import EFFECTS, Parameter
from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import quat_to_matrix
from auvnn.physics.products import matvec

__all__ = ["KINDS", "SUBNETWORKS", "Columns", "Sensitivities"]

CHANNELS = ("fins", "voltage", "altitude")
SUBNETWORKS = "damping_subnetworks"
# What kind of change each effect stands for. A change of mass shows as one of added mass: both multiply nu_dot.
KINDS = {
    "drag": ("quadratic_damping", "linear_damping", SUBNETWORKS),
    "mass": ("added_mass",),
    "buoyancy": ("net_buoyancy", "cg_offset"),
    "actuator": ("thruster_gain",),
    "force": ("constant_force",),
}


@dataclass(frozen=True)
class Columns:
    """The parameters of one effect among the columns of the sensitivities.

    Attributes:
        effect: its name.
        columns: where.
        parameters: their description: name, unit, value at which they vanish, plausible size.
        now: (p,) the values that the model has.
    """

    effect: str
    columns: slice
    parameters: tuple[Parameter, ...]
    now: np.ndarray

    @property
    def scale(self) -> np.ndarray:
        """Plausible sizes of a change, (p,)."""
        return np.array([p.scale for p in self.parameters])


class _Wrench(nn.Module):
    """M nu_dot with the nominal M, as a function of the effects' parameters and of factors on the subnetworks."""

    inertia: Tensor

    def __init__(self, model: GreyBox, inertia: Tensor) -> None:
        super().__init__()
        self.model = model
        self.factor = nn.Parameter(torch.ones(6, dtype=torch.float64))
        self.register_buffer("inertia", inertia)

    def forward(
        self, position: Tensor, quaternion: Tensor, nu: Tensor, thrust: Tensor, inputs: Inputs, time: Tensor
    ) -> Tensor:
        rotation = quat_to_matrix(quaternion)
        wrench = matvec(self.inertia, self.model.nu_dot(position, rotation, nu, thrust, inputs, time))
        if self.model.damping is not None:
            # nu in place of the velocity through the water: the factor stands for the drag as a whole.
            wrench = wrench - (self.factor - 1.0) * self.model.damping(nu)
        return wrench


class Sensitivities:
    """Slopes of the missing wrench by the parameters of the effects that a change may be made of.

    Args:
        model: the one that residuals are taken from; effects that it has are linearised where they stand.
    """

    def __init__(self, model: GreyBox) -> None:
        """Add the effects at their nulls."""
        self.model = model
        present = model.effect_names
        wanted = [n for names in KINDS.values() for n in names if n != SUBNETWORKS]
        wanted = [n for n in wanted if n in present or not _excluded(model, n)]
        whole = model.with_effects([n for n in wanted if n not in present])
        with torch.no_grad():
            # Where the inertia itself varies in time, the vehicle's own number is near enough for a slope.
            inertia = (GreyBox(model.vehicle) if model.time_varying else model).prepare().total
        self._module = _Wrench(whole, inertia)
        self.columns: list[Columns] = []
        start = 0
        self._theta: dict[str, Tensor] = {}
        for index, effect in enumerate(whole.members):
            if effect.name not in wanted:
                continue
            count = len(effect.parameters_of)
            own = slice(start, start + count)
            self._theta[f"model.effects.{index}.theta"] = effect.theta.detach()
            now = effect.theta.detach().numpy().copy()
            self.columns.append(Columns(str(effect.name), own, effect.parameters_of, now))
            start += count
        if model.damping is not None:
            parameters = tuple(
                Parameter(a, "1", 1.0, 1.0, 0.01, 20.0) for a in ("X", "Y", "Z", "K", "M", "N")
            )
            self.columns.append(Columns(SUBNETWORKS, slice(start, start + 6), parameters, np.ones(6)))
            self._theta["factor"] = torch.ones(6, dtype=torch.float64)
            start += 6
        self.width = start

    def of(self, names: tuple[str, ...] | list[str]) -> list[Columns]:
        """Return the columns of some effects, those that the model cannot have left out."""
        return [c for c in self.columns if c.effect in names]

    @property
    def scale(self) -> np.ndarray:
        """Plausible sizes of all columns, (P,)."""
        return np.concatenate([c.scale for c in self.columns])

    def at(self, samples: list[Any], velocities: list[Tensor]) -> np.ndarray:
        """Return the slopes (n, 6, P) at the states of some samples, with the velocities given."""
        columns = {n: [getattr(s, n) for s in samples] for n in ("eta", "command", *CHANNELS)}
        stacked = {n: None if any(v is None for v in c) else torch.stack(c) for n, c in columns.items()}
        eta, command = stacked["eta"], stacked["command"]
        assert eta is not None and command is not None
        inputs = Inputs(command, stacked["fins"], stacked["voltage"], stacked["altitude"])
        axes = Inputs(*(None if x is None else 0 for x in (command, *list(stacked.values())[2:])))  # type: ignore[arg-type]
        time = torch.tensor([s.t for s in samples], dtype=eta.dtype)
        with torch.no_grad():
            thrust = self.model.actuators.static(command)
        names = list(self._theta)

        def one(
            theta: dict[str, Tensor], p: Tensor, q: Tensor, v: Tensor, f: Tensor, i: Inputs, t: Tensor
        ) -> Tensor:
            return functional_call(self._module, theta, (p, q, v, f, i, t))

        slope = vmap(jacrev(one), in_dims=(None, 0, 0, 0, 0, axes, 0))
        found = slope(self._theta, eta[:, :3], eta[:, 3:], torch.stack(velocities), thrust, inputs, time)
        return np.concatenate([found[n].detach().numpy() for n in names], axis=-1)


def _excluded(model: GreyBox, name: str) -> bool:
    """Say whether an effect cannot be added to those of the model."""
    own = EFFECTS.get(name).excludes
    return any(e in own for e in model.effect_names) or any(name in e.excludes for e in model.members)
