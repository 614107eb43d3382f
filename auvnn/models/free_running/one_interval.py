"""Each interval run on its own, from the state that a given trajectory has at its begin."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from auvnn.models.actuation.drive import Drive
from auvnn.models.engine import compiled_run
from auvnn.models.free_running.rollout import fixed_steps
from auvnn.models.free_running.tableaus import TABLEAUS
from auvnn.models.inputs import Inputs

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox


def one_interval(
    model: GreyBox, states: Tensor, inputs: Inputs, times: Tensor, drive: Drive, substeps: int
) -> Tensor:
    """Return the states (..., T - 1, 13) to which the intervals lead, each from the given state at its begin.

    Args:
        model: that is run.
        states: of a trajectory, position, quaternion and velocity, (..., T, 13).
        inputs: held over each interval, T rows.
        times: s, (..., T).
        drive: thrust over each step.
        substeps: steps per interval.
    """
    last = times.shape[-1] - 1
    begin = states[..., :-1, :]
    pairs = torch.stack([times[..., :-1], times[..., 1:]], dim=-1)

    def held(x: Tensor | None, dim: int) -> Tensor | None:
        # One row more than there are intervals, as every run has it.
        return None if x is None else torch.stack([x.narrow(dim, 0, last)] * 2, dim=dim + 1)

    command = held(inputs.command, -2 % inputs.command.dim())
    assert command is not None
    fins = None if inputs.fins is None else held(inputs.fins, -2 % inputs.fins.dim())
    voltage, altitude = (
        None if x is None else held(x, -1 % x.dim()) for x in (inputs.voltage, inputs.altitude)
    )
    turning = None if inputs.fins_within is None else held(inputs.fins_within, -3 % inputs.fins_within.dim())
    alone = Drive(
        drive.means[..., :last, None, :, :],
        None if drive.slopes is None else drive.slopes[..., :last, None, :, :],
        drive.starts[..., :last, None, :],
        drive.steps,
    )
    run = (
        model,
        (begin[..., :7], begin[..., 7:]),
        Inputs(command, fins, voltage, altitude, fins_within=turning),
        pairs,
        alone,
        substeps,
        TABLEAUS["rk4"],
    )
    found = compiled_run(*run, "firm")
    eta, nu = fixed_steps(*run) if found is None else found
    return torch.cat([eta[..., 1, :], nu[..., 1, :]], dim=-1)
