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
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from auvnn.estimation.force_marginalisation.columns import PUSH, Cells
from auvnn.estimation.point_slopes import OperatingPoint, differentiate
from auvnn.estimation.window_simulation import SimulatedWindows, simulate_windows
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import quat_to_matrix, skew


@dataclass(frozen=True)
class Response:
    """What the windows answer.

    Channels are those of `metrics.windows.CHANNELS`; the C of which there are derivatives are the first 12, or all 18
    where accelerations were measured: nothing is kept of channels that say nothing.

    Attributes:
        error: measured minus predicted, (B, L, 18).
        state: change of the prediction with the initial state, (B, L, C, 12).
        parameters: change of the prediction with the parameters, (B, L, C, P).
        force: change of the prediction with the independent standard normal variables of the windows' stochastic force,
            (B, L, C, F); None where there is none.
    """

    error: Tensor
    state: Tensor
    parameters: Tensor
    force: Tensor | None = None

    def left(self, change: Tensor) -> Tensor:
        """Return the errors once the initial states have moved, (B, L, 18), to first order; change is (B, 12)."""
        told = self.state.shape[-2]
        out = self.error.clone()
        out[..., :told] -= (self.state @ change[:, None, :, None]).squeeze(-1)
        return out


def respond(
    model: GreyBox,
    windows: Windows,
    initial: Tensor,
    names: Sequence[str],
    chunk: int = 2048,
    *,
    weights: bool = False,
    ran: SimulatedWindows | None = None,
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
    ran: SimulatedWindows | None = None,
) -> Iterator[Response]:
    """Yield the same for `size` windows at a time.

    Differentiating is quickest for many windows at once, what follows for so few that they stay near the processor.

    Args:
        size: windows that are yielded at a time.
        model: at the values about which it is differentiated.
        windows: of the log, B of them.
        initial: their initial states, (B, 13).
        names: effects whose parameters are differentiated by.
        chunk: points that are differentiated at a time.
        weights: differentiate by the subnetworks' weights too.
        ran: the windows as simulated already, or None.
    """
    order = [model.effect_names.index(name) for name in names]
    thetas = {f"model.effects.{k}.theta": model.members[k].theta.detach() for k in order}
    if weights and model.damping is not None:
        thetas |= {f"model.damping.{n}": p.detach() for n, p in model.damping.named_parameters()}
    ran = simulate_windows(model, windows, initial, names) if ran is None else ran
    eta, nu = ran.eta, ran.nu
    count, length = nu.shape[:2]
    total = sum(theta.numel() for theta in thetas.values())
    cells = Cells(windows, windows.law) if windows.law is not None and PUSH in names else None
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
    rate = differentiate(OperatingPoint(model), "rate", points, thetas, chunk)
    jac_state, jac_thrust, jac_theta = _split(rate, ran)
    if len(ran.columns):
        jac_theta[..., ran.columns] += jac_thrust @ ran.mean_slope[:, :-1].flatten(0, 1)
    along = [x.unflatten(0, (count, length - 1)) for x in (jac_state, jac_theta)]
    seen = _reports(model, windows, ran, times, inputs, thetas, chunk)
    if cells is not None:
        # The last columns are those of a unit wrench: each cell of the force has its share of them.
        along[1] = cells.spread(along[1])
        seen = replace(seen, parts=[cells.part(at, slope, total) for at, slope in seen.parts])
    for begin in range(0, count, size):
        part = slice(begin, begin + size)
        by_state, by_theta = _propagate(
            along[0][part], along[1][part], points[1][part], points[2][part], steps[part]
        )
        state, parameters = _outputs(seen, part, by_state, by_theta)
        mask = windows.mask[part, :, : state.shape[-2]].unsqueeze(-1)
        if windows.noise is not None:
            some = windows.pick(part)
            state, parameters = (some.whitened(x.mul_(mask)) for x in (state, parameters))
        state, parameters, force = state.mul_(mask), parameters.mul_(mask), None
        if cells is not None:
            parameters, force = cells.separate(parameters)
        yield Response(ran.error[part], state, parameters, force)


