"""One-step residuals: measured against predicted acceleration at the same, measured, state."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.effects import Moment, Sensed
from auvnn.errors import InputError
from auvnn.logs import Log, Run
from auvnn.logs.channels import VELOCITY
from auvnn.logs.signals.derivatives import LocalPolynomial
from auvnn.metrics.derivative import REPEATS, Derivative, integrated
from auvnn.metrics.noise import with_more_noise
from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import quat_to_matrix

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OneStep:
    """One run's one-step comparison; NaN where a sample is missing.

    Attributes:
        run: number.
        t: (N,), s.
        measured: (N, 6), m/s2 and rad/s2, after the filter.
        model: (N, 6), after the same filter.
        wrench: (N, 6), N and N m: what the model lacks, M (measured - model).
        noise: (6,) what noise as large as the log's would leave between `measured` and a perfect model's.
        wrench_noise: (6,) the same of `wrench`.
    """

    run: int
    t: Array
    measured: Array
    model: Array
    wrench: Array
    noise: Array
    wrench_noise: Array


class OneStepReplay:
    """A run's measured states and inputs, for a model to say what acceleration it expects there.

    Args:
        model: the model; where its parameters change later, `update` before asking again.
        run: measurements.

    Raises:
        InputError: the run lacks the commands that drive the model.
    """

    def __init__(self, model: GreyBox, run: Run) -> None:
        """Take what the model needs from the run."""
        command = run.thrusters if model.actuation == "thrusters" else run.wrench
        if command is None:
            raise InputError(
                f"run {run.number} has no commands of the kind that drives the model ({model.actuation})"
            )
        if command.shape[1] != model.actuators.size:
            raise InputError(
                f"run {run.number} has {command.shape[1]} thruster columns, but {model.vehicle.name} "
                f"has {model.actuators.size} thrusters: give one column per thruster of the model file"
            )
        known = np.isfinite(command).all(1)

        def tensor(x: Array | None) -> torch.Tensor | None:
            return None if x is None else torch.tensor(np.nan_to_num(x), dtype=torch.float64)

        self.model = model
        self.good = known & np.isfinite(run.quaternion).all(1) & np.isfinite(run.nu).all(1)
        self.inputs = Inputs(
            torch.tensor(np.where(np.expand_dims(known, 1), command, 0.0)),
            tensor(run.fins),
            tensor(run.filled("voltage")),
            tensor(run.filled("altitude")),
        )
        self.t = run.t
        self.times = torch.tensor(run.t)
        # A missing position or attitude must not make the rest of the row a missing number.
        eta = torch.tensor(np.where(np.isfinite(run.eta), run.eta, np.array([0, 0, 0, 1.0, 0, 0, 0])))
        self.seen = Sensed(eta[:, :3], eta[:, 3:], torch.tensor(np.nan_to_num(run.nu)))
        self._read_sensors()
        self._drive()

    def update(self, hooks: Collection[str] = ("sense", "command", "delay", "respond", "steer")) -> None:
        """Work out again what depends on the model's parameters; what does not is kept.

        Args:
            hooks: of the effects whose parameters have changed.
        """
        if "sense" in hooks and self.model.using("sense"):
            self._read_sensors()
        if any(h in hooks and self.model.using(h) for h in ("command", "delay", "respond", "steer")):
            self._drive()

    def _read_sensors(self) -> None:
        with torch.no_grad():
            self.state = self.model.unsense(self.seen)
        self.rotation = quat_to_matrix(self.state.quaternion)

    def _drive(self) -> None:
        model = self.model
        with torch.no_grad():
            drive = model.actuators.drive(
                self.inputs.command, self.times, model.before_thrust, fins=self.inputs.fins
            )
        self.start = torch.stack(drive.start)
        self.mean = torch.stack([part[0] for part in drive.mean])

    def acceleration(self) -> Array:
        """Return what the sensors would report just after each row's command has begun to act, (N, 6)."""
        return self._accelerations(self.start)

    def velocity(self) -> Array:
        """Return what the model's accelerations at the measured states add up to, (N, 6), from zero at the start.

        v_{k+1} = v_k + (t_{k+1} - t_k) [a(x_k, T_k) + a(x_{k+1}, T_k)] / 2, with T_k the mean thrust of the
        interval: the command of row k is held over it, so that a step of the command belongs to one side only.
        NaN where a sample is missing; what lies on either side of it must not be compared.
        """
        before = torch.cat([self.mean[:1], self.mean[:-1]])
        return integrated(self.t, self._accelerations(self.mean), self._accelerations(before))

    def _accelerations(self, thrust: torch.Tensor) -> Array:
        """Return what the sensors would report under a thrust, (N, 6); NaN where a sample is missing."""
        at = self.state
        with torch.no_grad():
            rate = self.model.nu_dot(at.position, self.rotation, at.nu, thrust, self.inputs, self.times)
            seen = self.model.sense(Sensed(at.position, at.quaternion, at.nu, rate)).nu_dot
        assert seen is not None
        return np.where(np.expand_dims(self.good, 1), seen.numpy(), np.nan)


