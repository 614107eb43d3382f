"""Windows run free once: what they predict, by how much that is wrong, and what their thrusts depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.func import functional_call

from auvnn.effects import Sensed
from auvnn.effects.hooks import EACH
from auvnn.estimation.few_inputs import Directions, slopes
from auvnn.metrics.free_run import away, predict
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.models.actuation.acting import speeds_follow
from auvnn.models.actuation.drive import Drive
from auvnn.models.free_running.one_interval import one_interval
from auvnn.models.free_running.rollout import steps_per_interval
from auvnn.physics.attitude import quat_conjugate, quat_multiply, quat_to_matrix, quat_to_rotvec

# Windows run free at a time, and their thrusts differentiated.
BLOCK = 48


class Thrust(nn.Module):
    """Mean thrust of every interval, and the thrust as it begins, as functions of the effects' parameters.

    Where an effect has the fins follow their commands, or they go by parts of an interval, their angles come after the
    thrust and count among the n; so does the propellers' speed where an effect goes by it.
    """

    def __init__(self, model: GreyBox) -> None:
        super().__init__()
        self.model = model

    def drive(self, windows: Windows, substeps: int) -> Drive:
        """Return the thrust over every step, by so many steps in an interval."""
        given = windows.inputs
        return self.model.actuators.drive(
            given.command,
            windows.times,
            self.model.before_thrust,
            substeps,
            windows.warmup,
            given.fins,
            given.within,
            given.fins_within,
            speeds_follow(self.model),
        )

    def forward(self, windows: Windows, substeps: int) -> tuple[Tensor, Tensor]:
        """Return both, (B, L, n) each, by so many substeps in an interval."""
        drive = self.drive(windows, substeps)
        return drive.means.mean(-2), drive.starts


def output_error(model: GreyBox, windows: Windows, initial: Tensor) -> Tensor:
    """Return measured minus predicted outputs, (B, L, 18); zero where nothing was measured.

    Args:
        model: that is run.
        windows: of the log, B of L rows.
        initial: their initial states, (B, 13).
    """
    with torch.no_grad():
        eta, nu = predict(model, windows, initial)
        return window_error(model, windows, eta, nu)


def window_error(model: GreyBox, windows: Windows, eta: Tensor, nu: Tensor) -> Tensor:
    """Return measured minus predicted outputs of runs (B, L, 7) and (B, L, 6), (B, L, 18); differentiable.

    Args:
        model: for what its sensors report.
        windows: of the log, B of L rows.
        eta: position and quaternion of the runs, (B, L, 7).
        nu: their velocity, (B, L, 6), m/s and rad/s.
    """
    rate = None
    if windows.nu_dot is not None:
        _, thrust = Thrust(model)(windows, substeps_of(windows))
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
    return windows.whitened(torch.where(windows.mask > 0, error, torch.zeros_like(error)))


def substeps_of(windows: Windows) -> int:
    """Return into how many steps the integrator divides an interval."""
    return steps_per_interval(windows.times, windows.max_step)


@dataclass(frozen=True)
class SimulatedWindows:
    """Windows run free once, and what their thrusts depend on: what all chunks of a response share.

    Attributes:
        eta: (B, L, 7).
        nu: (B, L, 6).
        error: measured minus predicted outputs, (B, L, 18); about a given trajectory, that of its own outputs.
        mean: mean thrust of every interval, (B, L, n).
        start: thrust as it begins, (B, L, n).
        columns: which of the P parameters the thrusts depend on, (Q,).
        mean_slope: change of `mean` with those, (B, L, n, Q).
        start_slope: change of `start` with those, (B, L, n, Q).
        defect: by how much each interval misses a given trajectory, (B, L - 1, 12): where it leads from one of its
            states, less the next one; None where the trajectory is that of free running, which has none.
    """

    eta: Tensor
    nu: Tensor
    error: Tensor
    mean: Tensor
    start: Tensor
    columns: list[int]
    mean_slope: Tensor
    start_slope: Tensor
    defect: Tensor | None = None

    def pick(self, part: slice) -> SimulatedWindows:
        """Return some of the windows."""
        return SimulatedWindows(
            self.eta[part],
            self.nu[part],
            self.error[part],
            self.mean[part],
            self.start[part],
            self.columns,
            self.mean_slope[part],
            self.start_slope[part],
            None if self.defect is None else self.defect[part],
        )


def run_windows(model: GreyBox, windows: Windows, initial: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Run windows free and return eta (B, L, 7), nu (B, L, 6) and the error of their outputs, (B, L, 18).

    Args:
        model: that is run.
        windows: of the log, B of L rows.
        initial: their initial states, (B, 13).
    """
    with torch.no_grad():
        # What is not there yet is differentiated elsewhere; the run itself is the same without it.
        there = model.without_absent()
        # Many runs follow: compiling pays, and the same bits must come each time.
        eta, nu = predict(there, windows, initial, engine="firm")
        return eta, nu, window_error(there, windows, eta, nu)


