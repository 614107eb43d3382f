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
from auvnn.estimation.propagation import interval_maps, propagate
from auvnn.estimation.window_simulation import SimulatedWindows, simulate_windows
from auvnn.metrics.free_run import moved
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox, Inputs


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
        motion: change of the state itself (position, small turn of the body axes, velocity) with the initial state, the
            parameters, the force, and last, about a given trajectory, with the defects, (B, rows, 12, 12 + P + F + 1);
            None where that was not asked for.
    """

    error: Tensor
    state: Tensor
    parameters: Tensor
    force: Tensor | None = None
    motion: Tensor | None = None

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
    motion: slice | None = None,
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
        motion: rows of which the change of the states themselves is kept too; none by default.
    """
    order = [model.effect_names.index(name) for name in names]
    thetas = {f"model.effects.{k}.theta": model.members[k].theta.detach() for k in order}
    if weights and model.damping is not None:
        thetas |= {f"model.damping.{n}": p.detach() for n, p in model.damping.named_parameters()}
    ran = simulate_windows(model, windows, initial, names) if ran is None else ran
    count, length = ran.nu.shape[:2]
    total = sum(theta.numel() for theta in thetas.values())
    cells = Cells(windows, windows.law) if windows.law is not None and PUSH in names else None
    times = windows.times[:, windows.warmup :]
    inputs = windows.inputs.rows(windows.warmup)
    steps = times[:, 1:] - times[:, :-1]

    points = middles(ran, times, inputs)
    rate = differentiate(OperatingPoint(model), "rate", points, thetas, chunk)
    jac_state, jac_thrust, jac_theta = split_slopes(rate, ran)
    if len(ran.columns):
        jac_theta[..., ran.columns] += jac_thrust @ ran.mean_slope[:, :-1].flatten(0, 1)
    along = [x.unflatten(0, (count, length - 1)) for x in (jac_state, jac_theta)]
    seen = reports(model, windows, ran, times, inputs, thetas, chunk)
    if cells is not None:
        # The last columns are those of a unit wrench: each cell of the force has its share of them.
        along[1] = cells.spread(along[1])
        seen = replace(seen, parts=[cells.part(at, slope, total) for at, slope in seen.parts])
    for begin in range(0, count, size):
        part = slice(begin, begin + size)
        defect = None if ran.defect is None else ran.defect[part]
        maps = interval_maps(along[0][part], along[1][part], points[1][part], points[2][part], steps[part])
        by_state, by_theta = propagate(*maps, defect)
        states = None if motion is None else torch.cat([by_state[:, motion], by_theta[:, motion]], dim=-1)
        state, parameters = _outputs(seen, part, by_state, by_theta)
        mask = windows.mask[part, :, : state.shape[-2]].unsqueeze(-1)
        if windows.noise is not None:
            some = windows.pick(part)
            state, parameters = (some.whitened(x.mul_(mask)) for x in (state, parameters))
        state, parameters, force = state.mul_(mask), parameters.mul_(mask), None
        error = ran.error[part]
        if defect is not None:
            # The last column is where the defects lead, away from the given trajectory.
            error = error.clone()
            error[..., : parameters.shape[-2]] -= parameters[..., -1]
            parameters = parameters[..., :-1]
        if cells is not None:
            parameters, force = cells.separate(parameters)
        yield Response(error, state, parameters, force, states)


def middles(ran: SimulatedWindows, times: Tensor, inputs: Inputs) -> tuple:
    """Return position, quaternion, velocity, thrust, time and inputs in the middle of every interval.

    An interval ends where the model leads from its begin, and not where a given trajectory goes on from what was measured
    then: slopes must not know of the error that they are to explain.

    Args:
        ran: B windows of L samples as they were simulated.
        times: of their samples, s, (B, L).
        inputs: of their samples.
    """
    states = torch.cat([ran.eta, ran.nu], dim=-1)
    begin, end = states[:, :-1], states[:, 1:]
    if ran.defect is not None:
        end = moved(end.flatten(0, 1), ran.defect.flatten(0, 1)).unflatten(0, end.shape[:2])
    return (
        0.5 * (begin[..., :3] + end[..., :3]),
        torch.nn.functional.normalize(begin[..., 3:7] + end[..., 3:7], dim=-1),
        0.5 * (begin[..., 7:] + end[..., 7:]),
        ran.mean[:, :-1],
        times[:, :-1] + 0.5 * (times[:, 1:] - times[:, :-1]),
        inputs.rows(0, states.shape[1] - 1),
    )


@dataclass(frozen=True)
class Reports:
    """How what is reported follows from the state; `state` is None where the state itself is reported.

    Attributes:
        state: (B, L, out, 12), out being 12, or 18 where accelerations are measured.
        parts: begin of an effect's columns among the P, and (B, L, out, p): what its sensors report changes with them.
        thrust: columns on which the thrust depends, and (B, L, out, Q).
    """

    state: Tensor | None
    parts: list[tuple[int, Tensor]]
    thrust: tuple[list[int], Tensor] | None


def reports(
    model: GreyBox,
    windows: Windows,
    ran: SimulatedWindows,
    times: Tensor,
    inputs: Inputs,
    thetas: dict[str, Tensor],
    chunk: int,
) -> Reports:
    """Return how what is reported follows from states, thrust and parameters, at every sample.

    Args:
        model: at the values in question.
        windows: B windows of L samples.
        ran: the same as they were simulated.
        times: of their samples, s, (B, L).
        inputs: of their samples.
        thetas: parameters that are differentiated by, by their names in `OperatingPoint`.
        chunk: points differentiated at a time.
    """
    measured_rate = windows.nu_dot is not None
    if not measured_rate and not model.using("sense"):
        return Reports(None, [], None)
    what = "sense and rate" if measured_rate else "sense"
    acting = thetas
    if not measured_rate:
        # The report itself depends on the sensor effects alone.
        reporting = {id(e) for e in model.using("sense")}
        acting = {k: t for k, t in thetas.items() if id(model.members[int(k.split(".")[2])]) in reporting}
    points = (ran.eta[..., :3], ran.eta[..., 3:], ran.nu, ran.start, times, inputs)
    by = differentiate(OperatingPoint(model), what, points, acting, chunk).unflatten(0, ran.nu.shape[:2])
    state, by_thrust, by_theta = split_slopes(by, ran)
    found = dict(zip(acting, by_theta.split([theta.numel() for theta in acting.values()], -1), strict=True))
    parts, at = [], 0
    for key, theta in thetas.items():
        if key in found:
            parts.append((at, found[key]))
        at += theta.numel()
    thrust = (ran.columns, by_thrust @ ran.start_slope) if len(ran.columns) else None
    return Reports(state, parts, thrust)


def split_slopes(slopes: Tensor, ran: SimulatedWindows) -> tuple[Tensor, Tensor, Tensor]:
    """Return what `differentiate` returns by state, thrust and parameters."""
    thrusts = ran.mean.shape[-1]
    state, thrust, theta = slopes.split([12, thrusts, slopes.shape[-1] - 12 - thrusts], -1)
    return state, thrust, theta


def _outputs(seen: Reports, part: slice, by_state: Tensor, by_theta: Tensor) -> tuple[Tensor, Tensor]:
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
