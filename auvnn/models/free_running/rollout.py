"""Free running: integrate a model from a state under held commands."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from auvnn.effects import Effect
from auvnn.errors import ConfigError
from auvnn.models.actuation.acting import speeds_follow
from auvnn.models.actuation.drive import Drive
from auvnn.models.engine import compiled_run
from auvnn.models.free_running.excursions import extrapolated
from auvnn.models.free_running.limits import LIMIT
from auvnn.models.free_running.rate import state_rate, unit_attitude
from auvnn.models.free_running.rollout_checks import _checked, _leading_shape
from auvnn.models.free_running.stiffness import MAX_STEPS, MOST_CUT, UNSTABLE, fastest_rate, followed
from auvnn.models.free_running.stiffness import words as stiff_words
from auvnn.models.free_running.tableaus import TABLEAUS
from auvnn.models.free_running.trajectory import Divergence, Trajectory
from auvnn.models.input_conversion import as_inputs, as_tensor, as_times, own
from auvnn.models.inputs import Inputs
from auvnn.physics.kinematics import eta6_to_eta7

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox


def steps_per_interval(times: Tensor, max_step: float) -> int:
    """Return how many equal steps bring the longest interval below `max_step`.

    Raises:
        ConfigError: the step is not positive, a time is not finite, or the steps would be too many.
    """
    if not max_step > 0:
        raise ConfigError(f"max_step={max_step!r} s: give a positive step")
    if times.shape[-1] < 2:
        return 1
    longest = float((times[..., 1:] - times[..., :-1]).max())
    if not math.isfinite(longest):
        raise ConfigError("times hold NaN or infinity: remove those rows")
    if longest / max_step > MAX_STEPS:
        raise ConfigError(_over_budget(longest / max_step, max_step))
    return max(1, math.ceil(longest / max_step - 1e-9))


def _over_budget(steps: float, max_step: float) -> str:
    return (
        f"max_step={max_step:g} s makes {steps:.3g} steps, more than the budget of {MAX_STEPS}: give a longer "
        "max_step or a shorter run"
    )


def rollout(
    model: GreyBox,
    eta0: Tensor,
    nu0: Tensor,
    commands: Tensor | Inputs,
    times: Tensor,
    *,
    solver: str = "rk4",
    max_step: float = 0.05,
    warmup: int = 0,
    check: bool = True,
    engine: str = "auto",
    **solver_options: Any,
) -> Trajectory:
    """Integrate the model from a state, each command held until the next row's time.

    Numpy arrays and lists are taken too, and tensors that are less precise than the model.

    Args:
        model: the model.
        eta0: (..., 7) or (..., 6) with Euler angles.
        nu0: (..., 6), m/s and rad/s.
        commands: (..., warmup + T, n), or `Inputs` with as many rows.
        times: (warmup + T) or (..., warmup + T), s, not necessarily even.
        solver: "rk4", "midpoint" or "euler" (own, fixed step), or "torchdiffeq:METHOD".
        max_step: longest step of the own solvers, s; each interval is cut into equal steps.
        warmup: rows of history before the stretch, from which the actuators' state is worked out.
        check: look for divergence, try shorter steps where that is the step's fault, and note where it leaves the
            velocities that its damping was trained on; off inside function transforms.
        engine: how the own solvers run: "torch"; "compiled", as machine code made from the torch functions, which
            agrees to rounding and can be differentiated once; "auto", compiled where that is possible and pays; or
            "firm", wherever that is possible, so that runs repeat to the bit (see `auvnn.models.engine`).
        **solver_options: handed to torchdiffeq (rtol, atol).

    Returns:
        The trajectory at the T times. One that diverges keeps its last sound state and is reported.

    Raises:
        ConfigError: unknown solver, engine or option, a model that cannot be compiled where that is asked for,
            shapes that do not fit, times that decrease or are not finite, or more steps than the budget.
    """
    like = own(model)
    inputs = as_inputs(commands, like)
    eta0, nu0, times = (
        as_tensor(eta0, like, "eta0"),
        as_tensor(nu0, like, "nu0"),
        as_times(times, like),
    )
    batch = _leading_shape(model, eta0, nu0, inputs, times, warmup)
    if eta0.shape[-1] == 6:
        eta0 = eta6_to_eta7(eta0)
    if check and times.shape[-1] > 1 and bool((times[..., 1:] < times[..., :-1]).any()):
        raise ConfigError("times decrease: sort the rows by time")
    substeps = steps_per_interval(times, max_step)
    if substeps * (times.shape[-1] - warmup) > MAX_STEPS:
        raise ConfigError(_over_budget(substeps * (times.shape[-1] - warmup), max_step))
    inputs = inputs.by_steps(substeps)
    rows = torch.broadcast_shapes(inputs.command.shape[:-1], times.shape)
    turning = inputs.fins_move(bool(model.using("steer")))
    if turning and inputs.fins is not None:
        rows = torch.broadcast_shapes(rows, inputs.fins.shape[:-1])
    members = [e for e in model.effects if isinstance(e, Effect)]
    drive = model.actuators.drive(
        inputs.command.expand(*rows, inputs.command.shape[-1]),
        times.expand(rows),
        members,
        substeps,
        warmup,
        _alongside(inputs.fins, rows) if turning else None,
        inputs.within,
        inputs.fins_within,
        speeds_follow(model),
    )
    whole, inputs, times = (inputs, times), inputs.rows(warmup), times[..., warmup:]
    state = (eta0.expand(*batch, 7), nu0.expand(*batch, 6))
    if solver.startswith("torchdiffeq:"):
        from auvnn.models.free_running.torchdiffeq_solver import solve

        eta, nu = solve(model, state, *whole, solver.partition(":")[2], warmup=warmup, **solver_options)
    elif solver in TABLEAUS:
        if solver_options:
            raise ConfigError(f"solver {solver} has no option {sorted(solver_options)[0]!r}")
        steps = (model, state, inputs, times, drive, substeps, TABLEAUS[solver])
        run = compiled_run(*steps, engine)
        eta, nu = fixed_steps(*steps) if run is None else run
    else:
        raise ConfigError(
            f"no solver called '{solver}'. There are: {', '.join(TABLEAUS)}, torchdiffeq:METHOD"
        )
    begun = drive.starts.expand(*batch, *drive.starts.shape[-2:])
    size = model.actuators.size
    turning_fins = begun.shape[-1] - size * (2 if speeds_follow(model) else 1)
    thrust, fins, speeds = begun.split((size, turning_fins, begun.shape[-1] - size - turning_fins), dim=-1)
    result = Trajectory(
        times,
        eta,
        nu,
        thrust,
        fins=fins if turning_fins else None,
        speeds=speeds if speeds.shape[-1] else None,
    )
    if not check:
        return result
    result = _checked(model, result, inputs)
    notes = extrapolated(model, result.times, result.eta, result.nu, inputs)
    step = min(max_step, _longest(times))
    if (
        result.diverged
        and solver in TABLEAUS
        and (rate := _rate(model, result, inputs, batch)) * step > UNSTABLE
    ):
        finer = followed(step, rate)
        if step / finer <= MOST_CUT:
            # Too long a step makes a stiff model explode that is otherwise sound: only a finer one can tell.
            alike = {"solver": solver, "warmup": warmup, "engine": engine}
            again = rollout(model, eta0, nu0, whole[0], whole[1], max_step=finer, **alike)
            if not again.diverged:
                return replace(again, notes=(stiff_words(rate, step), *again.notes))
    return replace(result, notes=tuple(notes)) if notes else result


def _alongside(fins: Tensor | None, rows: torch.Size) -> Tensor | None:
    return None if fins is None else fins.expand(*rows, fins.shape[-1])


def _longest(times: Tensor) -> float:
    return float((times[..., 1:] - times[..., :-1]).max()) if times.shape[-1] > 1 else 0.0


def _rate(model: GreyBox, run: Trajectory, inputs: Inputs, batch: torch.Size) -> float:
    """Return how fast the model settles at the first and the last sound states of its trajectories, 1/s."""
    found = []
    for at in (0, -1):
        command = inputs.command[..., at, :].expand(*batch, inputs.command.shape[-1])
        states = (run.eta[..., at, :], run.nu[..., at, :], command)
        found.append(fastest_rate(model, *(x.reshape(-1, x.shape[-1]) for x in states)))
    return max(found)


def fixed_steps(
    model: GreyBox, state: tuple, inputs: Inputs, times: Tensor, drive: Drive, substeps: int, tableau: tuple
) -> tuple[Tensor, Tensor]:
    """Return eta (..., T, 7) and nu (..., T, 6) step by step in plain torch: what every other engine is measured against.

    Args:
        model: that is run.
        state: position and quaternion (..., 7), velocity (..., 6).
        inputs: held per interval, T rows.
        times: s, (..., T).
        drive: thrust over each step.
        substeps: steps per interval.
        tableau: of the Runge-Kutta scheme.
    """
    # One tensor for the whole state: what costs here is the number of operations, not their size.
    y = torch.cat(state, dim=-1)
    prepared = None if model.time_varying else model.prepare()
    stages, weights = tableau
    # Differences first: single precision would spoil the steps of a long log.
    steps = ((times[..., 1:] - times[..., :-1]) / substeps).to(y).unsqueeze(-1).unbind(-2)
    starts = times.to(y).unbind(-1)
    rows, means, slopes = inputs.each(), drive.mean, drive.slope
    out = [y]
    for k, h in enumerate(steps):
        flat = h.squeeze(-1)
        for part in range(substeps):
            begin = starts[k] + part * flat if part else starts[k]
            mean, slope = means[k][part], None if slopes is None else slopes[k][part]
            total, last = None, None
            for c, weight in zip(stages, weights, strict=True):
                at = y if last is None else y + (c * h) * last
                thrust = mean if slope is None else mean + (c - 0.5) * slope
                last = state_rate(model, at, thrust, rows[k], begin + c * flat if c else begin, prepared)
                if weight:
                    total = weight * last if total is None else total + weight * last
            assert total is not None
            y = unit_attitude(y + h * total)
        out.append(y)
    run = torch.stack(out, dim=-2)
    return run[..., :7], run[..., 7:]


__all__ = ["LIMIT", "TABLEAUS", "Divergence", "Trajectory", "rollout", "steps_per_interval"]
