"""A and B of a model at a state, and its steps: what a Kalman filter or a regulator asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor
from torch.autograd import forward_ad

from auvnn.errors import ConfigError
from auvnn.models.free_running.rate import SIZE
from auvnn.models.input_conversion import as_tensor
from auvnn.models.input_conversion import own as own_tensor
from auvnn.models.linear.state_space import NAMES, StateSpace
from auvnn.physics.attitude import quat_to_euler
from auvnn.physics.kinematics import eta6_to_eta7

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox

EULER_NAMES = ("x", "y", "z", "phi", "theta", "psi", "u", "v", "w", "p", "q", "r")
MAX_STEP = 0.05


@dataclass(frozen=True)
class Linearisation:
    """A model around a state and a command; see `linearise`.

    With a delay the discrete system has other actuator states than the continuous one, and `A_d` another size than `A`.

    Attributes:
        A: d x_dot / d x, 1/s and so on, (..., n, n).
        B: d x_dot / d u, (..., n, m).
        rate: x_dot itself, (..., n).
        state: x, (..., n).
        A_d: d x(t + dt) / d x(t), (..., k, k), or None without dt.
        B_d: d x(t + dt) / d u, u held over the step, (..., k, m), or None.
        next: x(t + dt), (..., k), or None.
        states: names of x.
        discrete_states: names of the discrete x, or None.
        inputs: names of u.
    """

    A: Tensor
    B: Tensor
    rate: Tensor
    state: Tensor
    A_d: Tensor | None
    B_d: Tensor | None
    next: Tensor | None
    states: tuple[str, ...]
    discrete_states: tuple[str, ...] | None
    inputs: tuple[str, ...]


def linearise(
    model: GreyBox,
    state: Tensor,
    command: Tensor,
    dt: float | None = None,
    *,
    time: Tensor | float = 0.0,
    fins: Tensor | None = None,
    voltage: Tensor | None = None,
    altitude: Tensor | None = None,
    max_step: float = MAX_STEP,
) -> Linearisation:
    """Return A and B of a model at a state, exactly, by forward differentiation; continuous, and discrete with `dt`.

    Args:
        model: the model.
        state: position, attitude, nu, and after them what the actuators remember; (..., 13 + k) with a quaternion,
            (..., 12 + k) with Euler angles. Without the last k numbers, the actuators are settled at the command.
        command: thruster commands or wrench, (..., n).
        dt: step of the discrete system, s.
        time: s, (...).
        fins: rad, (..., m), zero where not given.
        voltage: V, (...).
        altitude: m, (...).
        max_step: longest step of the integrator inside dt, s.

    Returns:
        Matrices over the state as it was given: with Euler angles where these were.

    Raises:
        ConfigError: shapes that do not fit, or a missing input.
    """
    like = own_tensor(model)
    state, command = as_tensor(state, like, "state"), as_tensor(command, like, "command")
    fins, voltage = as_tensor(fins, like, "fins"), as_tensor(voltage, like, "voltage")
    altitude = as_tensor(altitude, like, "altitude")
    continuous = StateSpace(model)
    u = continuous.join(command, fins, voltage, altitude)
    with torch.no_grad():
        x, u, t = _given(continuous, state, u, time)
        euler = _is_euler(state, continuous)
        rate, a, b = _slopes(lambda x, u: _rate(continuous, x, u, t, euler), x, u)
        names = (*(EULER_NAMES if euler else NAMES), *continuous.actuators.names())
        if dt is None:
            return Linearisation(
                a, b, rate, x, None, None, None, names, None, tuple(continuous.input_names())
            )
        discrete = StateSpace(model, dt)
        if discrete.actuators.delay:
            base = SIZE - euler
            x_d, *_ = _given(discrete, x[..., :base], u, time)
            if state.shape[-1] == base + discrete.actuators.states:
                x_d = state.detach().expand(x_d.shape)
        else:
            x_d = x
        after, a_d, b_d = _slopes(lambda x, u: _next(discrete, x, u, t, euler, dt, max_step), x_d, u)
    own = (*names[: SIZE - euler], *discrete.actuators.names())
    return Linearisation(a, b, rate, x, a_d, b_d, after, names, own, tuple(continuous.input_names()))


def discrete_step(
    model: GreyBox,
    state: Tensor,
    command: Tensor,
    dt: float,
    *,
    time: Tensor | float = 0.0,
    fins: Tensor | None = None,
    voltage: Tensor | None = None,
    altitude: Tensor | None = None,
    max_step: float = MAX_STEP,
) -> Tensor:
    """Return the state after `dt` seconds under a held command; differentiable, the same as one row of a rollout.

    See `linearise` for the arguments. The state that comes back has the actuators' states at its end, also where they
    were not given (then they were settled at the command).

    Args:
        model: that is stepped.
        state: (..., n) as in `linearise`.
        command: (..., k), held over the step.
        dt: length of the step, s.
        time: at its start, s.
        fins: fin angles, rad, (..., m).
        voltage: V, (...).
        altitude: m, (...).
        max_step: longest step of the integrator, s.
    """
    like = own_tensor(model)
    state, command = as_tensor(state, like, "state"), as_tensor(command, like, "command")
    fins, voltage = as_tensor(fins, like, "fins"), as_tensor(voltage, like, "voltage")
    altitude = as_tensor(altitude, like, "altitude")
    space = StateSpace(model, dt)
    u = space.join(command, fins, voltage, altitude)
    x, u, t = _given(space, state, u, time)
    return _next(space, x, u, t, _is_euler(state, space), dt, max_step)


def _is_euler(state: Tensor, space: StateSpace) -> bool:
    """Return whether a state holds Euler angles; one whose size fits neither is refused."""
    k, size = space.actuators.states, state.shape[-1] if state.dim() else 0
    if k == 0 or size in (SIZE, SIZE - 1):
        found = {SIZE: False, SIZE - 1: True}.get(size)
    else:
        found = {SIZE + k: False, SIZE - 1 + k: True}.get(size)
    if found is None and space.dt is None and space.actuators.delay:
        # The state of the discrete system, which `linearise` sorts out: only its head counts here.
        found = (size - SIZE + 1 - space.actuators.fins) % space.actuators.size == 0
    if found is None:
        raise ConfigError(
            f"state {tuple(state.shape)}: the last size is {SIZE} with a quaternion or {SIZE - 1} with Euler angles, "
            f"or with the actuators' states {SIZE + k} or {SIZE - 1 + k}"
        )
    return found


def _given(
    space: StateSpace, state: Tensor, u: Tensor, time: Tensor | float
) -> tuple[Tensor, Tensor, Tensor]:
    """Return state with actuators, inputs and time, of one leading shape."""
    base = SIZE - _is_euler(state, space)
    own = space.actuators.settled(u[..., : space.actuators.inputs])
    if state.shape[-1] == base + space.actuators.states:
        own = state[..., base:]
    t = torch.as_tensor(time, dtype=state.dtype, device=state.device)
    lead = torch.broadcast_shapes(state.shape[:-1], u.shape[:-1], t.shape)
    x = torch.cat([state[..., :base].expand(*lead, base), own.expand(*lead, own.shape[-1])], dim=-1)
    return x, u.expand(*lead, u.shape[-1]), t.expand(lead)


def _rate(space: StateSpace, x: Tensor, u: Tensor, t: Tensor, euler: bool) -> Tensor:
    if not euler:
        return space.rate(x, u, t)
    eta, nu = x[..., :6], x[..., 6:12]
    rate = space.rate(torch.cat([eta6_to_eta7(eta), x[..., 6:]], dim=-1), u, t)
    return torch.cat([rate[..., :3], _euler_rate(eta[..., 3:], nu[..., 3:]), rate[..., 7:]], dim=-1)


def _next(
    space: StateSpace, x: Tensor, u: Tensor, t: Tensor, euler: bool, dt: float, max_step: float
) -> Tensor:
    from auvnn.models.free_running.rollout import steps_per_interval

    substeps = steps_per_interval(torch.tensor([0.0, dt], dtype=torch.float64), max_step)
    h = torch.full_like(t, dt)
    if not euler:
        return space.step(x, u, t, h, substeps)
    x = torch.cat([eta6_to_eta7(x[..., :6]), x[..., 6:]], dim=-1)
    after = space.step(x, u, t, h, substeps)
    return torch.cat([after[..., :3], quat_to_euler(after[..., 3:7]), after[..., 7:]], dim=-1)


def _euler_rate(angles: Tensor, omega: Tensor) -> Tensor:
    """Return the rates of roll, pitch and yaw (..., 3), rad/s; Fossen (2011), equation 2.39."""
    phi, theta, _ = angles.unbind(-1)
    p, q, r = omega.unbind(-1)
    across = torch.sin(phi) * q + torch.cos(phi) * r
    turn = across / torch.cos(theta)
    return torch.stack([p + torch.sin(theta) * turn, torch.cos(phi) * q - torch.sin(phi) * r, turn], dim=-1)


def _slopes(
    function: Callable[[Tensor, Tensor], Tensor], x: Tensor, u: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Return a function's value and its Jacobians in both arguments: all directions side by side in one pass."""
    n, m = x.shape[-1], u.shape[-1]
    whole = torch.cat([x, u], dim=-1)
    eye = torch.eye(n + m, dtype=x.dtype, device=x.device)
    # One more leading axis than the batch, in front: what is held for the batch broadcasts against it.
    directions = eye.reshape(n + m, *(1,) * (x.dim() - 1), n + m).expand(n + m, *whole.shape)
    with forward_ad.dual_level():
        dual = forward_ad.make_dual(whole.expand(n + m, *whole.shape).contiguous(), directions.contiguous())
        found = forward_ad.unpack_dual(function(dual[..., :n], dual[..., n:]))
        value, slope = found.primal[0].clone(), found.tangent
    if slope is None:
        slope = torch.zeros(n + m, *value.shape, dtype=x.dtype, device=x.device)
    jacobian = slope.movedim(0, -1).contiguous()
    return value, jacobian[..., :n], jacobian[..., n:]
