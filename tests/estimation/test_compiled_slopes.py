"""Slopes by machine code against those by torch's own reverse mode, for every effect of the catalogue."""

from __future__ import annotations

import pytest
import torch

from auvnn.compiled import toolchain
from auvnn.compiled.known_code import KnownCode
from auvnn.damping.bank import DampingBank
from auvnn.effects import EFFECTS
from auvnn.estimation import compiled_slopes as slopes_module
from auvnn.estimation import point_slopes
from auvnn.estimation.compiled_slopes import WORTH, compiled_slopes
from auvnn.estimation.force_marginalisation.columns import PUSH, pushed
from auvnn.estimation.point_slopes import OperatingPoint, differentiate
from auvnn.models import GreyBox, Inputs
from auvnn.testing.scene import typical_values
from tests.small_logs import small_vehicle

pytestmark = pytest.mark.skipif(toolchain.compiler() is None, reason="there is no C compiler")
DOUBLE = torch.float64
NAMES = EFFECTS.names()
GROUPS = [NAMES[k::5] for k in range(5)]


@pytest.fixture
def always(monkeypatch):
    """However few moments there are, they are worth it."""
    monkeypatch.setenv("AUVNN_ENGINE", "auto")
    monkeypatch.setattr(slopes_module, "WORTH", 1)
    monkeypatch.setattr(slopes_module, "_MADE", KnownCode(16))


def model_with(names, damping=None):
    vehicle = small_vehicle(buoyancy=495.0)
    values = {n: typical_values(EFFECTS.get(n), vehicle, "thrusters", 0.3) for n in names}
    bank = None if damping is None else DampingBank.from_description(damping)
    return GreyBox(vehicle, (), bank).with_effects(values)


def moments(model, count, seed=5):
    """Return position, quaternion, velocity, thrust, time and inputs, (1, count, ...)."""
    generator = torch.Generator().manual_seed(seed)

    def draw(*shape):
        return torch.randn(1, count, *shape, generator=generator, dtype=DOUBLE)

    position = draw(3)
    position[..., 2] = position[..., 2].abs() + 2.0
    fins = len(model.vehicle.fins)
    size = model.actuators.size + (fins if model.using("steer") else 0)
    inputs = Inputs(
        0.4 * draw(model.actuators.size), 0.2 * draw(fins) if fins else None, 15 + draw(), 5 + draw()
    )
    quaternion = torch.nn.functional.normalize(draw(4), dim=-1)
    return position, quaternion, 0.5 * draw(6), 10.0 * draw(size), 30.0 + 5.0 * draw(), inputs


def thetas_of(model, names):
    order = [model.effect_names.index(n) for n in names]
    return {f"model.effects.{k}.theta": model.members[k].theta.detach() for k in order}


