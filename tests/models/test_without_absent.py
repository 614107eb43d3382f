"""A model without the effects that are at their nulls: the same motion, and the same model as long as they stay there."""

from __future__ import annotations

import gc
import weakref

import pytest
import torch

from auvnn.models import GreyBox
from tests.small_logs import small_vehicle


@pytest.fixture
def model():
    return GreyBox(small_vehicle()).with_effects(
        {"net_buoyancy": None, "ocean_current": {"v_north": 0.2, "v_east": 0.0}}
    )


def set_force(model, value):
    with torch.no_grad():
        model.effect("net_buoyancy").theta.fill_(value)


def test_it_is_the_same_model_while_the_same_effects_are_there(model):
    set_force(model, 0.0)
    lean = model.without_absent()
    assert lean.effect_names == ["ocean_current"]
    with torch.no_grad():
        model.effect("ocean_current").theta.mul_(2.0)
    assert model.without_absent() is lean
    assert lean.effect("ocean_current") is model.effect("ocean_current"), "values are shared, not copied"


def test_it_is_another_one_once_an_effect_comes_or_goes(model):
    set_force(model, 0.0)
    lean = model.without_absent()
    set_force(model, 3.0)
    assert model.without_absent() is model
    with torch.no_grad():
        model.effect("ocean_current").theta.zero_()
    assert model.without_absent().effect_names == ["net_buoyancy"]
    set_force(model, 0.0)
    assert model.without_absent().effect_names == []
    assert model.without_absent(["net_buoyancy"]).effect_names == ["net_buoyancy"]
    assert lean.effect_names == ["ocean_current"]


@pytest.mark.parametrize(("strength", "left"), [(0.0, []), (1e-9, ["bottom_proximity"])])
def test_a_form_without_an_amount_is_nothing(strength, left):
    near = {"bottom_proximity": {"strength": strength, "exponent": 2.0}}
    assert GreyBox(small_vehicle()).with_effects(near).without_absent().effect_names == left


def test_it_has_the_precision_and_the_subnetworks_that_the_model_has_now(model):
    set_force(model, 0.0)
    lean = model.without_absent()
    model.to(torch.float32)
    single = model.without_absent()
    assert single is not lean and single.known_mass.dtype == torch.float32
    model.damping = torch.nn.Identity()
    assert model.without_absent().damping is model.damping


def test_nothing_keeps_a_model_alive_that_nobody_holds(model):
    set_force(model, 0.0)
    seen = [weakref.ref(model.without_absent())]
    other = model.rebuilt(model.copied_effects())
    seen += [weakref.ref(other), weakref.ref(other.without_absent())]
    del other
    gc.collect()
    assert seen[0]() is not None and seen[1]() is None and seen[2]() is None
