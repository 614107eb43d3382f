"""How the outputs of free-running windows change with initial states and effect parameters.

The model runs free over each window. Its error dynamics, linearised about that run, are

    d/dt [dp, da, dnu] = A(t) [dp, da, dnu] + G(t) dtheta,

with dp the error of the position (NED), da the small rotation of the attitude (body axes) and dnu that of the
velocity. A and G are taken at mid-interval for all samples of all windows at once by reverse-mode automatic
differentiation (six outputs, however many parameters), and the recursion over time is a product of small
matrices. The sensitivities are exact up to the square of the time step; the predictions themselves are the
integrator's, so that a perfect model still leaves no residual at all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.func import functional_call, jacrev, vmap
from torch.utils._pytree import register_pytree_node

from auvnn.effects import Sensed
from auvnn.metrics.free_run import MAX_STEP, predict
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox, Inputs
from auvnn.models.rollout import steps_per_interval
from auvnn.physics.attitude import (
    quat_conjugate,
    quat_multiply,
    quat_to_matrix,
    quat_to_rotvec,
    rotvec_to_quat,
    skew,
)
from auvnn.training.few_inputs import slopes
from auvnn.training.replay import Added, Replayed, given, joined, noted, nought


@dataclass(frozen=True)
class Response:
    """What the windows answer.

    Channels are those of `metrics.windows.CHANNELS`; the C of which there are derivatives are the first 12, or all 18
    where accelerations were measured: nothing is kept of channels that say nothing.

    Attributes:
        error: measured minus predicted, (B, L, 18).
        state: change of the prediction with the initial state, (B, L, C, 12).
        parameters: change of the prediction with the parameters, (B, L, C, P).
    """

    error: Tensor
    state: Tensor
    parameters: Tensor


class _Point(nn.Module):
    """The acceleration and the sensors' report at one moment, as functions of small changes."""

    def __init__(self, model: GreyBox) -> None:
        super().__init__()
        self.model = model

    def forward(
        self,
        what: str,
        position: Tensor,
        quaternion: Tensor,
        turn: Tensor,
        nu: Tensor,
        thrust: Tensor,
        time: Tensor,
        inputs: Inputs,
    ) -> Tensor:
        rotation = quat_to_matrix(quaternion)
        # First order in `turn` is all that a derivative at zero needs.
        rotation = rotation + rotation @ skew(turn)
        if what == "rate":
            return self.model.nu_dot(position, rotation, nu, thrust, inputs, time)
        rate = None
        if what == "sense and rate":
            rate = self.model.nu_dot(position, rotation, nu, thrust, inputs, time)
        turned = quat_multiply(quaternion, rotvec_to_quat(turn))
        seen = self.model.sense(Sensed(position, turned, nu, rate))
        angle = quat_to_rotvec(quat_multiply(quat_conjugate(quaternion), seen.quaternion))
        parts = [seen.position, angle, seen.nu]
        return torch.cat(parts if seen.nu_dot is None else [*parts, seen.nu_dot], dim=-1)


class _Thrust(nn.Module):
    """Mean thrust of every interval, and the thrust as it begins, as functions of the effects' parameters."""

    def __init__(self, model: GreyBox) -> None:
        super().__init__()
        self.model = model

    def forward(self, windows: Windows, substeps: int) -> tuple[Tensor, Tensor]:
        model = self.model
        drive = model.actuators.drive(
            windows.inputs.command,
            windows.times,
            model.before_thrust,
            substeps,
            windows.warmup,
        )
        mean = torch.stack([sum(parts[1:], parts[0]) / len(parts) for parts in drive.mean], dim=-2)
        return mean, torch.stack(drive.start, dim=-2)


def _flat(inputs: Inputs) -> tuple[Inputs, Inputs]:
    """Return inputs with (B, L) joined, and the axes over which `vmap` runs."""
    fields = (inputs.command, inputs.fins, inputs.voltage, inputs.altitude)
    flat = [None if x is None else x.flatten(0, 1) for x in fields[1:]]
    joined = Inputs(inputs.command.flatten(0, 1), *flat)
    return joined, Inputs(*(None if x is None else 0 for x in fields))  # type: ignore[arg-type]


def output_error(model: GreyBox, windows: Windows, initial: Tensor) -> Tensor:
    """Return measured minus predicted outputs, (B, L, 18); zero where nothing was measured."""
    with torch.no_grad():
        eta, nu = predict(model, windows, initial)
        return window_error(model, windows, eta, nu)


