"""A learned wrench for what no name explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import AXES, Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.effects.sizes import full_wrench
from auvnn.errors import ConfigError

SPEEDS = "uvwpqr"
INPUTS = ("velocity", "tilt", "heading", "command")
SLOPES = (0.7, 3.0)
"""Slopes of the gates in the speeds, per usual speed: one that goes on rising, one that is soon open."""


class ResidualForce(Effect):
    """Force and moment from a small network whose units see one input each.

    tau_i <- tau_i - (nu_i / s_i) sum_jh a_ijh tanh(c_h |nu_j| / s_j) + sum_kh b_ikh f_h(x_k)

    The first sum depends on the velocity through the water; with a >= 0 it never adds energy. The second sees
    what is no velocity: the direction of down in body axes, the heading's cosine and sine, the commands as shares
    of full effort; f_1 = tanh(2 x), f_2 = tanh(2 x^2). All weights are forces or moments, and at zero nothing
    is left. Only outer weights are fitted, so the fit has one minimum and the weights say which inputs count.
    The inputs are chosen when it is built, by default all; a model that was saved keeps its choice, by the
    parameters that it states. As a cause it names nothing, so the catalogue does not offer it.
    Reference: Van de Ven et al. (2004), section 3, for networks added to known physics; Hastie and Tibshirani (1990)
    for additive models.
    """

    name = "residual_force"
    cause = "a force that no name explains"
    symbol = "tau_r"
    reference = "Van de Ven et al. (2004), section 3; Hastie and Tibshirani (1990)"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str, inputs: Sequence[str] = INPUTS) -> tuple[Parameter, ...]:
        """Return the weights: `X_u_1` for the drag in surge by the speed u, `N_tilt_x_2` for a moment by tilt.

        Args:
            vehicle: for its weight and length.
            actuation: "thrusters" or "wrench".
            inputs: what the force may depend on, of `INPUTS`.
        """
        force = 0.02 * float(vehicle.mass) * float(vehicle.gravity)
        sizes = [force] * 3 + [0.2 * force * float(vehicle.length)] * 3
        drag = [f"{s}_{h + 1}" for s in SPEEDS for h in range(len(SLOPES))] if "velocity" in inputs else []
        others = [f"{x}_{h}" for x in _others(vehicle, actuation, inputs) for h in (1, 2)]
        out = []
        for axis, size in zip(AXES, sizes, strict=True):
            unit = "N" if axis in "XYZ" else "N m"
            out += [Parameter(f"{axis}_{n}", unit, 0.0, size, 0.0, 1e3 * size) for n in drag]
            out += [Parameter(f"{axis}_{n}", unit, 0.0, size, -1e3 * size, 1e3 * size) for n in others]
        return tuple(out)

    @classmethod
    def build(
        cls,
        vehicle: Any,
        actuation: str,
        values: Mapping[str, float] | None = None,
        inputs: Sequence[str] | None = None,
    ) -> ResidualForce:
        """Make it for a vehicle, of chosen inputs; by default of those that the values name, or else of all.

        Args:
            vehicle: the known numbers.
            actuation: "thrusters" or "wrench".
            values: weights by name; those that are not given are zero.
            inputs: what the force may depend on, of `INPUTS`.

        Raises:
            ConfigError: an input that there is not.
        """
        if inputs is None:
            inputs = [i for i in INPUTS if any(_kind(n) == i for n in values or {})] or INPUTS
        strange = [i for i in inputs if i not in INPUTS]
        if strange or not inputs:
            raise ConfigError(
                f"{cls.name} has no input {strange or 'at all'}: choose from {', '.join(INPUTS)}"
            )
        effect = cls(cls.describe(vehicle, actuation, inputs), values)
        effect.inputs = tuple(i for i in INPUTS if i in inputs)
        effect.settle(vehicle, actuation)
        return effect

    inputs: tuple[str, ...] = INPUTS

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep usual speeds and what a full command is."""
        length, gravity = float(vehicle.length), float(vehicle.gravity)
        speed, rate = 0.15 * (length * gravity) ** 0.5, 0.15 * (gravity / length) ** 0.5
        self.keep("usual", [speed] * 3 + [rate] * 3)
        self.keep("slopes", SLOPES)
        self.keep("full", full_wrench(vehicle) if actuation == "wrench" else [1.0] * len(vehicle.thrusters))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the learned wrench."""
        weights = self.theta.to(moment.nu).unflatten(0, (6, -1))
        out, at = torch.zeros_like(moment.nu), 0
        if "velocity" in self.inputs:
            share = moment.nu_r / self.kept("usual").to(moment.nu)
            gates = torch.tanh(share.abs().unsqueeze(-1) * self.kept("slopes").to(share)).flatten(-2)
            at = gates.shape[-1]
            out = out - share * (gates @ weights[:, :at].mT)
        seen = self._seen(moment)
        if seen is None:
            return out
        units = torch.stack([torch.tanh(2 * seen), torch.tanh(2 * seen * seen)], dim=-1).flatten(-2)
        return out + units @ weights[:, at:].mT

    def _seen(self, moment: Moment) -> Tensor | None:
        parts = []
        if "tilt" in self.inputs:
            parts.append(moment.rotation[..., 2, :])
        if "heading" in self.inputs:
            parts.append(moment.rotation[..., :2, 0])
        if "command" in self.inputs:
            parts.append(moment.command.to(moment.nu) / self.kept("full").to(moment.nu))
        if not parts:
            return None
        lead = torch.broadcast_shapes(*(p.shape[:-1] for p in parts), moment.nu.shape[:-1])
        return torch.cat([p.expand(*lead, p.shape[-1]) for p in parts], dim=-1)

    def shares(self) -> dict[str, float]:
        """Return which inputs it uses: each one's share of the weights, in units of their scales, largest first."""
        found: dict[str, float] = {}
        for p, value in zip(self.parameters_of, self.theta.tolist(), strict=True):
            label = p.name.partition("_")[2].rpartition("_")[0]
            found[label] = found.get(label, 0.0) + (value / p.scale) ** 2
        total = sum(found.values())
        ordered = sorted(found.items(), key=lambda item: -item[1])
        return {k: v / total for k, v in ordered} if total > 0 else {}

    def words(self) -> str:
        """Say which inputs it uses."""
        used = [f"{k} {v:.0%}" for k, v in self.shares().items() if v >= 0.02]
        return f"{self.name} uses {', '.join(used) or 'nothing'} (shares of its weights)"


def _others(vehicle: Any, actuation: str, inputs: Sequence[str]) -> list[str]:
    count = 6 if actuation == "wrench" else len(vehicle.thrusters)
    names = {
        "tilt": ["tilt_x", "tilt_y", "tilt_z"],
        "heading": ["heading_north", "heading_east"],
        "command": [f"command_{i + 1}" for i in range(count)],
    }
    return [n for i in INPUTS if i in inputs for n in names.get(i, [])]


def _kind(parameter: str) -> str:
    """Return the input of a parameter's name."""
    middle = parameter.partition("_")[2].rpartition("_")[0]
    return "velocity" if middle in SPEEDS and middle else middle.partition("_")[0]