class RunComparison:
    """Measured and predicted acceleration of one run through the same filter; asked again as parameters move.

    Args:
        model: the model; where its parameters change later, `update` before asking again.
        run: measurements, as they are to be compared: `Run.cleaned` is without spikes of single samples.
        derivative: how accelerations are obtained.

    Raises:
        InputError: the run lacks the commands that drive the model.
    """

    def __init__(self, model: GreyBox, run: Run, derivative: Derivative) -> None:
        """Filter what was measured."""
        self.replay = OneStepReplay(model, run)
        self._filter: LocalPolynomial | None = None
        if derivative.method == "measured":
            assert run.nu_dot is not None
            self.measured = run.nu_dot
        else:
            self._filter = LocalPolynomial(run.t, derivative.half_width, derivative.order)
            self.measured = self._filter(np.where(run.valid[:, None], run.nu, np.nan))[1]

    def update(self, hooks: Collection[str]) -> None:
        """Work out again what depends on the parameters of effects with these hooks."""
        self.replay.update(hooks)

    def predicted(self) -> Array:
        """Return the model's acceleration, (N, 6), m/s2 and rad/s2; NaN where a sample is missing."""
        return self.replay.acceleration() if self._filter is None else self._filter(self.replay.velocity())[1]

    def gap(self) -> Array:
        """Return measured minus predicted acceleration, (N, 6)."""
        return self.measured - self.predicted()


def one_step(model: GreyBox, log: Log, derivative: Derivative) -> list[OneStep]:
    """Compare accelerations run by run; see `OneStep`.

    Args:
        model: that is compared.
        log: measurements.
        derivative: how accelerations are obtained.
    """
    found = []
    for run in log.runs:
        measured, predicted = accelerations(model, run, derivative)
        gap, to_wrench = measured - predicted, inertia_of(model, run).T
        # The same again with as much noise once more: what changes is what noise does, to data and model alike.
        louder = [accelerations(model, with_more_noise(run, k), derivative) for k in range(REPEATS)]
        floor = np.concatenate([a - b - gap for a, b in louder])
        found.append(
            _of_measured(
                run,
                OneStep(
                    run.number,
                    run.t,
                    measured,
                    predicted,
                    gap @ to_wrench,
                    _rms(floor),
                    _rms(floor @ to_wrench),
                ),
                to_wrench,
            )
        )
    return found


def _of_measured(run: Run, part: OneStep, to_wrench: Array) -> OneStep:
    """Return a comparison without the degrees of freedom whose velocity has no sensor: nothing can be said of them.

    What the others' wrench owes to accelerations that are not known is left out of it.
    """
    blind = [name in run.estimated for name in VELOCITY]
    if not any(blind):
        return part
    gap = np.where(blind, 0.0, part.measured - part.model)
    noise = np.where(blind, np.nan, part.noise)
    return replace(
        part,
        measured=np.where(blind, np.nan, part.measured),
        model=np.where(blind, np.nan, part.model),
        wrench=np.where(blind, np.nan, gap @ to_wrench),
        noise=noise,
        wrench_noise=np.where(blind, np.nan, part.wrench_noise),
    )


def accelerations(model: GreyBox, run: Run, derivative: Derivative) -> tuple[Array, Array]:
    """Return measured and predicted acceleration of a run, after the same filter, (N, 6) each.

    Spikes of single samples count as missing.

    Args:
        model: that is compared.
        run: N samples.
        derivative: how accelerations are obtained.
    """
    comparison = RunComparison(model, run.cleaned, derivative)
    return comparison.measured, comparison.predicted()


def _rms(x: Array) -> Array:
    """Return the root mean square of each column over what is finite, (k,); zero where nothing is."""
    good = np.isfinite(x)
    return np.sqrt((np.where(good, x, 0.0) ** 2).sum(0) / np.maximum(good.sum(0), 1))


def inertia_of(model: GreyBox, run: Run, time: float | None = None) -> Array:
    """Return the model's inertia matrix (6, 6); of a body that varies in time, that at a time or the run's start.

    Args:
        model: whose matrix is asked for.
        run: for its start.
        time: s; the run's start where None.
    """
    moment = None
    if model.time_varying:
        zero3, zero6 = torch.zeros(3, dtype=torch.float64), torch.zeros(6, dtype=torch.float64)
        moment = Moment(
            torch.tensor(float(run.t[0] if time is None else time)),
            zero3,
            torch.eye(3, dtype=torch.float64),
            zero6,
            zero6,
            zero6,
            torch.zeros(model.actuators.size, dtype=torch.float64),
        )
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
        out[name] = {
            "rmse": float(np.sqrt(np.mean(gap**2))) if good.any() else np.nan,
            "noise_floor": float(floor[k]),
            "r2": 1.0 - float(np.sum(gap**2)) / total if total > 0 else np.nan,
        }
    return out
