"""Derivatives of the acceleration, and of what sensors report, at many moments at once."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.func import functional_call, jacrev, vmap
from torch.utils._pytree import register_pytree_node

from auvnn.effects import Sensed
from auvnn.estimation.compiled_slopes import compiled_slopes
from auvnn.estimation.linear_effects import (
    Added,
    LinearEffect,
    concatenate_slopes,
    record_slopes,
    with_slopes,
    zero_slopes,
)
from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import (
    quat_conjugate,
    quat_multiply,
    quat_to_matrix,
    quat_to_rotvec,
    rotvec_to_quat,
    skew,
)


class OperatingPoint(nn.Module):
    """The acceleration and the sensors' report at one moment, as functions of small changes."""

    def __init__(self, model: GreyBox) -> None:
        super().__init__()
        self.model = model

    def forward(
        self,
        what: str,
        position: Tensor,
        quaternion: Tensor,
        turn: Tensor,
        nu: Tensor,
        thrust: Tensor,
        time: Tensor,
        inputs: Inputs,
    ) -> Tensor:
        """Return the acceleration ("rate"), what sensors report ("sense"), or that with the rate ("sense and rate").

        Args:
            what: which of them.
            position: m, (3,).
            quaternion: attitude, (4,).
            turn: small rotation of the body axes, rad, (3,); zero, but differentiated by.
            nu: (6,).
            thrust: (n,).
            time: s.
            inputs: of the moment.
        """
        rotation = quat_to_matrix(quaternion)
        # First order in `turn` is all that a derivative at zero needs.
        rotation = rotation + rotation @ skew(turn)
        if what == "rate":
            return self.model.nu_dot(position, rotation, nu, thrust, inputs, time, first_order=True)
        rate = None
        if what == "sense and rate":
            rate = self.model.nu_dot(position, rotation, nu, thrust, inputs, time, first_order=True)
        turned = quat_multiply(quaternion, rotvec_to_quat(turn))
        seen = self.model.sense(Sensed(position, turned, nu, rate))
        angle = quat_to_rotvec(quat_multiply(quat_conjugate(quaternion), seen.quaternion))
        parts = [seen.position, angle, seen.nu]
        return torch.cat(parts if seen.nu_dot is None else [*parts, seen.nu_dot], dim=-1)


def flat(inputs: Inputs) -> tuple[Inputs, Inputs]:
    """Return inputs with (B, L) joined, and the axes over which `vmap` runs."""
    fields = (inputs.command, inputs.fins, inputs.voltage, inputs.altitude)
    flat = [None if x is None else x.flatten(0, 1) for x in fields[1:]]
    joined = Inputs(inputs.command.flatten(0, 1), *flat)
    return joined, Inputs(*(None if x is None else 0 for x in fields))  # type: ignore[arg-type]


def differentiate(
    module: OperatingPoint, what: str, points: tuple, thetas: dict[str, Tensor], chunk: int
) -> Tensor:
    """Return derivatives of a function of a point, (N, out, 12 + n + P).

    The columns are those of position, turn and velocity, of the n thrusts, and of each theta in turn.

    Args:
        module: the model's functions of a point.
        what: which of them; see `OperatingPoint.forward`.
        points: position, rotation, velocity, thrust, time and inputs, N of each.
        thetas: parameters by their names in the module.
        chunk: points that are differentiated at a time.
    """
    compiled = compiled_slopes(module, what, points, thetas)
    if compiled is not None:
        return compiled
    members = {f"model.effects.{k}.theta": e for k, e in enumerate(module.model.members)}
    replayed = {key: e for key, e in members.items() if key in thetas and isinstance(e, LinearEffect)}
    others = {key: theta for key, theta in thetas.items() if key not in replayed}
    effects, turn = list(replayed.values()), points[2].new_zeros(3)

    def note(p: Tensor, q: Tensor, v: Tensor, f: Tensor, t: Tensor, extra: Inputs) -> list[Added]:
        return record_slopes(effects, lambda: module(what, p, q, turn, v, f, t, extra))

    def one(
        p: Tensor,
        turn: Tensor,
        v: Tensor,
        f: Tensor,
        theta: dict[str, Tensor],
        parts: list[Added],
        q: Tensor,
        t: Tensor,
        extra: Inputs,
    ) -> Tensor:
        return with_slopes(
            effects, parts, lambda: functional_call(module, theta, (what, p, q, turn, v, f, t, extra))
        )

    position, quaternion, nu, thrust, time = (x.flatten(0, 1) for x in points[:5])
    inputs, axes = flat(points[5])
    slope = jacrev(one, argnums=(0, 1, 2, 3, 4, 5))
    many = vmap(slope, in_dims=(0, None, 0, 0, None, None, 0, 0, axes))
    size = 12 + thrust.shape[-1] + sum(theta.numel() for theta in thetas.values())
    # The largest of all arrays: made once, and not joined from pieces.
    found = nu.new_empty(0)
    for begin in range(0, len(nu), chunk):
        p, q, v, f, t = (x[begin : begin + chunk] for x in (position, quaternion, nu, thrust, time))
        extra = inputs.rows(begin, begin + chunk)
        of = vmap(note, in_dims=(0, 0, 0, 0, 0, axes))(p, q, v, f, t, extra) if effects else []
        by = many(p, turn, v, f, others, zero_slopes(of), q, t, extra)
        through = {key: concatenate_slopes(by[5][k], of[k]) for k, key in enumerate(replayed)}
        by_theta = [through[key] if key in through else by[4][key].flatten(2) for key in thetas]
        if not len(found):
            found = nu.new_empty(len(nu), by[0].shape[1], size)
        torch.cat([x.detach() for x in (*by[:4], *by_theta)], dim=-1, out=found[begin : begin + chunk])
    return found


def _flatten_inputs(i: Inputs) -> tuple[list, None]:
    return [i.command, i.fins, i.voltage, i.altitude], None


# `vmap` must see the tensors inside.
register_pytree_node(Inputs, _flatten_inputs, lambda children, _: Inputs(*children))
