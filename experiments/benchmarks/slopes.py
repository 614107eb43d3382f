"""Slopes of the acceleration at many moments, by machine code and by torch's reverse mode, in turns."""

from __future__ import annotations

from typing import Any

import torch
from measure import race

from auvnn.estimation import point_slopes
from auvnn.estimation.compiled_slopes import compiled_slopes
from auvnn.estimation.point_slopes import OperatingPoint, differentiate
from auvnn.models import GreyBox, Inputs
from auvnn.vehicle import load_vehicle

MOMENTS = 4800
NAMES = {
    "added_mass": None,
    "linear_damping": None,
    "quadratic_damping": None,
    "ocean_current": {"v_north": 0.2},
}


def slopes(repeats: int) -> dict[str, Any]:
    """Return seconds of both, and the largest difference relative to the largest slope.

    Args:
        repeats: of each.
    """
    model = GreyBox(load_vehicle("rov95")).with_effects(NAMES)
    generator = torch.Generator().manual_seed(1)

    def draw(*shape: int) -> torch.Tensor:
        return torch.randn(48, MOMENTS // 48, *shape, generator=generator, dtype=torch.float64)

    thrusters = model.actuators.size
    quaternion = torch.nn.functional.normalize(draw(4), dim=-1)
    points = (
        draw(3),
        quaternion,
        0.5 * draw(6),
        10.0 * draw(thrusters),
        draw(),
        Inputs(0.4 * draw(thrusters)),
    )
    thetas = {f"model.effects.{k}.theta": e.theta.detach() for k, e in enumerate(model.members)}
    module = OperatingPoint(model)

    def by_torch() -> torch.Tensor:
        point_slopes.compiled_slopes = lambda *given: None  # type: ignore[assignment]
        try:
            return differentiate(module, "rate", points, thetas, 2048)
        finally:
            point_slopes.compiled_slopes = compiled_slopes

    def compiled() -> torch.Tensor:
        found = compiled_slopes(module, "rate", points, thetas)
        assert found is not None, "there is no compiler"
        return found

    timings = race([("auvnn, compiled", compiled, repeats), ("torch, reverse mode", by_torch, repeats)])
    mine, theirs = compiled(), by_torch()
    return {
        "parameters": sum(t.numel() for t in thetas.values()),
        "difference": float((mine - theirs).abs().max() / theirs.abs().max()),
        "rows": [t.to_dict() for t in timings],
    }
