"""Peers in torch: torchdiffeq on the model's own right-hand side, and on one written for speed alone."""

from __future__ import annotations

import torch
from standard import STEP, STEPS, Work
from torch import Tensor

from auvnn.models.free_running.rate import state_rate
from auvnn.models.inputs import Inputs
from auvnn.physics.attitude import _MATRIX, _RATE
from auvnn.physics.coriolis import _FORCE


class Own(torch.nn.Module):
    """The model's own right-hand side as torchdiffeq wants it."""

    def __init__(self, work: Work) -> None:
        super().__init__()
        self.model, self.command = work.model, work.command
        self.prepared = None

    def forward(self, t: Tensor, y: Tensor) -> Tensor:
        row = self.command[min(int(float(t) / STEP + 1e-9), STEPS)]
        return state_rate(self.model, y, row, Inputs(row), t, self.prepared)

    def begin(self) -> None:
        self.prepared = self.model.prepare()


class Lean(torch.nn.Module):
    """The same equations for this one vehicle in as few operations as torch allows."""

    def __init__(self, work: Work) -> None:
        super().__init__()
        prepared, bank = work.model.prepare(), work.model.damping
        self.command, self.bank, self.form = work.command, bank, bank.forms[0]
        body = prepared.body
        self.mass_t, self.inverse_t = prepared.total.T.contiguous(), prepared.inverse.T.contiguous()
        self.lift = body.buoyancy - body.weight
        arm = body.buoyancy * body.cb - body.weight * body.cg
        cross = torch.tensor(
            [[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]], dtype=torch.float64
        )
        self.restoring_t = torch.cat([self.lift * torch.eye(3, dtype=torch.float64), cross], 0).T.contiguous()

    def begin(self) -> None:
        self.weight_t = self.form.hidden_weight.flatten(0, 1).T
        self.bias = self.form.hidden_bias.flatten()

    def forward(self, t: Tensor, y: Tensor) -> Tensor:
        row = self.command[min(int(float(t) / STEP + 1e-9), STEPS)]
        q, nu = y[3:7], y[7:]
        rotation = ((q[:, None] * q).flatten() @ _MATRIX.table.like(q)).view(3, 3)
        scaled = nu / self.bank.input_scale
        hidden = torch.tanh(torch.cat([scaled, scaled.abs() * scaled]) @ self.weight_t + self.bias).view(6, 5)
        damping = (
            (hidden * self.form.output_weight).sum(-1) + self.form.output_bias
        ) * self.bank.output_scale
        coriolis = (nu[:, None] * (nu @ self.mass_t)).flatten() @ _FORCE.table.like(nu)
        force = row - rotation[2] @ self.restoring_t - coriolis - damping
        spin = (q[:, None] * nu[3:]).flatten() @ _RATE.table.like(q)
        return torch.cat([rotation @ nu[:3], spin, force @ self.inverse_t])


def run(side: torch.nn.Module, work: Work) -> Tensor:
    """Return the states (3001, 13) by torchdiffeq's rk4 (3/8 rule) with steps of 0.01 s."""
    from torchdiffeq import odeint

    side.begin()
    y0 = torch.cat([work.eta0, work.nu0])
    return odeint(side, y0, work.times, method="rk4")


def run_and_gradient(side: torch.nn.Module, work: Work) -> list[Tensor]:
    """Return the gradient in the weights by back-propagation."""
    for p in work.model.parameters():
        p.grad = None
    run(side, work)[:, 7:].square().sum().backward()
    return [p.grad for p in work.model.parameters()]
