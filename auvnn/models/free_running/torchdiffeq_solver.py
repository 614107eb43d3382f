"""Free running through torchdiffeq: adaptive methods, and an independent check on the own integrator."""

from __future__ import annotations

import itertools
from functools import partial
from typing import TYPE_CHECKING

import torch
from torch import Tensor
from torchdiffeq import odeint

from auvnn.errors import ConfigError
from auvnn.models.actuation.acting import speeds_follow
from auvnn.models.free_running.limits import LIMIT
from auvnn.models.inputs import Inputs
from auvnn.physics.attitude import quat_derivative, quat_to_matrix

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox

ADAPTIVE = ("dopri8", "dopri5", "bosh3", "fehlberg2", "adaptive_heun")
FIXED = ("euler", "midpoint", "heun3", "rk4")
# torchdiffeq has no budget by default, and enforces one by an assertion, which `python -O` removes.
MAX_EVALUATIONS = 100_000


def solve(
    model: GreyBox,
    state: tuple[Tensor, Tensor],
    inputs: Inputs,
    times: Tensor,
    method: str,
    *,
    warmup: int = 0,
    offset: Tensor | None = None,
    **tolerances: float,
) -> tuple[Tensor, Tensor]:
    """Integrate interval by interval, so that no step crosses a jump of the held inputs.

    The actuators' own dynamics are followed in closed form inside each interval, by restarting their
    answer from the interval's beginning.

    Args:
        model: the model.
        state: eta (..., 7) and nu (..., 6) at the first time.
        inputs: warmup + T rows.
        times: (warmup + T,), s, shared by all trajectories.
        method: one of torchdiffeq's.
        warmup: rows of history, from which the actuators' state is worked out.
        offset: (...), s, added to `times` of each trajectory wherever an effect depends on the time.
        **tolerances: `rtol` (1e-7) and `atol` (1e-9) of adaptive methods.

    Returns:
        eta (..., T, 7) and nu (..., T, 6); NaN from where a trajectory left what is physical.

    Raises:
        ConfigError: unknown method or option, times that differ by trajectory, or a budget that ran out.
    """
    if method not in (*ADAPTIVE, *FIXED):
        raise ConfigError(
            f"torchdiffeq has no method '{method}' for this. There are: {', '.join((*ADAPTIVE, *FIXED))}"
        )
    if times.dim() != 1:
        raise ConfigError(
            "torchdiffeq takes one time axis for all trajectories: use solver=rk4 for uneven ones"
        )
    for name, value in tolerances.items():
        if name not in ("rtol", "atol"):
            raise ConfigError(f"solver torchdiffeq:{method} has no option '{name}'. There are: rtol, atol")
        if not value > 0:
            raise ConfigError(f"{name}={value!r}: give a positive tolerance")
    rtol, atol = tolerances.get("rtol", 1e-7), tolerances.get("atol", 1e-9)
    prepared = None if model.time_varying else model.prepare()
    shape = (*inputs.command.shape[:-1], 1)
    since = torch.zeros((), dtype=times.dtype) if offset is None else offset.to(times)
    clock = times.expand(shape[:-1]) + since.unsqueeze(-1)
    signal = model.actuators.signal(inputs.command, clock, model.before_thrust)
    steering = model.actuators.steering(
        None if inputs.fins is None else inputs.fins.expand(*clock.shape, inputs.fins.shape[-1]),
        clock,
        model.before_thrust,
    )
    turned = (
        model.actuators.turned(inputs.command, clock, model.before_thrust) if speeds_follow(model) else None
    )
    late = next((e.delay() for e in model.using("delay")), torch.zeros(())).to(times)
    # Delayed pieces of thrust change inside the intervals; where they do, the integration starts again.
    jumps = (times + late).tolist() if model.using("delay") else []
    rows = inputs.each()
    y = torch.cat(state, dim=-1)
    out = [y]
    lost = ~torch.isfinite(y).all(-1)
    at_rest = torch.nn.functional.pad(torch.ones_like(y[..., :1]), (3, 9))
    y = torch.where(lost.unsqueeze(-1), at_rest, y)
    for k in range(warmup, times.shape[0] - 1):
        row, spent = rows[k], 0
        begin, end = float(times[k]), float(times[k + 1])
        cuts = [begin, *(t for t in jumps if begin < t < end), end]

        def rate(
            t: Tensor, y: Tensor, piece: Tensor, held: Tensor, row: Inputs = row, begin: float = begin
        ) -> Tensor:
            nonlocal lost, spent
            spent += 1
            if spent > MAX_EVALUATIONS:
                raise ConfigError(
                    f"torchdiffeq {method} gave up at t = {begin:g} s after "
                    f"{MAX_EVALUATIONS} evaluations: loosen rtol and atol, or use solver=rk4"
                )
            now = signal.along(piece, (t - late + since).expand(shape[:-2]))
            if steering is not None:
                now = torch.cat([now, steering.along(held, (t + since).expand(shape[:-2]))], dim=-1)
            if turned is not None:
                now = torch.cat([now, turned.along(held, (t + since).expand(shape[:-2]))], dim=-1)
            rotation = quat_to_matrix(y[..., 3:7] / torch.linalg.norm(y[..., 3:7], dim=-1, keepdim=True))
            nu = y[..., 7:]
            change = torch.cat(
                [
                    (rotation @ nu[..., :3].unsqueeze(-1)).squeeze(-1),
                    quat_derivative(y[..., 3:7], nu[..., 3:]),
                    model.nu_dot(
                        y[..., :3], rotation, nu, now, row, (t.to(y) + late).expand(nu.shape[:-1]), prepared
                    ),
                ],
                dim=-1,
            )
            # A lost trajectory would make adaptive methods shrink the step of all for ever: it is held.
            lost = lost | ~torch.isfinite(change).all(-1) | (nu.abs().amax(-1) > LIMIT)
            return torch.where(lost.unsqueeze(-1), torch.zeros_like(change), change)

        for low, high in itertools.pairwise(cuts):
            middle = torch.full(shape[:-2], 0.5 * (low + high), dtype=times.dtype)
            piece = signal.piece(middle - late.detach().cpu() + since)
            by_commands = steering or turned
            held = piece if by_commands is None else by_commands.piece(middle + since)
            ends = torch.tensor([low, high], dtype=times.dtype, device=times.device)
            try:
                run = odeint(
                    partial(rate, piece=piece, held=held), y, ends, method=method, rtol=rtol, atol=atol
                )
            except AssertionError as problem:
                raise ConfigError(
                    f"torchdiffeq {method} gave up at t = {begin:g} s ({problem or 'step too small'}): "
                    "loosen rtol and atol, or use solver=rk4"
                ) from None
            assert isinstance(run, Tensor)
            y = run[-1]
        quaternion = y[..., 3:7] / torch.linalg.norm(y[..., 3:7], dim=-1, keepdim=True)
        y = torch.cat([y[..., :3], quaternion, y[..., 7:]], dim=-1)
        out.append(torch.where(lost.unsqueeze(-1), torch.full_like(y, torch.nan), y))
    run = torch.stack(out, dim=-2)
    return run[..., :7], run[..., 7:]