def runs_by_block(
    model: GreyBox, windows: Windows, initial: Tensor, names: Sequence[str]
) -> list[tuple[Tensor, Tensor, Tensor]]:
    """Return the free runs of windows, block by block as `linearise` takes them.

    A step of a fit that is not taken needs no more, and costs a third.

    Args:
        model: at the values in question.
        windows: of the log, B of them.
        initial: their initial states, (B, 13).
        names: effects whose parameters will be differentiated by.
    """
    model = model.without_absent(names)
    return [
        run_windows(model, windows.pick(block), initial[block])
        for block in (slice(start, start + BLOCK) for start in range(0, len(windows), BLOCK))
    ]


def simulate_windows(
    model: GreyBox,
    windows: Windows,
    initial: Tensor,
    names: Sequence[str],
    ran: tuple[Tensor, Tensor, Tensor] | None = None,
) -> SimulatedWindows:
    """Run windows free, and differentiate their thrusts by the parameters of the named effects.

    Both go step by step through time, which costs the same for few windows as for many. Windows that are linear about a
    given trajectory are not run: of each interval it is asked by how much it misses the trajectory.

    Args:
        model: that is run.
        windows: of the log, B of L rows.
        initial: their initial states, (B, 13).
        names: effects by whose parameters the thrusts are differentiated.
        ran: what `run_windows` returned of them, where that has been done.
    """
    module, substeps = Thrust(model), substeps_of(windows)
    defect = None
    if windows.around is not None:
        ran, defect = _about(model, windows, windows.around)
    eta, nu, error = run_windows(model, windows, initial) if ran is None else ran
    with torch.no_grad():
        mean, start = module(windows, substeps)
    acting = {id(e) for e in model.before_thrust}
    by_itself = all(p.actuator is not None for e in model.before_thrust for p in e.parameters_of)
    keys, columns, only, at = {}, [], [], 0
    for name in names:
        k = model.effect_names.index(name)
        size = model.members[k].theta.numel()
        if id(model.members[k]) in acting:
            keys[f"model.effects.{k}.theta"] = model.members[k].theta.detach()
            columns += range(at, at + size)
            only += [p.actuator for p in model.members[k].parameters_of]
        at += size
    if not keys:
        none = mean.new_zeros(*mean.shape, 0)
        return SimulatedWindows(eta, nu, error, mean, start, [], none, none, defect)
    sizes = [theta.numel() for theta in keys.values()]

    def thrusts(values: Tensor) -> tuple[Tensor, Tensor]:
        some = dict(zip(keys, values.split(sizes), strict=True))
        return functional_call(module, some, (windows, substeps))

    values = torch.cat(list(keys.values()))
    shared = Directions.together([EACH if a is None or not by_itself else a for a in only])
    joined = [shared.apart(x.detach()) for x in slopes(thrusts, values, shared.seeds(values))]
    return SimulatedWindows(eta, nu, error, mean, start, columns, joined[0], joined[1], defect)


def _about(model: GreyBox, windows: Windows, around: Tensor) -> tuple[tuple[Tensor, Tensor, Tensor], Tensor]:
    """Return eta, nu and output error of a given trajectory (B, L, 13), and the defects of its intervals."""
    there, substeps = model.without_absent(), substeps_of(windows)
    with torch.no_grad():
        reached = one_interval(
            there, around, windows.inputs.rows(windows.warmup), windows.times[:, windows.warmup :],
            Thrust(there).drive(windows, substeps), substeps,
        )  # fmt: skip
        defect = away(around[:, 1:], reached)
        eta, nu = around[..., :7], around[..., 7:]
        return (eta, nu, window_error(there, windows, eta, nu)), defect
