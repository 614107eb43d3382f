"""Adaptation while running: one sample at a time, in bounded time and memory, with guards."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from auvnn.online import state
from auvnn.online.adapter_parts import AdapterParts
from auvnn.online.guards import REASONS
from auvnn.online.intake import refusal, sample_of, turned
from auvnn.online.residual import Residual, Sample
from auvnn.online.schemes.base import Observation
from auvnn.online.update import Update
from auvnn.online.updates.trusted import Trusted

MOST_HELD = 64


class Adapter(AdapterParts):
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
        elif self.guards.enabled and self._contradictory(last, sample):
            until = self._off_until if self._off_cause == "velocity_step" else -float("inf")
            self._off_until, self._off_cause = max(sample.t + self.guards.hold, until), "inconsistent"
        if self._debt > 0.0 and self.guards.budget is not None:
            self._predictor.skip(sample)
            return self._no(sample.t, "over_budget")
        found = self._predictor.take(sample)
        if found is None:
            return self._no(sample.t, "first")
        if self.guards.enabled and last is not None:
            self._wait_after_step(last, sample, found)
        return self._learn(found, sample, dt)

    def _lost(self, last: Sample | None, sample: Sample) -> bool:
        """Whether positions contradict the velocity; what was learned while that began to show is taken back."""
        before = self._positions.wrong
        now = self._positions.disagree(last, sample)
        if now and not before:
            # While adaptation was off nothing was learned: then the fault took no longer to show than others do.
            waited = sample.t < self._off_until and self._off_cause in ("velocity_step", "inconsistent")
            self._take_back(self._recent if waited else self._trusted)
        elif not now and sample.t >= self._off_until:
            if self._trusted.due(sample.t):
                # What is younger may have been learned from a fault that does not show yet.
                self._trusted.keep(sample.t, *self._recent.oldest())
            if self._recent.due(sample.t):
                self._recent.keep(sample.t, self.weights.read(), self.scheme.state())
        return now

    def _contradictory(self, last: Sample | None, sample: Sample) -> bool:
        """Whether sensors contradict one another; what was learned while that began to show is taken back."""
        now = self._consistency.faulty(last, sample)
        if now and (sample.t >= self._off_until or self._off_cause == "velocity_step"):
            self._take_back(self._recent)
        return now

    def _take_back(self, states: Trusted) -> None:
        weights, scheme = states.back()
        if not torch.equal(weights, self.weights.read()):
            self.counts.reverted += 1
        self.weights.write(weights)
        self.scheme.load(scheme)
        self._shadow.close(weights, scheme)
        self._trial.begin(self.weights)

    def _wait_after_step(self, last: Sample, sample: Sample, found: Residual) -> None:
        """Adaptation waits after a step of the velocity that no force makes, until sensors would contradict it."""
        steps = self._steps.judge(last, sample, found)
        off = sample.t < self._off_until
        if steps and not off:
            self._off_until, self._off_cause = sample.t + self.guards.step_hold, "velocity_step"
        elif steps is False and off and self._off_cause == "velocity_step":
            self._off_until = sample.t

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
        observation = Observation(sample.t, dt, found.nu, target, error, slope, torch.tensor(std) ** 2)
        if not guards.enabled:
            self._watch(found, missing)
            proposed = self.scheme.propose(self.weights, observation)
            if proposed is None:
                return self._no(sample.t, "no_news", **told)
            return self._set(proposed, observation, found, told)
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
        proven = self._trial.take(self.weights, target, found.nu, error, observation.variance)
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
        reverted, validated = self._judge(observation)
        told |= {"reverted": reverted, "validated": validated}
        if reverted:
            value, slope = self.weights.jacobian(found.nu)
            observation = Observation(
                sample.t, dt, found.nu, target, target - value, slope, observation.variance
            )
        self._bounds.visit(self._model, found.nu)
        proposed = self.scheme.propose(self.weights, observation)
        if proposed is None:
            return self._no(sample.t, "no_news", **told)
        return self._set(proposed, observation, found, told)

    def _watch(self, found: Residual, missing: Tensor) -> None:
        if self._monitor is not None:
            self._monitor.add(found.sample, found.nu, missing)

    def _judge(self, observation: Observation) -> tuple[bool, bool]:
        old = self._shadow.error(observation.target, observation.nu)
        verdict = self._shadow.verdict(observation.t, observation.error, old, observation.variance)
        if verdict == "worse":
            self.weights.write(self._shadow.valid)
            self.scheme.load(self._shadow.scheme_state)
            self._shadow.close()
            self.counts.reverted += 1
        elif verdict == "valid":
            self._shadow.close(self.weights.read(), self.scheme.state())
            self.counts.validated += 1
        return verdict == "worse", verdict == "valid"

    def _set(
        self, proposed: Tensor, observation: Observation, found: Residual, told: dict[str, Any]
    ) -> Update:
        before = self.weights.read()
        moved: Tensor | None = None
        if self.guards.enabled:
            moved, shortened = self._bounds.admit(self.weights, proposed, observation.nu, observation.dt)
            self.counts.shortened += int(shortened)
            if moved is not None:
                self._shadow.open(observation.t)
        elif bool(torch.isfinite(proposed).all()):
            self.weights.write(proposed)
            moved = self.weights.value(observation.nu) - (observation.target - observation.error)
        if moved is None:
            return self._no(observation.t, "limited", **told)
        return Update(
            observation.t, True, "learned from this sample", "adapted", **told,
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
