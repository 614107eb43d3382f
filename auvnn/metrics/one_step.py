"""One-step residuals: measured against predicted acceleration at the same, measured, state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.effects import Sensed
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log, Run
from auvnn.logs.derivatives import LocalPolynomial, bandwidth_hz, noise_gain
from auvnn.logs.noise import noise_std
from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import quat_to_matrix

Array = NDArray[np.float64]
METHODS = ("measured", "local_polynomial")


@dataclass(frozen=True)
class Derivative:
    """How accelerations are obtained.

    Attributes:
        method: "measured", or "local_polynomial": the same filter on the measured velocity (its slope) and
            on the model's acceleration (its smoothed value), so that smoothing makes no difference between them.
        half_width: samples on either side of the centre.
        order: of the polynomial.
    """

    method: str
    half_width: int = 4
    order: int = 2

    def describe(self, dt: float) -> dict[str, Any]:
        """Return what the answers state of it; figures are comparable only at equal bandwidth."""
        if self.method == "measured":
            return {"method": "measured", "bandwidth_hz": 0.5 / dt}
        return {"method": f"local polynomial of order {self.order} over {2 * self.half_width + 1} samples",
                "bandwidth_hz": bandwidth_hz(dt, self.half_width, self.order)}


def choose_derivative(log: Log, options: Mapping[str, Any] | None = None) -> Derivative:
    """Return how to obtain accelerations from a log: measured ones where there are any.

    Args:
        log: the log.
        options: `method`, `half_width` and `order` in any part; the rest by default: nine samples of second
            order, or 0.2 s on either side where that is longer.

    Raises:
        ConfigError: an unknown option or method.
        InputError: measured accelerations are asked for and not there.
    """
    given = {k: v for k, v in dict(options or {}).items() if v is not None}
    for key in given:
        if key not in ("method", "half_width", "order"):
            raise ConfigError(unknown_name("derivative option", key, ("method", "half_width", "order")))
    measured = all(run.nu_dot is not None for run in log.runs)
    method = given.get("method", "measured" if measured else "local_polynomial")
    if method not in METHODS:
        raise ConfigError(unknown_name("derivative method", str(method), METHODS))
    if method == "measured" and not measured:
        raise InputError(f"{log.name} has no columns du ... dr: use derivative.method=local_polynomial")
    dt = float(np.median([run.dt for run in log.runs]))
    width = int(given.get("half_width", max(4, round(0.2 / dt))))
    return Derivative(method, width, int(given.get("order", 2)))


@dataclass(frozen=True)
class OneStep:
    """One run's one-step comparison; NaN where a sample is missing.

    Attributes:
        run: number.
        t: (N,), s.
        measured: (N, 6), m/s2 and rad/s2, after the filter.
        model: (N, 6), after the same filter.
        wrench: (N, 6), N and N m: what the model lacks, M (measured - model).
        noise: (6,) standard deviation that white noise of the velocities leaves in `measured`.
    """

    run: int
    t: Array
    measured: Array
    model: Array
    wrench: Array
    noise: Array


def model_acceleration(model: GreyBox, run: Run, centred: bool) -> Array:
    """Return the model's acceleration as the sensors would report it, at every measured state, (N, 6).

    Args:
        model: the model.
        run: measurements.
        centred: take the mean of the thrust before and after each sample, as a symmetric filter of held
            commands sees it, instead of the thrust just after.

    Raises:
        InputError: the run lacks the commands that drive the model.
    """
    command = run.thrusters if model.actuation == "thrusters" else run.wrench
    if command is None:
        raise InputError(f"run {run.number} has no commands of the kind that drives the model ({model.actuation})")
    if command.shape[1] != model.actuators.size:
        raise InputError(f"run {run.number} has {command.shape[1]} thruster columns, but {model.vehicle.name} has "
                         f"{model.actuators.size} thrusters: give one column per thruster of the model file")
    good = run.valid

    def tensor(x: Array | None) -> torch.Tensor | None:
        return None if x is None else torch.tensor(np.nan_to_num(x), dtype=torch.float64)

    fill = command.copy()
    fill[~np.isfinite(command).all(1)] = 0.0
    inputs = Inputs(torch.tensor(fill), tensor(run.fins), tensor(run.voltage), tensor(run.altitude))
    times = torch.tensor(run.t)
    with torch.no_grad():
        drive = model.actuators.drive(inputs.command, times, model.using("command") + model.using("respond"))
        if centred:
            mean = torch.stack([part[0] for part in drive.mean])
            thrust = 0.5 * (mean + torch.cat([mean[:1], mean[:-1]]))
        else:
            thrust = torch.stack(drive.start)
        eta = torch.tensor(np.where(np.isfinite(run.eta), run.eta, np.array([0, 0, 0, 1.0, 0, 0, 0])))
        nu = torch.tensor(np.nan_to_num(run.nu))
        state = model.unsense(Sensed(eta[:, :3], eta[:, 3:], nu))
        rate = model.nu_dot(state.position, quat_to_matrix(state.quaternion), state.nu, thrust, inputs, times)
        seen = model.sense(Sensed(state.position, state.quaternion, state.nu, rate)).nu_dot
    assert seen is not None
    out = seen.numpy().copy()
    out[~good] = np.nan
    return out


def one_step(model: GreyBox, log: Log, derivative: Derivative) -> list[OneStep]:
    """Compare accelerations run by run; see `OneStep`."""
    with torch.no_grad():
        inertia = None if model.time_varying else model.prepare().total.numpy()
    found = []
    for run in log.runs:
        if derivative.method == "measured":
            assert run.nu_dot is not None
            measured, predicted = run.nu_dot, model_acceleration(model, run, centred=False)
            noise = np.asarray(noise_std(run.t, run.nu_dot), dtype=float)
        else:
            smooth = LocalPolynomial(run.t, derivative.half_width, derivative.order)
            velocity = np.where(run.valid[:, None], run.nu, np.nan)
            measured = smooth(velocity)[1]
            predicted = smooth(model_acceleration(model, run, centred=True))[0]
            gain = noise_gain(run.dt, derivative.half_width, derivative.order)[1]
            noise = np.asarray(noise_std(run.t, run.nu), dtype=float) * gain
        gap = measured - predicted
        wrench = gap @ (inertia if inertia is not None else _inertia(model, run)).T
        found.append(OneStep(run.number, run.t, measured, predicted, wrench, np.nan_to_num(noise)))
    return found


def _inertia(model: GreyBox, run: Run) -> Array:
    """Return the inertia of a model whose body varies in time, at the start of the run: the residual's scale."""
    from auvnn.effects import Moment

    zero3, zero6 = torch.zeros(3, dtype=torch.float64), torch.zeros(6, dtype=torch.float64)
    moment = Moment(torch.tensor(float(run.t[0])), zero3, torch.eye(3, dtype=torch.float64), zero6, zero6, zero6,
                    torch.zeros(model.actuators.size, dtype=torch.float64))
    with torch.no_grad():
        return model.prepare(moment).total.numpy()


def scores(parts: list[OneStep]) -> dict[str, dict[str, float]]:
    """Return `one_step` of the comparison: rmse, noise floor and R2 of each acceleration."""
    names = ("du", "dv", "dw", "dp", "dq", "dr")
    measured, predicted = (np.concatenate([getattr(p, k) for p in parts]) for k in ("measured", "model"))
    weight = np.array([len(p.t) for p in parts], dtype=float)
    floor = np.sqrt(np.average([p.noise**2 for p in parts], axis=0, weights=weight))
    out = {}
    for k, name in enumerate(names):
        good = np.isfinite(measured[:, k]) & np.isfinite(predicted[:, k])
        gap = measured[good, k] - predicted[good, k]
        total = float(np.sum((measured[good, k] - measured[good, k].mean()) ** 2)) if good.any() else 0.0
        out[name] = {"rmse": float(np.sqrt(np.mean(gap**2))) if good.any() else np.nan,
                     "noise_floor": float(floor[k]),
                     "r2": 1.0 - float(np.sum(gap**2)) / total if total > 0 else np.nan}
    return out
