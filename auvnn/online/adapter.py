"""Adaptation while running: one sample at a time, in bounded time and memory, with guards."""

from __future__ import annotations

import copy
import time as clocks
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from auvnn.damping.bank import DampingBank, Description
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.online import state
from auvnn.online.bounds import Bounds, known_drag
from auvnn.online.change import Monitor
from auvnn.online.change_words import Change
from auvnn.online.consistency import Consistency
from auvnn.online.counts import Counts
from auvnn.online.guards import REASONS, Guards, build_guards
from auvnn.online.intake import refusal, sample_of, turned
from auvnn.online.noise import Gate, NoiseLevel
from auvnn.online.positions import Positions
from auvnn.online.residual import Predictor, Residual, Sample
from auvnn.online.schemes.base import Lesson, OnlineScheme, anchors, build_online_scheme
from auvnn.online.shadow import Shadow
from auvnn.online.trial import Trial
from auvnn.online.trusted import Trusted
from auvnn.online.weights import Weights

# Scales of subnetworks that an adapter adds itself: of velocity, and of acceleration for the force.
SPEED = 0.3
ACCELERATION = 0.3
MOST_HELD = 64


@dataclass(frozen=True)
class Update:
    """What a step did.

    Attributes:
        t: s.
        adapted: whether the weights moved.
        reason: in words, why or why not.
        cause: the reason's short name: "adapted", or a key of `guards.REASONS`.
        residual: (6,) wrench that the model lacked before the update, N and N m, or None.
        prediction_error: (6,) measured minus predicted acceleration before the update, or None.
        unadapted_error: (6,) the same of the model that the adapter began with, or None.
        change: length of the weights' step.
        force_change: (6,) change of the damping at this velocity, N and N m, or None.
        reverted: whether an update was taken back.
        validated: whether the weights became the validated ones.
        proven: degrees of freedom whose learned weights came into use (with `guards.proof`).
        believed: whether a sudden residual was accepted as a change of the vehicle.
    """

    t: float
    adapted: bool
    reason: str
    cause: str
    residual: Tensor | None = None
    prediction_error: Tensor | None = None
    unadapted_error: Tensor | None = None
    change: float = 0.0
    force_change: Tensor | None = None
    reverted: bool = False
    validated: bool = False
    proven: int = 0
    believed: bool = False


