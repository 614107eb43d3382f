"""A mission in which a cylinder is picked up on the way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from auvnn.errors import ConfigError
from auvnn.logs import Run
from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import quat_to_matrix
from auvnn.simulation.noise import Draws, make_noise
from auvnn.studies.paper.cylinder import Cylinder, factored, grasp, with_cylinder
from auvnn.studies.paper.following import (
    Array,
)
from auvnn.studies.paper.options import Options, number
from auvnn.studies.paper.plant import (
    manoeuvre_log,
)


@dataclass(frozen=True)
class Mission:
    """A run in which a payload is picked up.

    Attributes:
        truth: the plant's motion; the row of the pick-up holds the velocity just after it.
        live: the same as it is measured.
        row: of the pick-up.
        loaded: the plant from there on.
        jump: by which the velocity is multiplied at the pick-up (6, 6), or None.
        factors: on the damping coefficients, empty in the physical variant.
    """

    truth: Run
    live: Run
    row: int
    loaded: GreyBox
    jump: Array | None
    factors: list[float]


def pick_up(plant: GreyBox, options: Options, variant: str) -> Mission:
    """Return a mission: the manoeuvre, with the cylinder picked up on the way.

    Args:
        plant: the vehicle without load.
        options: of the study.
        variant: what the vehicle's model knows of the load.

    Raises:
        ConfigError: the pick-up does not lie within the manoeuvre.
    """
    case, vehicle = options.case, plant.vehicle
    first = manoeuvre_log(plant, options).runs[0]
    row = int(np.searchsorted(first.t, _check_time(options) - 1e-9))
    cylinder = Cylinder.build(
        number(case["mass"], "case.mass"),
        case["cylinder"],
        float(vehicle.water_density),
        float(vehicle.gravity),
    )
    loaded, factors, jump = with_cylinder(vehicle, cylinder), [], None
    if variant == "paper":
        low, high = (number(case["factors"][k], f"case.factors.{k}") for k in ("low", "high"))
        loaded, factors = factored(loaded, low, high, np.random.default_rng([options.seed, 11]))
    else:
        drag = cylinder.drag(float(vehicle.water_density))
        loaded = replace(loaded, damping_elements=(*vehicle.damping_elements, drag))
        jump = grasp(plant, cylinder)
    after = GreyBox(loaded, plant.copied_effects(), None, "wrench")
    assert first.position is not None and first.wrench is not None
    eta = torch.tensor(np.concatenate([first.position, first.quaternion], axis=1))
    start = torch.tensor(first.nu[row])
    start = start if jump is None else torch.tensor(jump) @ start
    with torch.no_grad():
        second = after.rollout(
            eta[row],
            start,
            torch.tensor(first.wrench[row:]),
            torch.tensor(first.t[row:]),
            max_step=options.step,
        )
    eta = torch.cat([eta[:row], second.eta])
    nu = torch.cat([torch.tensor(first.nu[:row]), second.nu])
    truth = _measured(first, eta, nu, plant, after, row)
    live = truth if case["noise"] == "none" else _noisy(truth, case["noise"], options)
    return Mission(truth, live, row, after, jump, factors)


def _check_time(options: Options) -> float:
    """Return the time of the pick-up, s, which leaves some samples on either side."""
    time, margin = number(options.case["time"], "case.time"), 3.0 / options.rate
    if not margin <= time <= options.duration - margin:
        raise ConfigError(
            f"case.time={time:g} s: the pick-up must lie within the {options.duration:g} s of the run"
        )
    return time


def _measured(
    first: Run, eta: torch.Tensor, nu: torch.Tensor, before: GreyBox, after: GreyBox, row: int
) -> Run:
    wrench = torch.tensor(first.wrench)
    zero = torch.zeros((), dtype=nu.dtype)
    rates = []
    for model, rows in ((before, slice(None, row)), (after, slice(row, None))):
        with torch.no_grad():
            rotation = quat_to_matrix(eta[rows, 3:])
            thrust = wrench[rows]
            rates.append(model.nu_dot(eta[rows, :3], rotation, nu[rows], thrust, Inputs(thrust), zero))
    return replace(
        first, position=eta[:, :3].numpy(), quaternion=eta[:, 3:].numpy(), nu=nu.numpy(),
        nu_dot=torch.cat(rates).numpy(),
    )  # fmt: skip


def _noisy(truth: Run, noise: Any, options: Options) -> Run:
    draws = Draws(make_noise(noise), truth.samples, [np.random.default_rng([options.seed, 13])])
    assert truth.nu_dot is not None
    return replace(
        truth, nu=draws.added("u", truth.nu[None])[0], nu_dot=draws.added("du", truth.nu_dot[None])[0]
    )