def window_error(model: GreyBox, windows: Windows, eta: Tensor, nu: Tensor) -> Tensor:
    """Return measured minus predicted outputs of runs (B, L, 7) and (B, L, 6), (B, L, 18); differentiable."""
    rate = None
    if windows.nu_dot is not None:
        _, thrust = _Thrust(model)(windows, _substeps(windows))
        rate = model.nu_dot(
            eta[..., :3],
            quat_to_matrix(eta[..., 3:]),
            nu,
            thrust,
            windows.inputs.rows(windows.warmup),
            windows.times[:, windows.warmup :],
        )
    seen = model.sense(Sensed(eta[..., :3], eta[..., 3:], nu, rate))
    angle = quat_to_rotvec(quat_multiply(quat_conjugate(seen.quaternion), windows.eta[..., 3:]))
    parts = [windows.eta[..., :3] - seen.position, angle, windows.nu - seen.nu]
    parts.append(
        torch.zeros_like(nu)
        if seen.nu_dot is None or windows.nu_dot is None
        else windows.nu_dot - seen.nu_dot
    )
    error = torch.cat(parts, dim=-1)
    return torch.where(windows.mask > 0, error, torch.zeros_like(error))


def _substeps(windows: Windows) -> int:
    return steps_per_interval(windows.times, MAX_STEP)


def respond(
    model: GreyBox,
    windows: Windows,
    initial: Tensor,
    names: Sequence[str],
    chunk: int = 2048,
    *,
    weights: bool = False,
    ran: Ran | None = None,
) -> Response:
    """Return prediction error and sensitivities of windows.

    Args:
        model: holds the effects named.
        windows: B windows.
        initial: (B, 13).
        names: effects whose parameters, in this order, make up the P columns.
        chunk: points differentiated at a time, which bounds the memory.
        weights: let the weights of the damping subnetworks follow as further columns, in the order of
            `model.damping.parameters()`.
        ran: the same windows as `run` returns them, where that has been done.
    """
    (whole,) = respond_by(len(windows), model, windows, initial, names, chunk, weights=weights, ran=ran)
    return whole


def respond_by(
    size: int,
    model: GreyBox,
    windows: Windows,
    initial: Tensor,
    names: Sequence[str],
    chunk: int = 2048,
    *,
    weights: bool = False,
    ran: Ran | None = None,
) -> Iterator[Response]:
    """Yield the same for `size` windows at a time.

    Differentiating is quickest for many windows at once, what follows for so few that they stay near the processor.
    """
    order = [model.effect_names.index(name) for name in names]
    thetas = {f"model.effects.{k}.theta": model.members[k].theta.detach() for k in order}
    if weights and model.damping is not None:
        thetas |= {f"model.damping.{n}": p.detach() for n, p in model.damping.named_parameters()}
    ran = run(model, windows, initial, names) if ran is None else ran
    eta, nu = ran.eta, ran.nu
    count, length = nu.shape[:2]
    total = sum(theta.numel() for theta in thetas.values())
    times = windows.times[:, windows.warmup :]
    inputs = windows.inputs.rows(windows.warmup)
    steps = times[:, 1:] - times[:, :-1]

    middle = torch.nn.functional.normalize(eta[:, :-1, 3:] + eta[:, 1:, 3:], dim=-1)
    points = (
        0.5 * (eta[:, :-1, :3] + eta[:, 1:, :3]),
        middle,
        0.5 * (nu[:, :-1] + nu[:, 1:]),
        ran.mean[:, :-1],
        times[:, :-1] + 0.5 * steps,
        inputs.rows(0, length - 1),
    )
    rate = _differentiate(_Point(model), "rate", points, thetas, chunk)
    jac_state = torch.cat(rate[:3], dim=-1)
    jac_theta = torch.cat(rate[4:], dim=-1) if total else jac_state.new_zeros(*jac_state.shape[:-1], 0)
    if len(ran.columns):
        jac_theta[..., ran.columns] += rate[3] @ ran.mean_slope[:, :-1].flatten(0, 1)
    along = [x.unflatten(0, (count, length - 1)) for x in (jac_state, jac_theta)]
    seen = _reports(model, windows, ran, times, inputs, thetas, chunk)
    for begin in range(0, count, size):
        part = slice(begin, begin + size)
        sensitivity = _propagate(along[0][part], along[1][part], points[1][part], points[2][part], steps[part])
        state, parameters = _outputs(seen, part, sensitivity)
        mask = windows.mask[part, :, : state.shape[-2]].unsqueeze(-1)
        yield Response(ran.error[part], state.mul_(mask), parameters.mul_(mask))


