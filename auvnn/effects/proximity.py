"""What bottom and surface have in common: a boundary that changes added mass and drag; no effect itself."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.effects.sizes import radius
from auvnn.physics.products import matvec


class Proximity(Effect):
    """Added mass M_A (1 + f) and drag (1 + f) with f(h) = sign strength (R/h)^exponent at distance h.

    R is the radius of the sphere of the vehicle's volume; closer than R the law is held. Kirchhoff's equations
    with the energy T = 1/2 (1 + f) nu' M_A nu add two forces to those of the changed mass:

        -f' h_dot M_A nu + 1/2 f' (nu' M_A nu) grad h

    which pull the vehicle towards a wall that it slides along where f falls with h.
    """

    sign = 1.0
    time_varying = True

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return strength and exponent; a sphere has 3/8 and 3."""
        return (
            Parameter("strength", "1", 0.0, 0.3, 0.0, 50.0 if cls.sign > 0 else 0.9),
            Parameter("exponent", "1", 3.0, 0.7, 1.0, 6.0, shape=True),
        )

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep the vehicle's size."""
        self.keep("radius", radius(vehicle))

    def distance(self, moment: Moment) -> tuple[Tensor, float] | None:
        """Return the distance to the boundary, m, and its slope with depth, 1 or -1; None where unknown."""
        raise TypeError(f"{type(self).__name__} does not say how far the boundary is")

    def _share(self, moment: Moment) -> tuple[Tensor, Tensor, float] | None:
        found = self.distance(moment)
        if found is None:
            return None
        away, slope = found
        limit = self.kept("radius").to(away)
        h = torch.maximum(away, limit)
        strength, exponent = self.theta.to(h).unbind(-1)
        f = self.sign * strength * (limit / h) ** exponent
        return f, torch.where(away > limit, -exponent * f / h, torch.zeros_like(f)), slope

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Change the added mass."""
        found = None if moment is None else self._share(moment)
        if found is None:
            return body
        return body.but(added_mass=body.added_mass * (1 + found[0])[..., None, None])

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the change of the drag and the forces of the changing energy."""
        assert moment.drag is not None
        found = self._share(moment)
        if found is None:
            return torch.zeros_like(moment.nu)
        f, change, slope = found
        # The matrix has grown by 1 + f already.
        momentum = matvec(body.added_mass, moment.nu_r) / (1 + f).unsqueeze(-1)
        down = moment.rotation[..., 2, :]
        sinking = (down * moment.nu[..., :3]).sum(-1)
        energy = 0.5 * (moment.nu_r * momentum).sum(-1)
        pull = torch.nn.functional.pad((change * slope * energy).unsqueeze(-1) * down, (0, 3))
        return f.unsqueeze(-1) * moment.drag - (change * slope * sinking).unsqueeze(-1) * momentum + pull