def _propagate(
    jac_state: Tensor, jac_theta: Tensor, quaternion: Tensor, nu: Tensor, steps: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the change of the state with initial state, (B, L, 12, 12), and parameters, (B, L, 12, P).

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
    # Horner's form of (exp(hA) - 1)/(hA), with as many terms as this step needs.
    terms = _terms(float(ha.abs().sum(-1).max()) if ha.numel() else 0.0)
    phi = eye + ha / terms
    for k in range(terms - 1, 1, -1):
        phi = eye + (ha / k) @ phi
    forward = eye + ha @ phi
    forcing = (phi * steps[..., None, None])[..., 6:] @ jac_theta
    # Time comes first, so that each step reads and writes what lies together.
    forward = forward.transpose(0, 1).contiguous()
    by_state = a.new_empty(intervals + 1, count, 12, 12)
    by_theta = a.new_empty(intervals + 1, count, 12, size)
    by_state[0], by_theta[0] = eye, 0.0
    by_theta[1:] = forcing.transpose(0, 1)
    for k in range(intervals):
        torch.bmm(forward[k], by_state[k], out=by_state[k + 1])
        by_theta[k + 1].baddbmm_(forward[k], by_theta[k])
    return by_state.transpose(0, 1), by_theta.transpose(0, 1)


def _terms(norm: float) -> int:
    """Return how many terms of the series of (exp(x) - 1)/x leave less than 1e-7 at |x| = norm; 8 suffice."""
    left, terms = norm / 2.0, 1
    while (left > 1e-7 or terms < 3) and terms < 8:
        terms += 1
        left *= norm / (terms + 1)
    return terms


@dataclass(frozen=True)
class _Reports:
    """How what is reported follows from the state; `state` is None where the state itself is reported.

    Attributes:
        state: (B, L, out, 12), out being 12, or 18 where accelerations are measured.
        parts: begin of an effect's columns among the P, and (B, L, out, p): what its sensors report changes with them.
        thrust: columns on which the thrust depends, and (B, L, out, Q).
    """

    state: Tensor | None
    parts: list[tuple[int, Tensor]]
    thrust: tuple[list[int], Tensor] | None


def _reports(
    model: GreyBox,
    windows: Windows,
    ran: SimulatedWindows,
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
    by = differentiate(OperatingPoint(model), what, points, acting, chunk).unflatten(0, ran.nu.shape[:2])
    state, by_thrust, by_theta = _split(by, ran)
    found = dict(zip(acting, by_theta.split([theta.numel() for theta in acting.values()], -1), strict=True))
    parts, at = [], 0
    for key, theta in thetas.items():
        if key in found:
            parts.append((at, found[key]))
        at += theta.numel()
    thrust = (ran.columns, by_thrust @ ran.start_slope) if len(ran.columns) else None
    return _Reports(state, parts, thrust)


def _split(slopes: Tensor, ran: SimulatedWindows) -> tuple[Tensor, Tensor, Tensor]:
    """Return what `differentiate` returns by state, thrust and parameters."""
    thrusts = ran.mean.shape[-1]
    state, thrust, theta = slopes.split([12, thrusts, slopes.shape[-1] - 12 - thrusts], -1)
    return state, thrust, theta


def _outputs(seen: _Reports, part: slice, by_state: Tensor, by_theta: Tensor) -> tuple[Tensor, Tensor]:
    """Return the change of the first C outputs with initial state, (B, L, C, 12), and parameters, (B, L, C, P)."""
    if seen.state is None:
        return by_state.contiguous(), by_theta.contiguous()
    reported = seen.state[part]
    state, parameters = reported @ by_state, reported @ by_theta
    for at, slope in seen.parts:
        parameters[..., at : at + slope.shape[-1]] += slope[part]
    if seen.thrust is not None:
        parameters[..., seen.thrust[0]] += seen.thrust[1][part]
    return state, parameters
