"""The contract checks catch what they are there for: for each, an effect that breaks just that promise."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from auvnn.effects import EFFECTS, Effect, Parameter, Response
from auvnn.testing import EFFECT_CHECKS, check_effect, example_vehicle
from auvnn.testing.units import Units, powers


class Push(Effect):
    """A force along x and a moment about z: sound, unless a subclass spoils it."""

    name, cause, symbol, reference = "push", "something pushes", "F", "none"

    @classmethod
    def describe(cls, vehicle, actuation):
        return (
            Parameter("force", "N", 0.0, 5.0, -100.0, 100.0),
            Parameter("moment", "N m", 0.0, 1.0, -50.0, 50.0),
        )

    def wrench(self, moment, body):
        force, turn = self.theta.to(moment.nu)
        zero = torch.zeros_like(force)
        return torch.stack([force, zero, zero, zero, zero, turn]).expand_as(moment.nu)


class NoScale(Push):
    @classmethod
    def describe(cls, vehicle, actuation):
        return tuple(replace(p, scale=0.0) for p in super().describe(vehicle, actuation))


class NullOutOfBounds(Push):
    @classmethod
    def describe(cls, vehicle, actuation):
        return tuple(replace(p, low=1.0, probes=(2.0,)) for p in super().describe(vehicle, actuation))


class NoCause(Push):
    cause = ""


class NoHook(Effect):
    name, cause, symbol, reference = "idle", "nothing", "-", "none"
    describe = Push.describe


class Loose(Parameter):
    def checked(self, effect, value):
        return float(value)


class AnythingGoes(Push):
    @classmethod
    def describe(cls, vehicle, actuation):
        return tuple(
            Loose(p.name, p.unit, p.null, p.scale, p.low, p.high)
            for p in super().describe(vehicle, actuation)
        )


class NeverQuiet(Push):
    def wrench(self, moment, body):
        return super().wrench(moment, body) + 1e-9


class MixesRuns(Push):
    def wrench(self, moment, body):
        mean = moment.nu.mean() if moment.nu.dim() > 1 else moment.nu[..., 0]
        return super().wrench(moment, body) * mean


class AlwaysDouble(Push):
    def wrench(self, moment, body):
        return super().wrench(moment, body) * torch.ones(6, dtype=torch.float64)


class Detached(Push):
    def wrench(self, moment, body):
        return super().wrench(moment, body).detach()


class HalfDetached(Push):
    def wrench(self, moment, body):
        return super().wrench(moment, body) + self.theta[0].detach()  # the derivative lacks a part


class LooksAtNumbers(Push):
    def wrench(self, moment, body):
        return super().wrench(moment, body) * (2.0 if float(self.theta[0]) > 0 else 1.0)


class WrongUnit(Push):
    @classmethod
    def describe(cls, vehicle, actuation):
        force, moment = super().describe(vehicle, actuation)
        return force, replace(moment, unit="N m/s")


class AmountOfAnother(Push):
    """Says that an amount belongs to another one, as only a shape does."""

    @classmethod
    def describe(cls, vehicle, actuation):
        force, moment = super().describe(vehicle, actuation)
        return force, replace(moment, of="force")


class ShapeOfNobody(EFFECTS.get("tether")):
    """Has a shape that belongs to an amount which is not there."""

    name = "shape_of_nobody"

    @classmethod
    def describe(cls, vehicle, actuation):
        return tuple(replace(p, of=p.of and "elasticity") for p in super().describe(vehicle, actuation))


class NotSI(Push):
    @classmethod
    def describe(cls, vehicle, actuation):
        return tuple(replace(p, unit="lbf") for p in super().describe(vehicle, actuation))


class ForgetsItsState(Push):
    def __init__(self, parameters, values=None):
        super().__init__(parameters, values)
        self.extra = 1.0 + sum((values or {}).values())

    def wrench(self, moment, body):
        return super().wrench(moment, body) * self.extra


class Degenerate(Push):
    def wrench(self, moment, body):
        force = self.theta.to(moment.nu).sum()
        zero = torch.zeros_like(force)
        return torch.stack([force, zero, zero, zero, zero, zero]).expand_as(moment.nu)


class MovesNothing(Push):
    def wrench(self, moment, body):
        return torch.zeros_like(moment.nu) * self.theta[0] * self.theta[1]


class Overshoots(EFFECTS.get("thruster_lag")):
    def respond(self, state, demand, step):
        return replace(super().respond(state, demand, step), mean=demand)


class RateLimited(EFFECTS.get("thruster_lag")):
    def respond(self, state, demand, step):
        end = state + torch.clamp(demand - state, -1.0, 1.0) * step
        return Response(end, 0.5 * (state + end), end - state, state)


class LooksOutside(EFFECTS.get("payload")):
    """Looks before the log has begun: an onset below zero cannot be built."""

    name = "looks_outside"

    @classmethod
    def closest(cls, parameters, extent, shape, level):
        return [] if level else [{**shape, "time": extent.begin - 1.0}]


class LooksForever(EFFECTS.get("payload")):
    """Never near enough."""

    name = "looks_forever"

    @classmethod
    def closest(cls, parameters, extent, shape, level):
        return [{**shape}]


BROKEN = [
    ("answers_like_a_lag", Overshoots),
    ("answers_like_a_lag", RateLimited),
    ("describes_itself", NoScale),
    ("describes_itself", NullOutOfBounds),
    ("describes_itself", NoCause),
    ("describes_itself", NoHook),
    ("describes_itself", NotSI),
    ("describes_itself", AmountOfAnother),
    ("describes_itself", ShapeOfNobody),
    ("describes_itself", LooksOutside),
    ("describes_itself", LooksForever),
    ("refuses", AnythingGoes),
    ("vanishes", NeverQuiet),
    ("batches", MixesRuns),
    ("follows_precision", AlwaysDouble),
    ("follows_device", AlwaysDouble),
    ("has_right_gradient", Detached),
    ("has_right_gradient", HalfDetached),
    ("has_right_gradient", MovesNothing),
    ("transforms", LooksAtNumbers),
    ("keeps_units", WrongUnit),
    ("restores", ForgetsItsState),
    ("recovers", Degenerate),
]


@pytest.mark.parametrize(("check", "kind"), BROKEN, ids=lambda x: x if isinstance(x, str) else x.__name__)
def test_a_broken_effect_is_caught(check, kind):
    # torch refuses some of it by itself: two devices, two precisions, a number out of a traced tensor.
    with pytest.raises((AssertionError, RuntimeError)):
        EFFECT_CHECKS[check](kind)


def test_every_check_is_known_to_catch_something():
    assert {check for check, _ in BROKEN} == set(EFFECT_CHECKS)


def test_a_sound_effect_of_another_author_passes():
    check_effect(Push)


def test_the_example_vehicle_is_a_sound_one_that_has_everything():
    vehicle = example_vehicle()
    assert vehicle.warnings == ()
    assert vehicle.linear_damping is not None and vehicle.quadratic_damping is not None
    assert vehicle.damping_elements and vehicle.fins and vehicle.reference_voltage
    assert {type(u.curve).__name__ for u in vehicle.thrusters} == {"str", "ThrustTable"}


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("1", (0, 0, 0)),
        ("m/s2", (0, 1, -2)),
        ("N m", (1, 2, -2)),
        ("N s2/m2", (1, -1, 0)),
        ("1/s", (0, 0, -1)),
        ("rad/s", (0, 0, -1)),
        ("N s/rad", (1, 1, -1)),
    ],
)
def test_units_are_read(unit, expected):
    assert powers(unit) == expected


@pytest.mark.parametrize("unit", ["lbf", "m/s/s", "", "knots"])
def test_units_that_are_not_si_are_refused(unit):
    with pytest.raises(AssertionError):
        powers(unit)


def test_a_newton_is_a_kilogram_metre_per_second_squared():
    units = Units(mass=2.0, length=3.0, time=5.0)
    assert units.factor("N") == pytest.approx(units.factor("kg") * units.factor("m/s2"))
    assert units.factor("N") == pytest.approx(2 * 3 / 25)


def test_the_catalogue_is_checked_at_values_away_from_the_null():
    from auvnn.testing.scene import typical_values

    for name in EFFECTS.names():
        kind = EFFECTS.get(name)
        values = typical_values(kind, example_vehicle(), "thrusters")
        for p in kind.describe(example_vehicle(), "thrusters"):
            # A moment or a shape says itself where it is to be asked for; anything else is well away from its null.
            asked = p.shape and values[p.name] in p.probes and values[p.name] != p.null
            assert asked or abs(values[p.name] - p.null) > 0.1 * p.scale, (name, p.name)