@dataclass(frozen=True)
class Ran:
    """Windows run free once, and what their thrusts depend on: what all chunks of a response share.

    Attributes:
        eta: (B, L, 7).
        nu: (B, L, 6).
        error: measured minus predicted outputs, (B, L, 18).
        mean: mean thrust of every interval, (B, L, n).
        start: thrust as it begins, (B, L, n).
        columns: which of the P parameters the thrusts depend on, (Q,).
        mean_slope: change of `mean` with those, (B, L, n, Q).
        start_slope: change of `start` with those, (B, L, n, Q).
    """

    eta: Tensor
    nu: Tensor
    error: Tensor
    mean: Tensor
    start: Tensor
    columns: list[int]
    mean_slope: Tensor
    start_slope: Tensor

    def pick(self, part: slice) -> Ran:
        """Return some of the windows."""
        return Ran(
            self.eta[part],
            self.nu[part],
            self.error[part],
            self.mean[part],
            self.start[part],
            self.columns,
            self.mean_slope[part],
            self.start_slope[part],
        )


def run(model: GreyBox, windows: Windows, initial: Tensor, names: Sequence[str]) -> Ran:
    """Run windows free, and differentiate their thrusts by the parameters of the named effects.

    Both go step by step through time, which costs the same for few windows as for many.
    """
    module, substeps = _Thrust(model), _substeps(windows)
    with torch.no_grad():
        # What is not there yet is differentiated elsewhere; the run itself is the same without it.
        there = model.without_absent()
        # Many runs follow: compiling pays, and the same bits must come each time.
        eta, nu = predict(there, windows, initial, engine="firm")
        error = window_error(there, windows, eta, nu)
        mean, start = module(windows, substeps)
    acting = {id(e) for e in model.before_thrust}
    keys, columns, at = {}, [], 0
    for name in names:
        k = model.effect_names.index(name)
        size = model.members[k].theta.numel()
        if id(model.members[k]) in acting:
            keys[f"model.effects.{k}.theta"] = model.members[k].theta.detach()
            columns += range(at, at + size)
        at += size
    if not keys:
        none = mean.new_zeros(*mean.shape, 0)
        return Ran(eta, nu, error, mean, start, [], none, none)
    sizes = [theta.numel() for theta in keys.values()]

    def thrusts(values: Tensor) -> tuple[Tensor, Tensor]:
        some = dict(zip(keys, values.split(sizes), strict=True))
        return functional_call(module, some, (windows, substeps))

    joined = [x.detach() for x in slopes(thrusts, torch.cat(list(keys.values())))]
    return Ran(eta, nu, error, mean, start, columns, joined[0], joined[1])


def _differentiate(
    module: _Point, what: str, points: tuple, thetas: dict[str, Tensor], chunk: int
) -> list[Tensor]:
    """Return derivatives of a function of a point by position, turn, velocity, thrust and each theta, (N, out, in)."""
    members = {f"model.effects.{k}.theta": e for k, e in enumerate(module.model.members)}
    replayed = {key: e for key, e in members.items() if key in thetas and isinstance(e, Replayed)}
    others = {key: theta for key, theta in thetas.items() if key not in replayed}
    effects, turn = list(replayed.values()), points[2].new_zeros(3)

    def note(p: Tensor, q: Tensor, v: Tensor, f: Tensor, t: Tensor, extra: Inputs) -> list[Added]:
        return noted(effects, lambda: module(what, p, q, turn, v, f, t, extra))

    def one(
        p: Tensor,
        turn: Tensor,
        v: Tensor,
        f: Tensor,
        theta: dict[str, Tensor],
        parts: list[Added],
        q: Tensor,
        t: Tensor,
        extra: Inputs,
    ) -> Tensor:
        return given(effects, parts, lambda: functional_call(module, theta, (what, p, q, turn, v, f, t, extra)))

    position, quaternion, nu, thrust, time = (x.flatten(0, 1) for x in points[:5])
    inputs, axes = _flat(points[5])
    slope = jacrev(one, argnums=(0, 1, 2, 3, 4, 5))
    many = vmap(slope, in_dims=(0, None, 0, 0, None, None, 0, 0, axes))
    found: list[list[Tensor]] = []
    for begin in range(0, len(nu), chunk):
        p, q, v, f, t = (x[begin : begin + chunk] for x in (position, quaternion, nu, thrust, time))
        extra = inputs.rows(begin, begin + chunk)
        of = vmap(note, in_dims=(0, 0, 0, 0, 0, axes))(p, q, v, f, t, extra) if effects else []
        by = many(p, turn, v, f, others, nought(of), q, t, extra)
        through = {key: joined(by[5][k], of[k]) for k, key in enumerate(replayed)}
        by_theta = (through[key] if key in through else by[4][key].flatten(2) for key in thetas)
        found.append([x.detach() for x in (*by[:4], *by_theta)])
    return [torch.cat(parts) for parts in zip(*found, strict=True)]


