"""Is what is to be run free in the right shape, finite, and in order of time?"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from auvnn.errors import ConfigError
from auvnn.models.free_running.limits import LIMIT
from auvnn.models.free_running.trajectory import Divergence, Trajectory
from auvnn.models.inputs import Inputs
from auvnn.physics.attitude import quat_to_matrix

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox


def _leading_shape(
    model: GreyBox, eta0: Tensor, nu0: Tensor, inputs: Inputs, times: Tensor, warmup: int
) -> torch.Size:
    """Return the leading shape that start, inputs and times share; refuse what does not fit together."""
    command, size = inputs.command, model.actuators.size
    if eta0.shape[-1:] not in ((6,), (7,)):
        raise ConfigError(
            f"eta0 has shape {tuple(eta0.shape)}: the last size is 7 (quaternion) or 6 (Euler angles)"
        )
    if nu0.shape[-1:] != (6,):
        raise ConfigError(f"nu0 has shape {tuple(nu0.shape)}: the last size is 6 (u v w p q r)")
    if command.dim() < 2 or times.dim() < 1:
        raise ConfigError(
            f"commands have shape {tuple(command.shape)} and times {tuple(times.shape)}: "
            f"give rows, (..., T, {size}) and (..., T)"
        )
    if command.shape[-2] != times.shape[-1]:
        raise ConfigError(
            f"{command.shape[-2]} rows of commands for {times.shape[-1]} times: give one row per time"
        )
    if command.shape[-1] != size:
        raise ConfigError(
            f"{command.shape[-1]} commands a row, but the model takes {size} ({model.actuation})"
        )
    if not 0 <= warmup < times.shape[-1]:
        raise ConfigError(f"warmup={warmup} of {times.shape[-1]} rows: leave at least one to run from")
    fins = len(model.vehicle.fins)
    if fins and inputs.fins is not None and inputs.fins.shape[-1:] != (fins,):
        raise ConfigError(f"fins of shape {tuple(inputs.fins.shape)}: the vehicle has {fins} fins")
    leading = {
        "eta0": eta0.shape[:-1],
        "nu0": nu0.shape[:-1],
        "commands": command.shape[:-2],
        "times": times.shape[:-1],
    }
    for name, tensor, sizes in (
        ("fins", inputs.fins, 2),
        ("voltage", inputs.voltage, 1),
        ("altitude", inputs.altitude, 1),
    ):
        if tensor is not None:
            if tensor.dim() < sizes or tensor.shape[-sizes] != times.shape[-1]:
                raise ConfigError(
                    f"{name} of shape {tuple(tensor.shape)} for {times.shape[-1]} times: give one row per time"
                )
            leading[name] = tensor.shape[:-sizes]
    try:
        return torch.broadcast_shapes(*leading.values())
    except RuntimeError:
        words = ", ".join(f"{name} {tuple(shape)}" for name, shape in leading.items())
        raise ConfigError(f"leading shapes do not fit together: {words}") from None


def _checked(model: GreyBox, run: Trajectory, inputs: Inputs) -> Trajectory:
    with torch.no_grad():
        sound = (
            torch.isfinite(run.nu).all(-1) & torch.isfinite(run.eta).all(-1) & (run.nu.abs().amax(-1) < LIMIT)
        )
        if bool(sound.all()):
            return run
        count = run.nu.shape[-2]
        flat = sound.reshape(-1, count)
        eta, nu = (
            run.eta.detach().reshape(-1, count, 7).clone(),
            run.nu.detach().reshape(-1, count, 6).clone(),
        )
        times = run.times.expand(sound.shape).reshape(-1, count)
        thrust = run.acting.reshape(-1, count, run.acting.shape[-1])
        command = inputs.command.expand(*sound.shape, inputs.command.shape[-1]).reshape(
            -1, count, model.actuators.size
        )
        found = []
        for index in torch.nonzero(~flat.all(-1)).squeeze(-1).tolist():
            last = int(torch.nonzero(~flat[index])[0]) - 1
            if last < 0:
                begin = float(times[index, 0])
                words = f"trajectory {index} starts from a state that is not finite, or faster than {LIMIT:g}"
                found.append(Divergence(index, begin, "initial state", words))
                eta[index, 1:], nu[index, 1:] = eta[index, 0], nu[index, 0]
                continue
            extra = inputs.rows(last, last + 1)
            terms = model.wrenches(
                eta[index, last, :3],
                quat_to_matrix(eta[index, last, 3:]),
                nu[index, last],
                thrust[index, last],
                Inputs(
                    command[index, last],
                    *(
                        None
                        if x is None
                        else x.expand(*sound.shape[:-1], *x.shape[len(x.shape) - d :])
                        .reshape(flat.shape[0], *x.shape[len(x.shape) - d :])[index]
                        .squeeze(0)
                        for x, d in ((extra.fins, 2), (extra.voltage, 1), (extra.altitude, 1))
                    ),
                ),
                times[index, last],
            )
            term = max(terms, key=lambda n: float(torch.nan_to_num(terms[n], nan=math.inf).abs().max()))
            moment = float(times[index, last])
            found.append(
                Divergence(
                    index,
                    moment,
                    term,
                    f"trajectory {index} diverged after {moment:g} s; the largest term was: {term}",
                )
            )
            eta[index, last + 1 :], nu[index, last + 1 :] = eta[index, last], nu[index, last]
        return Trajectory(
            run.times,
            eta.reshape(run.eta.shape),
            nu.reshape(run.nu.shape),
            run.thrust,
            tuple(found),
            fins=run.fins,
            speeds=run.speeds,
        )
