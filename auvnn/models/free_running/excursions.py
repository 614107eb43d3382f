"""Where a free run leaves the velocities that its damping was trained on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from auvnn.damping.region import Region
from auvnn.effects import Moment
from auvnn.models.inputs import Inputs
from auvnn.physics.attitude import quat_to_matrix
from auvnn.physics.current import water_velocity

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox


def region_of(model: GreyBox) -> Region | None:
    """Return what the model's damping subnetworks were trained on; None without any, or where it is not known."""
    return getattr(model.damping, "region", None)


def extrapolated(model: GreyBox, times: Tensor, eta: Tensor, nu: Tensor, inputs: Inputs) -> list[str]:
    """Say in words where a run leaves the trained region; nothing where it does not.

    Args:
        model: the model.
        times: (..., T), s.
        eta: (..., T, 7).
        nu: (..., T, 6), m/s and rad/s.
        inputs: T rows.
    """
    region = region_of(model)
    beyond = "" if region is None else region.words(through_water(model, times, eta, nu, inputs))
    return [words_of(beyond)] if beyond else []


def words_of(beyond: str) -> str:
    """Return the sentence about velocities that are beyond the region."""
    return f"beyond what the damping was trained on, where its answer is extrapolated: {beyond}"


def through_water(model: GreyBox, times: Tensor, eta: Tensor, nu: Tensor, inputs: Inputs) -> Tensor:
    """Return the velocity relative to the water along a run, (..., T, 6), m/s and rad/s."""
    nu = nu.detach()
    if not model.using("water"):
        return nu
    with torch.no_grad():
        rotation = quat_to_matrix(eta[..., 3:])
        given = (inputs.command, inputs.fins, inputs.voltage, inputs.altitude)
        moment = Moment(times, eta[..., :3], rotation, nu, nu, torch.zeros_like(nu), *given)
        moving = [e.water(moment)[0].expand_as(nu[..., :3]) for e in model.using("water")]
        carried, _ = water_velocity(rotation, nu[..., 3:], torch.stack(moving).sum(0))
        return nu - carried