def _flatten_inputs(i: Inputs) -> tuple[list, None]:
    return [i.command, i.fins, i.voltage, i.altitude], None


# `vmap` must see the tensors inside.
register_pytree_node(Inputs, _flatten_inputs, lambda children, _: Inputs(*children))


def _propagate(jac_state: Tensor, jac_theta: Tensor, quaternion: Tensor, nu: Tensor, steps: Tensor) -> Tensor:
    """Return the change of the state with initial state and parameters, (B, L, 12, 12 + P).

    Args:
        jac_state: of the acceleration, (B, L - 1, 6, 12).
        jac_theta: (B, L - 1, 6, P).
        quaternion: (B, L - 1, 4).
        nu: (B, L - 1, 6).
        steps: s, (B, L - 1).
    """
    count, intervals, size = *steps.shape, jac_theta.shape[-1]
    rotation = quat_to_matrix(quaternion)
    a = jac_state.new_zeros(count, intervals, 12, 12)
    a[..., 0:3, 3:6] = -rotation @ skew(nu[..., :3])
    a[..., 0:3, 6:9] = rotation
    a[..., 3:6, 3:6] = -skew(nu[..., 3:])
    a[..., 3:6, 9:12] = torch.eye(3, dtype=a.dtype, device=a.device)
    a[..., 6:12, :] = jac_state
    ha = a * steps[..., None, None]
    eye = torch.eye(12, dtype=a.dtype, device=a.device)
    # Horner's form of (exp(hA) - 1)/(hA); eight terms reach rounding for any step the integrator may take.
    phi = eye + ha / 8
    for k in range(7, 1, -1):
        phi = eye + (ha / k) @ phi
    forward = eye + ha @ phi
    forcing = (phi * steps[..., None, None])[..., 6:] @ jac_theta
    now = torch.cat([eye.expand(count, 12, 12), a.new_zeros(count, 12, size)], dim=-1)
    rows = [now]
    for k in range(intervals):
        now = forward[:, k] @ now
        now[..., 12:] += forcing[:, k]
        rows.append(now)
    return torch.stack(rows, dim=1)


@dataclass(frozen=True)
class _Reports:
    """How what is reported follows from the state; `state` is None where the state itself is reported.

    Attributes:
        state: (B, L, out, 12), out being 12, or 18 where accelerations are measured.
        parts: begin of an effect's columns, and (B, L, out, p): what its sensors report changes with them.
        thrust: columns on which the thrust depends, and (B, L, out, Q).
    """

    state: Tensor | None
    parts: list[tuple[int, Tensor]]
    thrust: tuple[list[int], Tensor] | None


def _reports(
    model: GreyBox,
    windows: Windows,
    ran: Ran,
    times: Tensor,
    inputs: Inputs,
    thetas: dict[str, Tensor],
    chunk: int,
) -> _Reports:
    measured_rate = windows.nu_dot is not None
    if not measured_rate and not model.using("sense"):
        return _Reports(None, [], None)
    what = "sense and rate" if measured_rate else "sense"
    acting = thetas
    if not measured_rate:
        # The report itself depends on the sensor effects alone.
        reporting = {id(e) for e in model.using("sense")}
        acting = {k: t for k, t in thetas.items() if id(model.members[int(k.split(".")[2])]) in reporting}
    points = (ran.eta[..., :3], ran.eta[..., 3:], ran.nu, ran.start, times, inputs)
    by = [x.unflatten(0, ran.nu.shape[:2]) for x in _differentiate(_Point(model), what, points, acting, chunk)]
    found = dict(zip(acting, by[4:], strict=True))
    parts, at = [], 12
    for key, theta in thetas.items():
        if key in found:
            parts.append((at, found[key]))
        at += theta.numel()
    thrust = ([12 + c for c in ran.columns], by[3] @ ran.start_slope) if len(ran.columns) else None
    return _Reports(torch.cat(by[:3], dim=-1), parts, thrust)


def _outputs(seen: _Reports, part: slice, sensitivity: Tensor) -> tuple[Tensor, Tensor]:
    """Return the change of the first C outputs with initial state, (B, L, C, 12), and parameters, (B, L, C, P)."""
    if seen.state is None:
        return sensitivity[..., :12].clone(), sensitivity[..., 12:].contiguous()
    outputs = seen.state[part] @ sensitivity
    for at, slope in seen.parts:
        outputs[..., at : at + slope.shape[-1]] += slope[part]
    if seen.thrust is not None:
        outputs[..., seen.thrust[0]] += seen.thrust[1][part]
    return outputs[..., :12], outputs[..., 12:]
