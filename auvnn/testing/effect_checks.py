"""What every physical effect promises, as functions of its class; by default on a vehicle with everything."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import torch

from auvnn.effects import Extent
from auvnn.models import GreyBox
from auvnn.testing.effect_derivatives import has_right_gradient, recovers, transforms
from auvnn.testing.effect_texts import Kind, describes_itself, refuses
from auvnn.testing.one_effect import beside, built
from auvnn.testing.scene import (
    EXAMPLE,
    THETA,
    Predictor,
    Scene,
    make_scene,
    require,
    require_close,
    together,
    typical_values,
)
from auvnn.testing.units import Units
from auvnn.vehicle import Vehicle


def vanishes(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check that at the null nothing changes, to rounding: acceleration, free run and sensors.

    Neither does it where parameters of shape have other values, those of `starts` among them.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    scene, expected = _without(kind.acts_with, vehicle, actuation)
    described = kind.describe(vehicle, actuation)
    shapes = [{}, *kind.starts(described, Extent(0.0, 1.0, 1.0, (3.0, 5.0)))[:5]]
    shapes.append({p.name: v for p in described if p.shape for v in (p.probes or (p.null + 0.3 * p.scale,))})
    for shape in shapes:
        effects = [kind.build(vehicle, actuation, shape), *beside(kind.acts_with, vehicle, actuation)]
        null = Predictor(GreyBox(vehicle, effects, actuation=actuation))
        with torch.no_grad():
            found = null(scene)
        for output, value in expected.items():
            for a, b in zip(found[output].flatten(0, -2), value.flatten(0, -2), strict=True):
                require_close(a, b, 1e-15, f"{kind.name} at its null {shape or ''} changes {output}")


@lru_cache(maxsize=2)
def _without(
    acts_with: tuple[str, ...], vehicle: Vehicle, actuation: str
) -> tuple[Scene, dict[str, torch.Tensor]]:
    """Return a scene and what happens in it without an effect, which is the same for all that act with the same ones."""
    scene = make_scene(vehicle, actuation)
    with torch.no_grad():
        return scene, Predictor(GreyBox(vehicle, beside(acts_with, vehicle, actuation), actuation=actuation))(
            scene
        )


def batches(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check that a batch gives what its members give one by one.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    model, scene = built(kind, vehicle, actuation), make_scene(vehicle, actuation, runs=3)
    with torch.no_grad():
        whole = together(model(scene))
        for index in range(3):
            require_close(
                together(model(scene.part(index))), whole[index], 1e-12, f"{kind.name}: run {index} alone"
            )


def follows_precision(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check that single precision stays single, is close to double, and that gradients have it too.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    model, scene = built(kind, vehicle, actuation), make_scene(vehicle, actuation)
    exact = together(model(scene))
    require(exact.dtype == torch.float64, f"{kind.name}: double precision became {exact.dtype}")
    single = built(kind, vehicle, actuation).to(torch.float32)
    for times in (scene.times, scene.times.float()):
        rounded = scene.change(lambda x: x.float())
        outputs = single(Scene(rounded.eta, rounded.nu, rounded.inputs, times, scene.warmup))
        for name, value in outputs.items():
            require(value.dtype == torch.float32, f"{kind.name}: {name} became {value.dtype}")
        require_close(together(outputs), exact, 1e-3, f"{kind.name} in single precision")
    together(outputs).square().sum().backward()
    slope = single.get_parameter(THETA).grad
    require(slope is not None and slope.dtype == torch.float32, f"{kind.name}: gradient in single precision")


def follows_device(
    kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters", device: str = "meta"
) -> None:
    """Check that no tensor is left on another device; "meta" needs no hardware.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
        device: as torch calls it.
    """
    model = built(kind, vehicle, actuation).to(device)
    scene = make_scene(vehicle, actuation).change(lambda x: x.to(device))
    effect, row = model.model.effect(kind.name), scene.inputs.each()[0]
    rate = model.model(
        scene.eta,
        scene.nu,
        row.command,
        time=scene.times[0],
        fins=row.fins,
        voltage=row.voltage,
        altitude=row.altitude,
    )
    answer = effect.respond(row.command, row.command, scene.times[:1])
    command = effect.command(scene.inputs.command, scene.times.expand(scene.inputs.command.shape[:-1]))
    answers = [answer] if row.fins is None else [answer, effect.steer(row.fins, row.fins, scene.times[:1])]
    parts = [x for a in answers for x in (a.end, a.mean, a.slope, a.start)]
    for tensor in (rate, *parts, command):
        require(
            tensor.device.type == device, f"{kind.name} gives a result on {tensor.device} instead of {device}"
        )


def keeps_units(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check the declared units: in other units of mass, length and time the same things must happen.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    units, model, scene = Units(), built(kind, vehicle, actuation), make_scene(vehicle, actuation)
    described = model.model.effect(kind.name).parameters_of
    other = units.vehicle(vehicle)
    twins = [kind.build(other, actuation)]
    for effect in beside(kind.acts_with, vehicle, actuation):
        values = {p.name: effect.values()[p.name] * units.factor(p.unit) for p in effect.parameters_of}
        twins.append(type(effect).build(other, actuation, values))
    twin = Predictor(GreyBox(other, twins, actuation=actuation))
    factors = torch.tensor([units.factor(p.unit) for p in described], dtype=torch.float64)
    with torch.no_grad():
        twin.get_parameter(THETA).copy_(model.get_parameter(THETA) * factors)
        expected, found = units.outputs(model(scene)), twin(units.scene(scene, actuation))
    for name, value in expected.items():
        require_close(
            found[name], value, 1e-9, f"{kind.name}: {name} does not scale as the declared units say"
        )


def restores(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check that a state dict brings back the predictions to the last bit, and that copies share nothing.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    model, scene = built(kind, vehicle, actuation), make_scene(vehicle, actuation)
    effects = [kind.build(vehicle, actuation), *beside(kind.acts_with, vehicle, actuation)]
    fresh = Predictor(GreyBox(vehicle, effects, actuation=actuation))
    with torch.no_grad():
        expected = together(model(scene))
        fresh.load_state_dict(model.state_dict())
        require(
            torch.equal(together(fresh(scene)), expected), f"{kind.name}: a restored state predicts otherwise"
        )
        copied = model.model.rebuilt(model.model.copied_effects())
        copied.get_parameter("effects.0.theta").zero_()
        require(torch.equal(together(model(scene)), expected), f"{kind.name}: a copy shares its parameters")


def answers_like_a_lag(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check actuator dynamics: linear in the gap, the same in one step as in two, right moments.

    An effect without dynamics passes.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    for hook in ("respond", "steer"):
        if hook in kind.hooks():
            _answers(kind, vehicle, actuation, hook)


def _answers(kind: Kind, vehicle: Vehicle, actuation: str, hook: str) -> None:
    effect = kind.build(vehicle, actuation, typical_values(kind, vehicle, actuation))
    answer = getattr(effect, hook)
    state, demand = torch.tensor([3.0, -7.0, 20.0]).double(), torch.tensor([5.0, 11.0, -4.0]).double()
    length, one, none = torch.full((3,), 0.3).double(), torch.ones(3).double(), torch.zeros(3).double()
    with torch.no_grad():
        whole, unit = answer(state, demand, length), answer(one, none, length)
        for name in ("end", "mean", "start", "slope"):
            scaled = (state - demand) * getattr(unit, name) + (none if name == "slope" else demand)
            require_close(
                getattr(whole, name), scaled, 1e-12, f"{kind.name}: {name} is not linear in the gap"
            )
        half = answer(state, demand, 0.5 * length).end
        twice = answer(half, demand, 0.5 * length).end
        require_close(twice, whole.end, 1e-12, f"{kind.name}: two half steps against one")
        nodes, weights = np.polynomial.legendre.leggauss(60)
        parts = (torch.tensor(nodes) + 1)[:, None] / 2
        curve, weight = answer(state, demand, parts * length).end, torch.tensor(weights)[:, None] / 2
        require_close(whole.mean, (weight * curve).sum(0), 1e-6, f"{kind.name}: mean over the step")
        rise = 12 * (weight * curve * (parts - 0.5)).sum(0)
        require_close(whole.slope, rise, 1e-6, f"{kind.name}: slope against the first moment")


EFFECT_CHECKS: dict[str, Callable[..., None]] = {
    check.__name__: check
    for check in (
        describes_itself,
        refuses,
        vanishes,
        batches,
        follows_precision,
        follows_device,
        has_right_gradient,
        transforms,
        keeps_units,
        restores,
        answers_like_a_lag,
        recovers,
    )
}


def check_effect(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Run all checks on an effect's class.

    Args:
        kind: the class.
        vehicle: on which vehicle; by default one that has everything.
        actuation: "thrusters" or "wrench".

    Raises:
        AssertionError: a promise is broken; the message says which.
    """
    for check in EFFECT_CHECKS.values():
        check(kind, vehicle, actuation)
