"""Whatever is done to a valid vehicle, it loads or is refused in words: nothing else is raised."""

from __future__ import annotations

import datetime
import math
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from auvnn.errors import ConfigError, InputError, ModelError
from auvnn.vehicle import Vehicle, load_vehicle
from tests.vehicle.vehicle_samples import sample

JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.sampled_from([10**400, -(10**400), 2**63, 0, 1, -1]),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e-13, 1e12, -1e12, 1e308, -1.0]),
    st.text(max_size=8),
    st.sampled_from(["quadratic", "FLU", "1.0", "${oc.env:HOME}", "_target_", "a\nb", "\x00", "🐟"]),
    st.lists(st.floats(-10, 10), max_size=7),
    st.lists(st.lists(st.floats(-10, 10), min_size=6, max_size=6), min_size=6, max_size=6),
    st.lists(st.lists(st.floats(-10, 10), min_size=3, max_size=3), min_size=3, max_size=3),
    st.dictionaries(st.text(max_size=5), st.floats(), max_size=3),
    st.sampled_from(
        [datetime.date(2024, 1, 1), b"bytes", {1, 2}, (1.0, 2.0, 3.0), 3 + 4j, object(), [[]], [{}]]
    ),
    st.sampled_from(
        [np.nan * np.ones(3), np.eye(6), np.eye(3), np.zeros((2, 2)), np.array("x"), np.float32(1)]
    ),
)


def paths(data: Any, prefix: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of everything in nested data."""
    if isinstance(data, dict):
        children = data.items()
    elif isinstance(data, list):
        children = enumerate(data)
    else:
        return [prefix]
    own = [prefix] if prefix else []
    return own + [p for key, value in children for p in paths(value, (*prefix, key))]


@st.composite
def mutated(draw: st.DrawFn) -> dict[str, Any]:
    """Draw a valid vehicle with one to four changes anywhere in it."""
    data = sample()
    for _ in range(draw(st.integers(1, 4))):
        *way, last = draw(st.sampled_from(paths(data)))
        place: Any = data
        for key in way:
            place = place[key]
        kind = draw(st.sampled_from(["replace", "delete", "add", "scale", "negate", "repeat"]))
        value = place[last]
        if kind == "replace":
            place[last] = draw(JUNK)
        elif kind == "delete":
            del place[last]
        elif kind == "add" and isinstance(place, dict):
            place[draw(st.one_of(st.text(max_size=6), st.sampled_from([1, None, (1, 2), "__class__"])))] = (
                draw(JUNK)
            )
        elif kind == "scale" and isinstance(value, float):
            place[last] = value * 10.0 ** draw(st.integers(-30, 30))
        elif kind == "negate" and isinstance(value, float):
            place[last] = -value
        elif kind == "repeat" and isinstance(place, list):
            place.insert(last, value)
    return data


@settings(max_examples=120, deadline=None)
@given(mutated())
def test_a_changed_vehicle_loads_or_is_refused_in_words(data: dict[str, Any]) -> None:
    try:
        vehicle = Vehicle.from_dict(data, "fuzz.yaml")
    except (ModelError, ConfigError) as error:
        assert str(error).startswith("fuzz.yaml: ")
        assert "\n" not in str(error)
        assert len(str(error)) < 1000
        return
    for matrix in (vehicle.inertia_matrix, vehicle.inertia, vehicle.added_mass):
        assert np.isfinite(matrix).all()
        np.testing.assert_array_equal(matrix, matrix.T)
    assert np.linalg.eigvalsh(vehicle.inertia)[0] > 0
    scale = np.sqrt(np.diag(vehicle.inertia_matrix))
    assert np.linalg.eigvalsh(vehicle.inertia_matrix / np.outer(scale, scale))[0] > 0
    assert vehicle.mass > 0
    assert vehicle.buoyancy > 0
    for thruster in vehicle.thrusters:
        assert abs(np.linalg.norm(thruster.direction) - 1) < 1e-12
        assert thruster.max_forward > 0
        assert thruster.max_reverse >= 0
    # What was accepted describes itself, and its description is accepted as the same.
    assert Vehicle.from_dict(vehicle.to_dict()) == vehicle


@settings(max_examples=300, deadline=None)
@given(JUNK)
def test_anything_but_a_vehicle_is_refused_in_words(junk: Any) -> None:
    try:
        Vehicle.from_dict(junk)
    except (ModelError, ConfigError) as error:
        assert "\n" not in str(error)
    else:
        raise AssertionError("junk passed for a vehicle")


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=40))
def test_any_name_is_found_or_refused_in_words(name: str) -> None:
    try:
        load_vehicle(name)
    except (ModelError, ConfigError, InputError) as error:
        assert "\n" not in str(error)