def by_torch(model, what, points, thetas):
    """Return the same by `vmap` and `jacrev`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(point_slopes, "compiled_slopes", lambda *given: None)
        return differentiate(OperatingPoint(model), what, points, thetas, 64)


def same(mine, theirs):
    assert mine.shape == theirs.shape
    assert bool(torch.isfinite(theirs).all())
    size = theirs.abs().amax(dim=(0, 1))
    # Column by column: the smallest counts as much as the largest.
    torch.testing.assert_close(mine / size.clamp_min(1e-6), theirs / size.clamp_min(1e-6), rtol=0, atol=1e-9)


@pytest.mark.parametrize("group", range(len(GROUPS)))
def test_slopes_are_those_of_torch(always, group):
    # All effects at once, differentiated by those of one group and by all that the state is.
    model = model_with(NAMES)
    points, thetas = moments(model, 6), thetas_of(model, GROUPS[group])
    mine = compiled_slopes(OperatingPoint(model), "rate", points, thetas)
    assert mine is not None
    same(mine, by_torch(model, "rate", points, thetas))


@pytest.mark.parametrize("what", ["sense", "sense and rate"])
def test_what_sensors_report_is_differentiated_alike(always, what):
    model = model_with(NAMES)
    names = [str(e.name) for e in model.using("sense")]
    assert len(names) > 3
    points, thetas = moments(model, 6), thetas_of(model, names)
    # The acceleration's code is known already, and not taken for it.
    assert compiled_slopes(OperatingPoint(model), "rate", points, thetas) is not None
    mine = compiled_slopes(OperatingPoint(model), what, points, thetas)
    assert mine is not None
    same(mine, by_torch(model, what, points, thetas))


def test_slopes_of_subnetworks_and_of_a_unit_wrench(always):
    model = model_with(["ocean_current", "added_mass"], "polynomial")
    whole, _ = pushed(model, [])
    points, thetas = moments(whole, 6), thetas_of(whole, [PUSH])
    thetas |= {f"model.damping.{n}": p.detach() for n, p in model.damping.named_parameters()}
    mine = compiled_slopes(OperatingPoint(whole), "rate", points, thetas)
    assert mine is not None
    same(mine, by_torch(whole, "rate", points, thetas))
    # A unit wrench accelerates by a column of the inverse inertia, which is symmetric.
    column = 12 + points[3].shape[-1]
    unit = mine[..., column : column + 6]
    torch.testing.assert_close(unit, unit.mT, rtol=0, atol=1e-12)


def test_slopes_are_those_of_differences(always):
    model = model_with(["ocean_current", "quadratic_damping"])
    points, thetas = moments(model, 4), thetas_of(model, ["ocean_current"])
    mine = compiled_slopes(OperatingPoint(model), "rate", points, thetas)
    module, step, zero = OperatingPoint(model), 1e-6, torch.zeros(3, dtype=DOUBLE)
    position, quaternion, nu, thrust, time = (x[0] for x in points[:5])
    inputs = Inputs(*(None if x is None else x[0] for x in vars(points[5]).values()))
    with torch.no_grad():
        for k in range(6):
            moved = step * torch.eye(6, dtype=DOUBLE)[k]
            ends = [
                module("rate", position, quaternion, zero, nu + s * moved, thrust, time, inputs)
                for s in (1, -1)
            ]
            found = (ends[0] - ends[1]) / (2 * step)
            torch.testing.assert_close(mine[..., 6 + k], found, rtol=1e-6, atol=1e-6)


def test_many_moments_share_the_threads(always, monkeypatch):
    model = model_with(["ocean_current"])
    points, thetas = moments(model, 203), thetas_of(model, ["ocean_current"])
    alone = compiled_slopes(OperatingPoint(model), "rate", points, thetas)
    monkeypatch.setattr(slopes_module, "_threads", lambda count: 3)
    together = compiled_slopes(OperatingPoint(model), "rate", points, thetas)
    assert torch.equal(alone, together)


def test_a_copy_is_not_traced_again_and_another_vehicle_is_not_taken_for_it(always, monkeypatch):
    model = model_with(["ocean_current", "added_mass"])
    points, thetas = moments(model, 6), thetas_of(model, ["ocean_current"])
    compiled_slopes(OperatingPoint(model), "rate", points, thetas)
    # By other parameters it is another function.
    others = thetas_of(model, ["added_mass"])
    mine = compiled_slopes(OperatingPoint(model), "rate", points, others)
    same(mine, by_torch(model, "rate", points, others))
    traced = []
    trace = slopes_module.trace
    monkeypatch.setattr(slopes_module, "trace", lambda *given: traced.append(1) or trace(*given))
    copy = model.rebuilt(model.copied_effects())
    with torch.no_grad():
        copy.effect("added_mass").theta.mul_(1.3)
    mine = compiled_slopes(OperatingPoint(copy), "rate", points, thetas_of(copy, ["ocean_current"]))
    assert not traced
    same(mine, by_torch(copy, "rate", points, thetas_of(copy, ["ocean_current"])))
    other = GreyBox(small_vehicle(buoyancy=520.0, mass=61.0), model.copied_effects())
    mine = compiled_slopes(OperatingPoint(other), "rate", points, thetas)
    same(mine, by_torch(other, "rate", points, thetas))
    # Among a vehicle's numbers those that are nought or one are part of the code.
    assert float(other.known_buoyancy) == 520.0
    other.known_buoyancy.fill_(1.0)
    same(
        compiled_slopes(OperatingPoint(other), "rate", points, thetas),
        by_torch(other, "rate", points, thetas),
    )
    assert traced


def test_torch_finds_them_where_code_is_not_worth_it_or_not_possible(always, monkeypatch):
    model = model_with(["ocean_current"])
    points, thetas = moments(model, 6), thetas_of(model, ["ocean_current"])
    ask = lambda: compiled_slopes(OperatingPoint(model), "rate", points, thetas)  # noqa: E731
    assert ask() is not None
    with monkeypatch.context() as patch:
        patch.setattr(slopes_module, "WORTH", WORTH)
        assert ask() is None
    with monkeypatch.context() as patch:
        patch.setattr(slopes_module, "MOST_PARAMETERS", 2)
        assert ask() is None
    with monkeypatch.context() as patch:
        patch.setenv("AUVNN_ENGINE", "torch")
        assert ask() is None
    with monkeypatch.context() as patch:
        patch.setenv("AUVNN_CC", "none")
        patch.setattr(slopes_module, "_MADE", KnownCode(16))
        assert ask() is None
    assert ask() is not None
    handle = model.members[0].register_forward_hook(lambda *given: None)
    assert ask() is None
    handle.remove()


def test_code_that_says_something_else_than_torch_is_not_used(always, monkeypatch):
    model = model_with(["ocean_current"])
    points, thetas = moments(model, 6), thetas_of(model, ["ocean_current"])
    right = slopes_module._by_torch
    monkeypatch.setattr(slopes_module, "_by_torch", lambda *given: right(*given) * (1 + 1e-7))
    assert compiled_slopes(OperatingPoint(model), "rate", points, thetas) is None
    # And not tried again.
    monkeypatch.setattr(slopes_module, "_by_torch", right)
    assert compiled_slopes(OperatingPoint(model), "rate", points, thetas) is None
