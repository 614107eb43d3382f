"""What an adapter refuses, with the numbers as options, and the words for each refusal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError

# Why a sample was not learned from; the keys are counted, the words are for people.
REASONS = {
    "not_finite": "a number is missing or not finite: the model is held",
    "no_rotation": "the attitude's quaternion is zero or far from length one: no rotation",
    "repeated": "the sample repeats the last one: a frozen sensor or a message sent twice",
    "out_of_order": "the sample is older than the last one",
    "stale": "the sample is too old when it arrives",
    "fault_flagged": "a sensor fault is flagged: adaptation is off",
    "inconsistent": "sensors contradict one another: adaptation is off",
    "positions_disagree": "the velocity does not lead from position to position: adaptation is off until it does",
    "velocity_step": "the velocity stepped as no force makes it: adaptation is off until attitude and positions "
    "have had time to contradict it",
    "over_budget": "the last update took longer than its time: this sample is skipped, not queued",
    "first": "nothing to compare with yet",
    "at_rest": "at rest the damping is not excited",
    "noise_unknown": "the noise is not known yet",
    "gated": "the residual is too sudden for the vehicle: it must last before it is believed",
    "no_news": "the sample says nothing that is not known",
    "limited": "no step was left inside the admissible set",
    "paused": "adaptation is paused",
}


@dataclass(frozen=True)
class Guards:
    """Numbers of the guards; `Guards.none()` leaves only what no adapter can do without.

    Attributes:
        max_gap: a longer step in time starts the history again, s.
        max_age: a sample older than this when it arrives is stale, s; needs `now` at each step.
        rest: speeds below this share of the subnetworks' velocity scale do not excite the damping.
        idle: at rest samples are looked at ever more rarely, in the end one in this many; the others cost next to
            nothing.
        gate: residuals beyond this many robust standard deviations are suspect.
        gate_floor: the least standard deviation that the gate assumes, in the subnetworks' force scale.
        persist: a suspect residual is believed when it has lasted this long, s.
        hold: adaptation stays off for this long after a fault was last seen, s.
        step_hold: adaptation is off for this long after a step of the measured velocity that no force can make, s;
            0: it goes on.
        noise_floor: the least standard deviation of the noise, in the subnetworks' force scale.
        settle: samples from which the noise is estimated before anything is learned.
        judge: updates are judged against the last validated weights over this many seconds.
        worse: mean relative disadvantage in squared error (from -1 to 1) that takes an update back.
        proof: logarithm of the odds that learned weights must show, by predicting samples that they have not learned
            from better than those in use, before they are used; 0: at once. See `Trial`.
        bound: no weight leaves its start by more than this many times its row's size.
        output_bound: the damping stays below this many times the force scale.
        rate: change of the damping per second, in the force scale, where the vehicle is.
        dissipative: the drag as a whole gives no energy, at any velocity through the water (`GreyBox.passive`), and
            no update may ask for it where the vehicle has been.
        budget: s of wall clock that a step may take, or None; what was overdrawn is paid back by skipping.
        enabled: false leaves only what no adapter can do without: numbers, and time that goes forward.
    """

    max_gap: float = 0.5
    max_age: float | None = None
    rest: float = 0.05
    idle: int = 1000
    gate: float = 8.0
    gate_floor: float = 0.05
    persist: float = 0.3
    hold: float = 1.0
    step_hold: float = 3.0
    noise_floor: float = 0.01
    settle: int = 10
    judge: float = 1.0
    worse: float = 0.05
    proof: float = 0.0
    bound: float = 20.0
    output_bound: float = 50.0
    rate: float = 50.0
    dissipative: bool = True
    budget: float | None = None
    enabled: bool = True

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ConfigError: one is out of range.
        """
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name in ("dissipative", "enabled"):
                good, wanted = isinstance(value, bool), "true or false"
            elif value is None and item.name in ("max_age", "budget"):
                good, wanted = True, ""
            else:
                good = isinstance(value, (int, float)) and not isinstance(value, bool) and 0 <= value < 1e12
                wanted = "a number that is not negative"
            if not good:
                raise ConfigError(f"guard '{item.name}' is {value!r}: give {wanted}")
        if self.idle < 1 or self.settle < 3:
            raise ConfigError("guards: idle is at least 1, and settle at least 3")

    @classmethod
    def none(cls) -> Guards:
        """Return guards that are off: weights follow every finite new sample, as in the paper."""
        return cls(enabled=False)

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as plain data."""
        return asdict(self)


def build_guards(given: Guards | str | Mapping[str, Any] | None) -> Guards:
    """Return guards from "full", "none", a mapping of numbers, or guards.

    Raises:
        ConfigError: an unknown word or name, or a number out of range.
    """
    if isinstance(given, Guards):
        return given
    if given is None or given == "full":
        return Guards()
    if given == "none":
        return Guards.none()
    if not isinstance(given, Mapping):
        raise ConfigError(f"guards={given!r}: give full, none, or their numbers")
    known = [item.name for item in fields(Guards)]
    for name in given:
        if name not in known:
            raise ConfigError(unknown_name("guard", str(name), known))
    return Guards(**given)