class Adapter:
    """Adapts the damping subnetworks of a model to what is measured, sample by sample.

    ```python
    adapter = auvnn.online.Adapter(model)
    for t, eta, nu, command in samples:
        update = adapter.step(t, eta, nu, command)
        controller.use(adapter.model)
    ```

    Args:
        model: not changed; the adapter works on a copy. A model without damping subnetworks gets some.
        scheme: `rls`, `sgd`, `replay`, or a mapping of its options with `scheme`.
        guards: "full", "none" (weights follow every sample, as in the paper), or numbers by name.
        damping: form of the subnetworks for a model that has none.
        watch: say what kind of change was seen (`changes`); costs about as much as the adaptation itself.
        clock: seconds, for the budget; another one for tests.

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
            self._model = GreyBox(
                self._model.vehicle, self._model.copied_effects(), bank, self._model.actuation
            )
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
        self._gate.clear()
        self._held, self._resting, self._off_until = [], 0, -float("inf")
        if self._shadow.since is not None:
            # What was being judged is kept only if the next run confirms it, on that run's clock.
            self._shadow.restart()
        if self._monitor is not None:
            self._monitor.new_run()

    def step(
        self,
        t: float,
        eta: Any,
        nu: Any,
        command: Any,
        nu_dot: Any = None,
        *,
        now: float | None = None,
        fault: bool = False,
        **channels: Any,
    ) -> Update:
        """Take one sample.

        Args:
            t: s, increasing.
            eta: (7,) position NED and quaternion, or (6,) with Euler angles.
            nu: (6,), m/s and rad/s.
            command: (n,) commands, held from `t` until the next sample.
            nu_dot: (6,) measured acceleration just after the command has begun to act; where it is not given,
                the increment of velocity since the last sample is compared with the model's own.
            now: s, the time at which the sample arrived, for `guards.max_age`.
            fault: a sensor fault is known to the caller.
            **channels: `fins`, `voltage`, `altitude`.

        Returns:
            What was done, and why.

        Raises:
            ConfigError: a vector has the wrong size.
        """
        begin = self.clock()
        update = self._step(t, eta, nu, command, nu_dot, now, fault, channels)
        self.counts.samples += 1
        if update.adapted:
            self.counts.adapted += 1
        else:
            self.counts.skipped[update.cause] += 1
        if self.guards.budget is not None:
            self._debt = max(0.0, self._debt + self.clock() - begin - self.guards.budget)
        return update

    def _step(
        self, t: Any, eta: Any, nu: Any, command: Any, nu_dot: Any, now: float | None, fault: bool,
        channels: dict[str, Any],
    ) -> Update:  # fmt: skip
        sample = sample_of(self._model, t, eta, nu, command, nu_dot, **channels)
        if sample is None:
            # The next sample is compared across the hole, unless it is longer than `max_gap`.
            return self._no(float("nan"), "not_finite")
        sample = turned(sample)
        if sample is None:
            return self._no(float("nan"), "no_rotation")
        last = self._predictor.last
        why = refusal(sample, last, self.guards, now)
        if why is not None:
            return self._no(sample.t, why)
        if last is not None and sample.t - last.t > self.guards.max_gap:
            self._predictor.forget()
            last = None
        dt = 0.0 if last is None else sample.t - last.t
        if not fault and self._passed_over(sample):
            self._predictor.skip(sample)
            return self._no(sample.t, "at_rest")
        if self.guards.enabled and self._lost(last, sample):
            self._off_until, self._off_cause = sample.t + self.guards.hold, "positions_disagree"
        elif fault:
            self._off_until, self._off_cause = sample.t + self.guards.hold, "fault_flagged"
        elif self.guards.enabled and self._consistency.faulty(last, sample):
            self._off_until, self._off_cause = sample.t + self.guards.hold, "inconsistent"
        if self._debt > 0.0 and self.guards.budget is not None:
            self._predictor.skip(sample)
            return self._no(sample.t, "over_budget")
        found = self._predictor.take(sample)
        if found is None:
            return self._no(sample.t, "first")
        return self._learn(found, sample, dt)

    def _lost(self, last: Sample | None, sample: Sample) -> bool:
        """Whether positions contradict the velocity; what was learned while that began to show is taken back."""
        before = self._positions.wrong
        now = self._positions.disagree(last, sample)
        if now and not before:
            weights, scheme = self._trusted.back()
            if not torch.equal(weights, self.weights.read()):
                self.counts.reverted += 1
            self.weights.write(weights)
            self.scheme.load(scheme)
            self._shadow.close(weights, scheme)
            self._trial.begin(self.weights)
        elif not now and sample.t >= self._off_until and self._trusted.due(sample.t):
            self._trusted.keep(sample.t, self.weights.read(), self.scheme.state())
        return now

    def _passed_over(self, sample: Sample) -> bool:
        """Whether this is one of the many samples at rest that are not looked at, ever rarer as rest goes on."""
        if not self.guards.enabled or not self._rests(sample.nu):
            self._resting = 0
            return False
        self._resting += 1
        n = self._resting
        return bool(n & (n - 1)) and n % max(1, int(self.guards.idle)) != 0

    def _rests(self, nu: Tensor) -> bool:
        bank = self._model.damping
        assert bank is not None
        return bool(((nu / bank.input_scale).abs() < self.guards.rest).all())

    def _learn(self, found: Residual, sample: Sample, dt: float) -> Update:
        bank, guards = self.weights.bank, self.guards
        value, slope = self.weights.jacobian(found.nu)
        error = found.error / bank.output_scale
        target = self.weights.limited(found.nu) + error
        error = target - value
        inertia = self._predictor.inertia(found.sample)
        original = target - self._original.limited(found.nu)
        told: dict[str, Any] = {
            "residual": found.error,
            "prediction_error": found.acceleration,
            "unadapted_error": torch.linalg.solve(inertia, -original * bank.output_scale),
        }
        missing = -original * bank.output_scale
        std = self._noise.std()
        lesson = Lesson(sample.t, dt, found.nu, target, error, slope, torch.tensor(std) ** 2)
        if not guards.enabled:
            self._watch(found, missing)
            proposed = self.scheme.propose(self.weights, lesson)
            if proposed is None:
                return self._no(sample.t, "no_news", **told)
            return self._set(proposed, lesson, found, told)
        if self.paused:
            return self._no(sample.t, "paused", **told)
        if sample.t < self._off_until:
            self._gate.clear()
            self._held.clear()
            return self._no(sample.t, self._off_cause, **told)
        if self._rests(found.nu):
            self._watch(found, missing)
            return self._no(sample.t, "at_rest", **told)
        if self._noise.count < guards.settle:
            self._noise.add(error)
            self._watch(found, missing)
            return self._no(sample.t, "noise_unknown", **told)
        held, believed = self._gate.holds(sample.t, error, std)
        if held:
            # The monitor sees them only if they turn out to be true.
            self._held = [*self._held[-MOST_HELD:], (found.sample, found.nu, missing)]
            return self._no(sample.t, "gated", **told)
        self._noise.add(error)
        proven = self._trial.take(self.weights, target, found.nu, error, lesson.variance)
        self.counts.proven += proven
        told["proven"] = proven
        held_back, self._held = self._held, []
        if believed and self._monitor is not None:
            for row in held_back:
                self._monitor.add(*row)
        self._watch(found, missing)
        if believed:
            self.counts.believed += 1
            self.scheme.changed()
            told["believed"] = True
        reverted, validated = self._judge(lesson)
        told |= {"reverted": reverted, "validated": validated}
        if reverted:
            value, slope = self.weights.jacobian(found.nu)
            lesson = Lesson(sample.t, dt, found.nu, target, target - value, slope, lesson.variance)
        self._bounds.visit(self._model, found.nu)
        proposed = self.scheme.propose(self.weights, lesson)
        if proposed is None:
            return self._no(sample.t, "no_news", **told)
        return self._set(proposed, lesson, found, told)

    def _watch(self, found: Residual, missing: Tensor) -> None:
        if self._monitor is not None:
            self._monitor.add(found.sample, found.nu, missing)

    def _judge(self, lesson: Lesson) -> tuple[bool, bool]:
        old = self._shadow.error(lesson.target, lesson.nu)
        verdict = self._shadow.verdict(lesson.t, lesson.error, old, lesson.variance)
        if verdict == "worse":
            self.weights.write(self._shadow.valid)
            self.scheme.load(self._shadow.scheme_state)
            self._shadow.close()
            self.counts.reverted += 1
        elif verdict == "valid":
            self._shadow.close(self.weights.read(), self.scheme.state())
            self.counts.validated += 1
        return verdict == "worse", verdict == "valid"

    def _set(self, proposed: Tensor, lesson: Lesson, found: Residual, told: dict[str, Any]) -> Update:
        before = self.weights.read()
        moved: Tensor | None = None
        if self.guards.enabled:
            moved, shortened = self._bounds.admit(self.weights, proposed, lesson.nu, lesson.dt)
            self.counts.shortened += int(shortened)
            if moved is not None:
                self._shadow.open(lesson.t)
        elif bool(torch.isfinite(proposed).all()):
            self.weights.write(proposed)
            moved = self.weights.value(lesson.nu) - (lesson.target - lesson.error)
        if moved is None:
            return self._no(lesson.t, "limited", **told)
        return Update(
            lesson.t, True, "learned from this sample", "adapted", **told,
            change=float((self.weights.read() - before).norm()),
            force_change=moved * self.weights.bank.output_scale,
        )  # fmt: skip

    def _no(self, t: float, cause: str, **told: Any) -> Update:
        return Update(t, False, REASONS[cause], cause, **told)

    def save(self, folder: str | Path) -> Path:
        """Write all of the adapter's state into a folder, whole or not at all; see `auvnn.online.state`."""
        return state.save(self, folder)

    @classmethod
    def restore(cls, folder: str | Path, *, validated: bool = False) -> Adapter:
        """Return the adapter that `save` wrote; it goes on bit for bit, or from its last validated weights."""
        return state.restore(cls, folder, validated=validated)


def with_subnetworks(model: GreyBox, damping: Description) -> GreyBox:
    """Return a model with damping subnetworks that give nothing yet, scaled by the vehicle's inertia."""
    bank = DampingBank.from_description(damping)
    bank.input_scale.fill_(SPEED)
    bank.output_scale.copy_(torch.diagonal(model.prepare().total.detach()) * ACCELERATION)
    weights = Weights(bank, "last")
    weights.write(torch.zeros_like(weights.read()))
    return GreyBox(model.vehicle, model.copied_effects(), bank, model.actuation)
