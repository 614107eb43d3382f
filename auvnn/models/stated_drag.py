"""The drag that a vehicle's file states, alone: what limits the damping subnetworks beside it."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from auvnn.physics.drag import element_transform
from auvnn.physics.products import matvec
from auvnn.vehicle import Vehicle


class StatedDrag(nn.Module):
    """D_L nu + D_Q |nu| nu + sum T' f(T nu) of a vehicle's file, without effects.

    Args:
        vehicle: whose file states the drag.
    """

    linear: Tensor
    quadratic: Tensor
    transform: Tensor
    law: Tensor

    def __init__(self, vehicle: Vehicle) -> None:
        """Take the numbers over as buffers that no file holds twice."""
        super().__init__()

        def tensor(value: object) -> Tensor:
            return torch.tensor(value, dtype=torch.float64)

        def matrix(value: object) -> Tensor:
            return torch.zeros(6, 6, dtype=torch.float64) if value is None else tensor(value)

        elements = vehicle.damping_elements
        ways = [element_transform(tensor(e.position), tensor(e.axes)) for e in elements]
        laws = [tensor([list(e.linear), list(e.quadratic)]) for e in elements]
        kept = {
            "linear": matrix(vehicle.linear_damping),
            "quadratic": matrix(vehicle.quadratic_damping),
            "transform": torch.stack(ways) if ways else torch.zeros(0, 6, 6, dtype=torch.float64),
            "law": torch.stack(laws) if laws else torch.zeros(0, 2, 6, dtype=torch.float64),
        }
        for name, value in kept.items():
            self.register_buffer(name, value, persistent=False)

    def forward(self, nu: Tensor) -> Tensor:
        """Return the drag (..., 6), N and N m, positive against the motion, at velocities (..., 6)."""
        whole = matvec(self.linear, nu) + matvec(self.quadratic, nu.abs() * nu)
        for way, law in zip(self.transform, self.law, strict=True):
            own = matvec(way, nu)
            whole = whole + matvec(way.mT, (law[0] + law[1] * own.abs()) * own)
        return whole
