"""A vehicle that is built in Python is checked at once, and says its numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import auvnn
from auvnn import Vehicle
from auvnn.errors import ModelError
from auvnn.models import as_model
from auvnn.vehicle import Thruster, builtin_vehicles, load_vehicle

THRUSTER = {"position": [0, 0.1, 0], "direction": [1, 0, 0], "max_forward": 40, "max_reverse": 30}


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return Vehicle(
        "tug", 9.81, 1025.0, 60, 600.0, 1.0, [0, 0, 0.05], [0, 0, 0], [1, 1, 1], [10, 12, 14, 1, 1, 1],
        linear_damping=[5] * 6, thrusters=[THRUSTER],
    )  # fmt: skip


def test_diagonals_stand_for_matrices_and_mappings_for_parts(vehicle):
    np.testing.assert_array_equal(vehicle.inertia, np.eye(3))
    np.testing.assert_array_equal(vehicle.added_mass, np.diag([10, 12, 14, 1, 1, 1]))
    assert isinstance(vehicle.thrusters[0], Thruster) and not vehicle.inertia.flags.writeable
    assert Vehicle.from_dict(vehicle.to_dict()) == vehicle
    surge = as_model(vehicle)([0] * 6, [0] * 6, [1.0])[0]
    # Newton: 40 N on 60 kg and 10 kg of added mass; the couple about y is small beside it.
    assert float(surge) == pytest.approx(40 / 70, rel=0.2)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"inertia": [1, 1, -1]}, r"inertia\[2\]\[2\]"),
        ({"inertia": [1, 1]}, "3 x 3"),
        ({"inertia": [1, 1, 5]}, "sum of the others"),
        ({"inertia": np.ones((3, 3))}, "positive definite"),
        ({"mass": -3}, "must be positive"),
        ({"mass": "60 kg"}, "written as text"),
        ({"added_mass": [-1] * 6}, "wrong sign"),
        ({"linear_damping": [-1] * 6}, "wrong sign"),
        ({"center_of_gravity": 3}, "3 numbers"),
        ({"thrusters": "x"}, "not a list"),
        ({"thrusters": [{**THRUSTER, "direction": [0, 0, 0]}]}, "direction"),
        ({"uncertainty": {"mas": 0.1}}, "Did you mean 'mass'"),
        ({"name": ""}, "name"),
    ],
)
def test_what_is_not_physical_is_refused_in_one_line(vehicle, change, words):
    with pytest.raises(ModelError, match=words) as refused:
        replace(vehicle, **change)
    assert "\n" not in str(refused.value) and not isinstance(refused.value, np.linalg.LinAlgError)


@pytest.mark.parametrize("name", builtin_vehicles())
def test_every_vehicle_says_its_numbers(name):
    vehicle = load_vehicle(name)
    text = vehicle.summary()
    assert repr(text) == str(text) and f"{vehicle.mass:.6g} kg" in text and str(vehicle.name) in text
    assert len(repr(vehicle)) < 200 and name in repr(vehicle) and "<table" in vehicle._repr_html_()


def test_a_summary_says_which_way_it_floats_and_hangs(vehicle):
    assert "floats up" in vehicle.summary() and "upright" in vehicle.summary()
    heavy = replace(vehicle, buoyancy=500.0, center_of_gravity=[0, 0, -0.05])
    assert "sinks" in heavy.summary() and "not upright" in heavy.summary()
    assert "X 40" in vehicle.summary()
    assert auvnn.load("rov95").vehicle.summary().startswith("rov95")
