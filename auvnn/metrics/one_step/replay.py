"""Measured states and inputs, for a model to say what acceleration it expects there."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.effects import Sensed
from auvnn.errors import InputError
from auvnn.logs import Run
from auvnn.logs.altitude import altitude_at_samples
from auvnn.metrics.derivative import integrated
from auvnn.models import GreyBox, Inputs
from auvnn.models.actuation.acting import speeds_follow
from auvnn.models.inputs import joined
from auvnn.physics.attitude import quat_to_matrix

Array = NDArray[np.float64]
# Rows for which the model is asked at once.
ROWS = 20_000


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
            tensor(altitude_at_samples(run)),
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
                self.inputs.command,
                self.times,
                model.before_thrust,
                fins=self.inputs.fins,
                speeds=speeds_follow(model),
            )
        self.start, self.mean = drive.starts, drive.means[..., 0, :]

    def acceleration(self) -> Array:
        """Return what the sensors would report just after each row's command has begun to act, (N, 6)."""
        return accelerations([self])[0]

    def velocity(self) -> Array:
        """Return what the model's accelerations at the measured states add up to, (N, 6), from zero at the start.

        v_{k+1} = v_k + (t_{k+1} - t_k) [a(x_k, T_k) + a(x_{k+1}, T_k)] / 2, with T_k the mean thrust of the
        interval: the command of row k is held over it, so that a step of the command belongs to one side only.
        NaN where a sample is missing; what lies on either side of it must not be compared.
        """
        return velocities([self])[0]

    @property
    def before(self) -> torch.Tensor:
        """Return the mean thrust of the interval that ends with each row, (N, n)."""
        return torch.cat([self.mean[:1], self.mean[:-1]])


def accelerations(replays: Sequence[OneStepReplay]) -> list[Array]:
    """Return `OneStepReplay.acceleration` of each of some runs, the model being asked once for all that fit in one batch.

    Args:
        replays: of one model.
    """
    return [a for few in _batches(replays) for a in _under(few, [r.start for r in few])]


def velocities(replays: Sequence[OneStepReplay]) -> list[Array]:
    """Return `OneStepReplay.velocity` of each of some runs, the model being asked once for all that fit in one batch.

    Args:
        replays: of one model.
    """
    out = list[Array]()
    for few in _batches(replays):
        if len(few) == 1:
            # One run may be long, and who listens to the model hears of each of its samples once in a call.
            rates = [*_under(few, [few[0].mean]), *_under(few, [few[0].before])]
        else:
            rates = _under([r for r in few for _ in range(2)], [t for r in few for t in (r.mean, r.before)])
        out += [integrated(r.t, a, b) for r, a, b in zip(few, rates[::2], rates[1::2], strict=True)]
    return out


def _under(replays: Sequence[OneStepReplay], thrusts: Sequence[torch.Tensor]) -> list[Array]:
    """Return what the sensors would report under thrusts, (N, 6) of each run; NaN where a sample is missing.

    Args:
        replays: of one model.
        thrusts: of each of them, (N, n).
    """
    model, at = replays[0].model, [r.state for r in replays]
    position, quaternion, nu = (
        torch.cat([getattr(s, k) for s in at]) for k in ("position", "quaternion", "nu")
    )
    rotation, times = torch.cat([r.rotation for r in replays]), torch.cat([r.times for r in replays])
    inputs = joined([r.inputs for r in replays])
    with torch.no_grad():
        rate = model.nu_dot(position, rotation, nu, torch.cat(list(thrusts)), inputs, times)
        seen = model.sense(Sensed(position, quaternion, nu, rate)).nu_dot
    assert seen is not None
    good = np.concatenate([r.good for r in replays])
    ends = np.cumsum([len(r.t) for r in replays])[:-1]
    return np.split(np.where(good[:, None], seen.numpy(), np.nan), ends)


def _batches(replays: Sequence[OneStepReplay]) -> Iterator[list[OneStepReplay]]:
    """Yield runs for which the model is asked at once: in many calls most of the time goes into calling.

    A batch has the same inputs, and no more rows than fit in memory at ease.
    """
    few, rows = list[OneStepReplay](), 0
    for replay in replays:
        if few and (rows + len(replay.t) > ROWS or few[0].inputs.given != replay.inputs.given):
            yield few
            few, rows = [], 0
        few.append(replay)
        rows += len(replay.t)
    if few:
        yield few
