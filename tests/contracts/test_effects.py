"""Every effect of the catalogue keeps the contract; a new one is tested by being there."""

from __future__ import annotations

import pytest

from auvnn.effects import EFFECTS
from auvnn.effects.inertia_factors import InertiaFactors
from auvnn.errors import ConfigError
from auvnn.testing import EFFECT_CHECKS
from auvnn.vehicle import builtin_vehicles, load_vehicle

# The moments of inertia are a nuisance of the fits, not a cause to be named, but an effect in all else.
KINDS = [*(EFFECTS.get(name) for name in EFFECTS.names()), InertiaFactors]
HEAVY = ("recovers", "has_right_gradient", "transforms")


@pytest.fixture(params=KINDS, ids=lambda kind: kind.name)
def kind(request):
    return request.param


@pytest.mark.parametrize("check", [name for name in EFFECT_CHECKS if name != "recovers"])
def test_the_contract_on_a_vehicle_with_everything(kind, check):
    EFFECT_CHECKS[check](kind)


@pytest.mark.parametrize("check", [name for name in EFFECT_CHECKS if name not in HEAVY])
def test_the_contract_under_a_commanded_wrench(kind, check):
    EFFECT_CHECKS[check](kind, actuation="wrench")


def test_parameters_come_back_from_data_of_the_surrogate(kind):
    vehicle = load_vehicle("rov95")
    # What the surrogate has not got (fins, a battery) the example vehicle has.
    EFFECT_CHECKS["recovers"](kind, *([] if kind.lacks(vehicle, "thrusters") else [vehicle]))


@pytest.mark.parametrize("name", builtin_vehicles())
def test_each_vanishes_at_its_null_in_every_vehicle_under_both_actuations(name):
    vehicle = load_vehicle(name)
    for actuation in ["wrench", *(["thrusters"] if vehicle.thrusters else [])]:
        for kind in KINDS:
            EFFECT_CHECKS["vanishes"](kind, vehicle, actuation)


def test_the_catalogue_knows_each_by_its_own_name():
    assert [EFFECTS.get(name).name for name in EFFECTS.names()] == EFFECTS.names()


def test_a_misspelt_effect_is_answered_with_the_right_one():
    with pytest.raises(
        ConfigError, match=r"no effect called 'ocean_curent'\. Did you mean 'ocean_current'\?"
    ):
        EFFECTS.get("ocean_curent")
