"""What one sample says about the damping: the wrench that the model lacks, from an acceleration or an increment.

With a measured acceleration, M nu_dot + ... is compared at the sample itself. Without one, the model is run over
the interval since the last sample, from the measured state and under the command that was held, and its increment
of velocity is compared with the measured one: e = M (nu_model - nu_measured) / dt. Model and measurement go
through the same integral, and nothing is differentiated.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import torch
from torch import Tensor

from auvnn.effects import Moment
from auvnn.models import GreyBox, Inputs
from auvnn.models.actuation.acting import speeds_follow
from auvnn.models.equations_of_motion import Prepared
from auvnn.physics.attitude import quat_to_matrix
from auvnn.physics.kinematics import eta6_to_eta7

# Rows of history from which the state of actuators with a lag or a delay is worked out.
MEMORY = 64
MAX_STEP = 0.05


@dataclass(frozen=True)
class Sample:
    """One measured moment; SI, NED and FRD.

    Attributes:
        t: s.
        eta: (7,) position and quaternion.
        nu: (6,).
        command: (n,), held from `t` on.
        nu_dot: (6,), or None.
        fins: (m,), or None.
        voltage: V, (), or None.
        altitude: m, (), or None.
    """

    t: float
    eta: Tensor
    nu: Tensor
    command: Tensor
    nu_dot: Tensor | None = None
    fins: Tensor | None = None
    voltage: Tensor | None = None
    altitude: Tensor | None = None

    def inputs(self) -> Inputs:
        """Return what drives the vehicle."""
        return Inputs(self.command, self.fins, self.voltage, self.altitude)

    @classmethod
    def of(cls, t: float, eta: Tensor, nu: Tensor, command: Tensor, **channels: Tensor | None) -> Sample:
        """Return a sample whose attitude may be given as Euler angles, (6,) in all.

        Args:
            t: s.
            eta: position and quaternion (7,), or with Euler angles (6,).
            nu: velocity, m/s and rad/s, (6,).
            command: (n,).
            **channels: `nu_dot`, `fins`, `voltage` and `altitude`, each a tensor or None.
        """
        return cls(t, eta6_to_eta7(eta) if eta.shape[-1] == 6 else eta, nu, command, **channels)


@dataclass(frozen=True)
class Residual:
    """What a sample says.

    Attributes:
        nu: (6,) velocity through the water at which the damping acted.
        error: (6,) M (nu_dot of the model - measured): what the subnetworks should give beyond what they do.
        acceleration: (6,) measured minus predicted acceleration, m/s2 and rad/s2.
        sample: the state and inputs it belongs to.
    """

    nu: Tensor
    error: Tensor
    acceleration: Tensor
    sample: Sample


@dataclass
class Predictor:
    """Compares a model with samples as they come; keeps a bounded history of commands.

    Attributes:
        model: with damping subnetworks.
        history: the last samples, oldest first.
    """

    model: GreyBox
    history: deque[Sample] = field(default_factory=lambda: deque(maxlen=2))

    def __post_init__(self) -> None:
        """Size the history by what the actuators need."""
        self._last: Sample | None = None
        self.use(self.model)

    def use(self, model: GreyBox) -> None:
        """Go on with another model's physics."""
        self.model = model
        remembers = bool(model.using("respond") or model.using("command") or model.using("steer"))
        self.history = deque(self.history, maxlen=MEMORY if remembers else 2)
        self._prepared: Prepared | None = None
        if not model.time_varying:
            with torch.no_grad():
                self._prepared = model.prepare()

    @property
    def last(self) -> Sample | None:
        """The newest sample that came in, even if what came after it broke the history."""
        return self._last

    def forget(self) -> None:
        """Drop the history: the next sample starts again."""
        self.history.clear()

    def forget_all(self) -> None:
        """Drop the history and the last sample's time: another run begins."""
        self.history.clear()
        self._last = None

    def skip(self, sample: Sample) -> None:
        """Add a sample without comparing it with anything."""
        self.history.append(sample)
        self._last = sample

    def inertia(self, sample: Sample) -> Tensor:
        """Return the inertia matrix, added mass included, (6, 6)."""
        if self._prepared is not None:
            return self._prepared.total
        rotation, time = quat_to_matrix(sample.eta[3:]), torch.tensor(sample.t, dtype=sample.nu.dtype)
        moment = Moment(
            time, sample.eta[:3], rotation, sample.nu, sample.nu, torch.zeros_like(sample.nu),
            sample.command, sample.fins, sample.voltage, sample.altitude,
        )  # fmt: skip
        with torch.no_grad():
            return self.model.prepare(moment).total

    def take(self, sample: Sample) -> Residual | None:
        """Add a sample and return what it says; None where there is nothing yet to compare it with."""
        previous = self.history[-1] if self.history else None
        self.skip(sample)
        with torch.no_grad(), _seen(self.model) as seen:
            if sample.nu_dot is not None:
                predicted, measured, at = self._acceleration(sample), sample.nu_dot, sample
            elif previous is not None:
                predicted, measured, at = self._increment(previous, sample)
            else:
                return None
            nu = torch.stack(seen).mean(0) if seen else sample.nu
            return Residual(nu, self.inertia(at) @ (predicted - measured), measured - predicted, at)

    def _acceleration(self, sample: Sample) -> Tensor:
        rows, times = self._rows()
        drive = self.model.actuators.drive(
            rows.command, times, [e for h in ("command", "respond", "steer") for e in self.model.using(h)], 1,
            len(times) - 1, rows.fins, speeds=speeds_follow(self.model),
        )  # fmt: skip
        return self.model.nu_dot(
            sample.eta[:3], quat_to_matrix(sample.eta[3:]), sample.nu, drive.start[-1], sample.inputs(),
            times[-1], self._prepared,
        )  # fmt: skip

    def _increment(self, previous: Sample, sample: Sample) -> tuple[Tensor, Tensor, Sample]:
        rows, times = self._rows()
        run = self.model.rollout(
            previous.eta, previous.nu, rows, times, warmup=len(times) - 2, max_step=MAX_STEP, check=False
        )
        dt = sample.t - previous.t
        return (run.nu[-1] - previous.nu) / dt, (sample.nu - previous.nu) / dt, previous

    def _rows(self) -> tuple[Inputs, Tensor]:
        samples = list(self.history)
        columns = [[getattr(s, n) for s in samples] for n in ("command", "fins", "voltage", "altitude")]
        stacked = [None if any(v is None for v in column) else torch.stack(column) for column in columns]
        command = stacked[0]
        assert command is not None
        times = torch.tensor([s.t for s in samples], dtype=command.dtype)
        return Inputs(command, *stacked[1:]), times


@contextmanager
def _seen(model: GreyBox) -> Iterator[list[Tensor]]:
    """Collect the velocities through the water that the subnetworks are given."""
    found: list[Tensor] = []
    if model.damping is None:
        yield found
        return
    handle = model.damping.register_forward_pre_hook(lambda _, given: found.append(given[0].detach()))
    try:
        yield found
    finally:
        handle.remove()
