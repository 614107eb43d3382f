"""What an adapter consists of: model, weights, guards and monitor, and the models that it hands out."""

from __future__ import annotations

import copy
import time as clocks
from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import Tensor

from auvnn.damping.bank import DampingBank, Description
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.online.change_detection.change import Monitor
from auvnn.online.change_detection.change_words import Change
from auvnn.online.consistency import Consistency
from auvnn.online.counts import Counts
from auvnn.online.guards import Guards, build_guards
from auvnn.online.noise import Gate, NoiseLevel
from auvnn.online.positions import Positions
from auvnn.online.residual import Predictor, Sample
from auvnn.online.schemes.base import OnlineScheme, anchors, build_online_scheme
from auvnn.online.updates.bounds import Bounds, known_drag
from auvnn.online.updates.shadow import Shadow
from auvnn.online.updates.trial import Trial
from auvnn.online.updates.trusted import QUICK, Trusted
from auvnn.online.updates.weights import Weights
from auvnn.online.velocity_steps import VelocitySteps

# Scales of subnetworks that an adapter adds itself: of velocity, and of acceleration for the force.
SPEED = 0.3
ACCELERATION = 0.3


class AdapterParts:
    """What an adapter consists of: model, weights, guards and monitor, and the models that it hands out.

    Attributes:
        counts: how often what happened.
    """

    def __init__(
        self,
        model: GreyBox,
        scheme: str | Mapping[str, Any] | OnlineScheme = "rls",
        *,
        guards: Guards | str | Mapping[str, Any] | None = "full",
        damping: Description = "polynomial",
        watch: bool = True,
        clock: Callable[[], float] = clocks.perf_counter,
    ) -> None:
        """Copy the model and begin."""
        self.guards = build_guards(guards)
        self.scheme = build_online_scheme(scheme)
        self.counts = Counts()
        self.clock = clock
        self.paused = False
        self._model = copy.deepcopy(model)
        self.added = None if model.damping is not None else damping
        if self._model.damping is None:
            self._model = with_subnetworks(self._model, damping)
        bank = self._model.damping
        assert bank is not None
        self.weights = Weights(bank, self.scheme.layers)
        self._original = Weights(copy.deepcopy(bank), self.scheme.layers)
        if self.guards.enabled and self.guards.dissipative:
            bank.passive = True
            own = self._model
            self._model = GreyBox(own.vehicle, own.copied_effects(), bank, own.actuation)
        self.scheme.start(self.weights, known_drag(self._model, anchors(self.weights)) / bank.output_scale)
        self._predictor = Predictor(self._model)
        self._noise = NoiseLevel(self.guards.noise_floor)
        self._gate = Gate(self.guards.gate, self.guards.gate_floor, self.guards.persist)
        self._shadow = Shadow(self.weights, self.guards.judge, self.guards.worse)
        self._shadow.close(scheme_state=self.scheme.state())
        self._trial = Trial(self.weights, self.guards.proof if self.guards.enabled else 0.0)
        self._bounds = Bounds(self.weights, self.guards)
        self._consistency = Consistency()
        self._positions = Positions()
        self._trusted = Trusted(self.weights.read(), self.scheme.state())
        self._recent = Trusted(self.weights.read(), self.scheme.state(), QUICK)
        self._steps = VelocitySteps(bank.input_scale)
        self._monitor = Monitor(self._unadapted(), bank.output_scale) if watch else None
        self._held: list[tuple[Sample, Tensor, Tensor]] = []
        self._off_until = -float("inf")
        self._off_cause = "fault_flagged"
        self._debt = 0.0
        self._resting = 0

    def _unadapted(self) -> GreyBox:
        """Return the model with the subnetworks that the adapter began with."""
        own = self._model
        return GreyBox(own.vehicle, own.copied_effects(), copy.deepcopy(self._original.bank), own.actuation)

    @property
    def changes(self) -> list[Change]:
        """The changes of the vehicle that were seen, oldest first; the last one may still be revised."""
        return [] if self._monitor is None else list(self._monitor.changes)

    @property
    def model(self) -> GreyBox:
        """A copy of the model as it is adapted now, for others to use and keep; with `guards.proof`, what is proven."""
        found = copy.deepcopy(self._model)
        for parameter in found.parameters():
            parameter.grad = None
        if self._trial.on and found.damping is not None:
            Weights(found.damping, self.weights.layers).write(self._trial.used)
        return found

    @property
    def validated_model(self) -> GreyBox:
        """A copy of the model with the last validated weights."""
        found = self.model
        assert found.damping is not None
        Weights(found.damping, self.weights.layers).write(self._shadow.valid)
        return found

    def snapshot(self) -> dict[str, Tensor]:
        """Return the subnetworks' parameters in use now, by name, for `frozen_errors`."""
        bank = self._trial.bank if self._trial.on else self._model.damping
        assert bank is not None
        return {name: p.detach().clone() for name, p in bank.named_parameters()}

    def use(self, model: GreyBox) -> None:
        """Go on with another model's known part: mass, added mass, buoyancy or effects that changed knowingly.

        The subnetworks stay the adapter's own.
        """
        if model.actuation != self._model.actuation:
            raise ConfigError(f"the adapter is driven by {self._model.actuation}, not by {model.actuation}")
        found = GreyBox(model.vehicle, model.copied_effects(), self._model.damping, model.actuation)
        self._model = found
        self._predictor.use(found)
        self._consistency.forget()
        if self._monitor is not None:
            self._monitor.use(self._unadapted())

    def new_run(self) -> None:
        """Begin another run, whose time may start again: nothing is compared across the gap; weights stay."""
        self._predictor.forget_all()
        self._consistency.forget()
        self._positions.forget()
        self._trusted.restart()
        self._recent.restart()
        self._steps.forget()
        self._gate.clear()
        self._held, self._resting, self._off_until = [], 0, -float("inf")
        if self._shadow.since is not None:
            # What was being judged is kept only if the next run confirms it, on that run's clock.
            self._shadow.restart()
        if self._monitor is not None:
            self._monitor.new_run()


def with_subnetworks(model: GreyBox, damping: Description) -> GreyBox:
    """Return a model with damping subnetworks that give nothing yet, scaled by the vehicle's inertia."""
    bank = DampingBank.from_description(damping)
    bank.input_scale.fill_(SPEED)
    bank.output_scale.copy_(torch.diagonal(model.prepare().total.detach()) * ACCELERATION)
    weights = Weights(bank, "last")
    weights.write(torch.zeros_like(weights.read()))
    return GreyBox(model.vehicle, model.copied_effects(), bank, model.actuation)
