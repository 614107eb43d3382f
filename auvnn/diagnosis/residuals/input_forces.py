"""A force and moment of every measured input at once: the probe by which what has no name is traced."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.effects import Body, Effect, Moment, Parameter
from auvnn.metrics.windows import POSITION, Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
AXES = ("X", "Y", "Z", "K", "M", "N")
ANGLES = ("phi", "theta", "psi")


class InputForces(Effect):
    """tau_i <- tau_i + sum_xk theta_ixk f_k(x), over measured inputs x and simple functions f of each.

    Of an angle f are sine and cosine of it and of its double; of anything else, as z in standard deviations about
    its mean, z, z^2 and |z| z. A fin's force grows with the square of the speed: in the place of z^2 there is
    (u^2 + v^2 + w^2) delta, in units of its own size. A probe of the diagnosis and of nothing else.
    """

    name = "input_forces"
    cause = "a force of what is measured"
    symbol = "tau_x"
    reference = "Hastie and Tibshirani (1990), additive models"

    def __init__(self, model: GreyBox, windows: Windows) -> None:
        """See what there is in the windows, and how far each input moves.

        Args:
            model: says how it is driven.
            windows: of the log.
        """
        raw = _raw_of(windows, windows.eta, windows.nu)
        names = _names(model, windows)
        seen = torch.as_tensor(np.arange(raw.shape[1]) < windows.length[:, None])
        values = raw[seen]
        mean, size = values.mean(0), values.std(0)
        # What stands still explains nothing.
        still = size <= 1e-9 + 1e-6 * values.abs().max(0).values
        if not bool(windows.mask[..., POSITION].any()):
            still[[names.index(n) for n in "xyz"]] = True
        moving = [k for k, n in enumerate(names) if n in ANGLES or not bool(still[k])]
        vehicle = model.vehicle
        force = 0.02 * float(vehicle.mass) * float(vehicle.gravity)
        sizes = [force] * 3 + [0.1 * force * float(vehicle.length)] * 3
        inputs: dict[str, slice] = {}
        labels, at = [], 0
        for k in moving:
            count = 4 if names[k] in ANGLES else 3
            inputs[names[k]] = slice(at, at + count)
            labels += [f"{names[k]}_{i + 1}" for i in range(count)]
            at += count
        super().__init__(
            tuple(
                Parameter(f"{a}_{n}", "N" if i < 3 else "N m", 0.0, sizes[i], -1e9, 1e9)
                for i, a in enumerate(AXES)
                for n in labels
            )
        )
        self.inputs = inputs
        self.keep("mean", mean.numpy())
        self.keep("spread", np.where(still.numpy(), 1.0, size.numpy()))
        pressed = _pressed(values[:, :3], values)
        self.keep("pressure", np.maximum(pressed.std(0).numpy(), 1e-9))
        self._moving = moving
        self._fins = [names[k].startswith("fin_") for k in moving]
        self._angle = [names[k] in ANGLES for k in moving]

    def columns(self, axis: int, name: str | None = None) -> NDArray[np.int64]:
        """Return which parameters are the force of an input, or of all inputs, in one degree of freedom."""
        per_axis = len(self.parameters_of) // 6
        part = slice(0, per_axis) if name is None else self.inputs[name]
        return np.arange(per_axis)[part] + axis * per_axis

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return what all inputs give."""
        rotation = moment.rotation
        euler = torch.stack(
            [
                torch.atan2(rotation[..., 2, 1], rotation[..., 2, 2]),
                torch.asin(-rotation[..., 2, 0].clamp(-1 + 1e-12, 1 - 1e-12)),
                torch.atan2(rotation[..., 1, 0], rotation[..., 0, 0]),
            ],
            dim=-1,
        )
        raw = _raw(
            moment.time, moment.position, euler, moment.nu, moment.command,
            moment.fins, moment.voltage, moment.altitude,
        ).detach()  # fmt: skip
        features = self.features(raw)
        return features @ self.theta.to(features).unflatten(0, (6, -1)).mT

    def along(self, windows: Windows, eta: Tensor, nu: Tensor) -> Tensor:
        """Return the functions of all inputs along trajectories, (B, L, I).

        Args:
            windows: B of L rows, for their times and what drives the vehicle.
            eta: position and quaternion, (B, L, 7).
            nu: velocity, m/s and rad/s, (B, L, 6).
        """
        return self.features(_raw_of(windows, eta, nu))

    def features(self, raw: Tensor) -> Tensor:
        """Return the functions of all inputs (..., I) side by side."""
        parts = []
        pressed = _pressed(raw[..., :3], raw) / torch.as_tensor(self.kept("pressure")).to(raw)
        for k, angle, fin in zip(self._moving, self._angle, self._fins, strict=True):
            x = raw[..., k]
            if angle:
                parts += [torch.sin(x), torch.cos(x), torch.sin(2 * x), torch.cos(2 * x)]
            else:
                z = (x - self.kept("mean")[k]) / self.kept("spread")[k]
                parts += [z, pressed[..., k] if fin else z * z, z.abs() * z]
        return torch.stack(parts, dim=-1)


def _raw_of(windows: Windows, eta: Tensor, nu: Tensor) -> Tensor:
    given = windows.inputs.rows(windows.warmup)
    return _raw(
        windows.times[:, windows.warmup :], eta[..., :3], _euler(eta[..., 3:]), nu,
        given.command, given.fins, given.voltage, given.altitude,
    )  # fmt: skip


def _pressed(velocity: Tensor, raw: Tensor) -> Tensor:
    """Return inputs times the square of the speed, (..., I): what goes with a fin's dynamic pressure."""
    return (velocity**2).sum(-1, keepdim=True) * raw


def _euler(quaternion: Tensor) -> Tensor:
    w, x, y, z = quaternion.unbind(-1)
    return torch.stack(
        [
            torch.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            torch.asin((2 * (w * y - z * x)).clamp(-1.0, 1.0)),
            torch.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ],
        dim=-1,
    )


def _raw(
    time: Tensor,
    position: Tensor,
    euler: Tensor,
    nu: Tensor,
    command: Tensor,
    fins: Tensor | None,
    voltage: Tensor | None,
    altitude: Tensor | None,
) -> Tensor:
    """Return all inputs in a row, (..., I); what is missing for a moment counts as nothing."""
    lead = nu.shape[:-1]
    parts = [
        nu,
        euler,
        position,
        time.to(nu).expand(lead).unsqueeze(-1),
        command.expand(*lead, command.shape[-1]),
    ]
    parts += [] if fins is None else [fins.expand(*lead, fins.shape[-1])]
    parts += [x.expand(lead).unsqueeze(-1) for x in (voltage, altitude) if x is not None]
    return torch.nan_to_num(torch.cat([p.to(nu) for p in parts], dim=-1))


def _names(model: GreyBox, windows: Windows) -> list[str]:
    given = windows.inputs
    commands = range(1, model.actuators.size + 1) if model.actuation == "thrusters" else AXES
    kind = "thruster" if model.actuation == "thrusters" else "tau"
    drive = [f"{kind}_{c}" for c in commands]
    fins = [] if given.fins is None else [f"fin_{i + 1}" for i in range(given.fins.shape[-1])]
    more = [n for n in ("voltage", "altitude") if getattr(given, n) is not None]
    return [*"uvwpqr", *ANGLES, *"xyz", "t", *drive, *fins, *more]
