"""Every refusal names the file, the field, the value and the cure, on one line."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

from auvnn.errors import ModelError
from auvnn.vehicle import Vehicle
from tests.vehicle.vehicle_samples import minimal, sample

NAN, INF = math.nan, math.inf
MATRIX = sample()["added_mass"]


def changed(path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    data = sample()
    place: Any = data
    for key in path[:-1]:
        place = place[key]
    if value is KeyError:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return data


def with_entry(matrix: list[list[float]], i: int, j: int, value: float) -> list[list[float]]:
    result = copy.deepcopy(matrix)
    result[i][j] = value
    return result


QUADRATIC, LINEAR = sample()["quadratic_damping"], sample()["linear_damping"]
FULL_ELEMENT = sample()["damping_elements"][0]

CASES: list[tuple[str, tuple[Any, ...], Any, tuple[str, ...]]] = [
    ("unknown key", ("maas",), 3.0, ("maas", "Did you mean 'mass'", "There are: ")),
    ("key that is no word", (3,), 3.0, ("3", "There are: ")),
    ("missing", ("mass",), KeyError, ("mass is missing", "add a line")),
    ("empty", ("inertia",), None, ("inertia is missing", "add a line")),
    ("missing centre", ("center_of_gravity",), KeyError, ("center_of_gravity is missing",)),
    ("text as number", ("mass",), "62 kg", ("mass is '62 kg'", "text", "quotes")),
    ("boolean as number", ("mass",), True, ("mass is True", "not a number")),
    ("nan", ("mass",), NAN, ("mass is nan", "not a finite number", "SI")),
    ("inf", ("buoyancy",), INF, ("buoyancy is inf", "not a finite number")),
    ("nan in a vector", ("center_of_gravity", 2), NAN, ("center_of_gravity[2] is nan", "finite")),
    ("text in a matrix", ("added_mass", 1, 1), "50", ("added_mass[1][1] is '50'", "quotes")),
    ("huge integer", ("mass",), 10**400, ("mass is 1000", "beyond any vehicle")),
    ("negative mass", ("mass",), -62.0, ("mass is -62.0", "must be positive")),
    ("zero buoyancy", ("buoyancy",), 0.0, ("buoyancy is 0.0", "must be positive")),
    ("zero density", ("water_density",), 0, ("water_density is 0", "must be positive")),
    ("negative gravity", ("gravity",), -9.81, ("gravity is -9.81", "must be positive")),
    ("zero length", ("length",), 0.0, ("length is 0.0", "must be positive")),
    ("zero voltage", ("reference_voltage",), 0.0, ("reference_voltage is 0.0", "must be positive")),
    ("frame", ("frame",), "ENU", ("frame is 'ENU'", "FRD", "FLU")),
    ("empty name", ("name",), " ", ("name is ' '", "printable")),
    ("name with lines", ("name",), "a\nb", ("name is 'a\\nb'", "printable")),
    ("name as number", ("name",), 7, ("name is 7", "not a text", "quotes")),
    ("short vector", ("center_of_gravity",), [0.0, 0.1], ("center_of_gravity is [0.0, 0.1]", "3 numbers")),
    ("scalar as vector", ("center_of_gravity",), 0.1, ("center_of_gravity is 0.1", "lists")),
    ("short diagonal", ("added_mass",), [1.0] * 5, ("added_mass", "6 x 6 nor 6")),
    ("ragged matrix", ("inertia",), [[1.0], [0, 1.0, 0], [0, 0, 1.0]], ("inertia", "3 x 3 numbers")),
    ("zero inertia", ("inertia",), [0.0, 3.0, 3.0], ("inertia[0][0] (I_xx) is 0", "must be positive")),
    (
        "asymmetric",
        ("inertia",),
        with_entry(sample()["inertia"], 0, 1, 0.9),
        ("inertia is not symmetric", "0.9"),
    ),
    (
        "indefinite inertia",
        ("inertia",),
        [[3.0, 9.0, 0.0], [9.0, 3.0, 0.0], [0.0, 0.0, 6.0]],
        ("not positive definite", "-6", "products of inertia"),
    ),
    ("triangle", ("inertia",), [1.0, 1.0, 9.0], ("1, 1, 9", "sum of the others")),
    (
        "added mass of the wrong sign",
        ("added_mass",),
        (-np.array(MATRIX)).tolist(),
        (
            "added_mass has the wrong sign",
            "X_udot",
            "turning every sign",
            "smallest eigenvalue of M_RB + M_A",
        ),
    ),
    (
        "wrong sign that leaves M positive definite",
        ("added_mass",),
        [-0.9, -0.9, -0.9, -0.1, -0.1, -0.1],
        ("wrong sign", "turning every sign"),
    ),
    ("one negative", ("added_mass",), [1, 1, -1, 0.1, 0.1, 0.1], ("added_mass[2][2] is -1", "turn the sign")),
    ("asymmetric added mass", ("added_mass",), with_entry(MATRIX, 1, 5, -4.0), ("not symmetric", "-4", "4")),
    (
        "indefinite mass",
        ("added_mass",),
        with_entry(with_entry(MATRIX, 0, 1, 900.0), 1, 0, 900.0),
        ("M_RB + M_A is not positive definite", "smallest eigenvalue of M_RB + M_A is -"),
    ),
    ("drag of the wrong sign", ("linear_damping",), [-1.0] * 6, ("wrong sign", "X_u", "turning every sign")),
    ("one negative drag", ("linear_damping", 2, 2), -30.0, ("linear_damping[2][2] is -30", "energy in w")),
    (
        "linear damping that adds energy",
        ("linear_damping",),
        with_entry(LINEAR, 0, 4, 50.0),
        ("linear_damping adds energy", "u=", "q=", "off-diagonal"),
    ),
    (
        "negative quadratic",
        ("quadratic_damping", 5, 5),
        -9.0,
        ("quadratic_damping[5][5] is -9", "energy in r"),
    ),
    (
        "quadratic damping that adds energy",
        ("quadratic_damping",),
        with_entry(QUADRATIC, 1, 5, -400.0),
        ("quadratic_damping adds energy", "v=", "r=", "off-diagonal"),
    ),
    ("elements as mapping", ("damping_elements",), {}, ("damping_elements is {}", "not a list")),
    (
        "element key",
        ("damping_elements", 0, "drag"),
        1.0,
        ("damping_elements[0]", "no damping element key", "drag"),
    ),
    ("negative element", ("damping_elements", 0, "linear", 3), -1.0, ("linear is", "adds energy")),
    ("axes", ("damping_elements", 0, "axes", 0, 0), 2.0, ("axes is", "not a rotation", "columns")),
    (
        "left-handed axes",
        ("damping_elements", 0, "axes"),
        np.diag([1, 1, -1.0]).tolist(),
        ("not a rotation",),
    ),
    (
        "no position",
        ("damping_elements", 0, "position"),
        KeyError,
        ("damping_elements[0]: position is missing",),
    ),
    ("no direction", ("thrusters", 0, "direction"), [0, 0, 0], ("thrusters[0]: direction", "not zero")),
    ("negative thrust", ("thrusters", 0, "max_forward"), -90.0, ("max_forward is -90.0", "must be positive")),
    ("zero thrust", ("thrusters", 0, "max_forward"), 0.0, ("max_forward is 0.0", "must be positive")),
    ("negative reverse", ("thrusters", 0, "max_reverse"), -72.0, ("max_reverse is -72.0", "without a sign")),
    ("no limit", ("thrusters", 0, "max_reverse"), KeyError, ("thrusters[0]: max_reverse is missing",)),
    ("curve", ("thrusters", 0, "curve"), "cubic", ("curve is 'cubic'", "quadratic", "command")),
    ("handedness", ("thrusters", 0, "handedness"), 2, ("handedness is 2", "1, -1")),
    ("thruster as text", ("thrusters", 0), "T200", ("thrusters[0]: is 'T200'", "mapping")),
    ("misspelt thruster key", ("thrusters", 0, "max_foward"), 1.0, ("Did you mean 'max_forward'",)),
    ("commands fall", ("thrusters", 1, "curve", "command"), [1, 0.1, -0.1, -1], ("command", "not increase")),
    ("command twice", ("thrusters", 1, "curve", "command"), [-1, 0, 0, 1], ("command", "each command once")),
    ("commands in us", ("thrusters", 1, "curve", "command"), [1100, 1475, 1525, 1900], ("[-1, 1]", "scale")),
    ("uneven table", ("thrusters", 1, "curve", "thrust"), [-1.0, 1.0], ("2 numbers for 4 commands",)),
    ("table backwards", ("thrusters", 1, "curve", "thrust"), [50, 0, 0, -40], ("positive commands", "signs")),
    ("table of one", ("thrusters", 1, "curve"), {"command": [0.0], "thrust": [1.0]}, ("at least two",)),
    (
        "limit against table",
        ("thrusters", 1, "max_forward"),
        90.0,
        ("the curve reaches 50 N", "one of the two"),
    ),
    ("fin area", ("fins", 0, "area"), 0.0, ("fins[0]: area is 0.0", "must be positive")),
    ("fin slope", ("fins", 0, "lift_slope"), -3.0, ("lift_slope is -3.0", "must be positive")),
    ("stall in degrees", ("fins", 0, "stall"), 15.0, ("stall is 15.0", "radians")),
    ("fin axis", ("fins", 0, "axis"), [0, 0, 0], ("axis is [0, 0, 0]", "not zero")),
    ("fin axis along x", ("fins", 0, "axis"), [1, 0, 0], ("axis is [1, 0, 0]", "along x")),
    ("uncertainty group", ("uncertainty", "aded_mass"), 0.1, ("uncertainty", "Did you mean 'added_mass'")),
    ("negative uncertainty", ("uncertainty", "inertia"), -0.1, ("inertia is -0.1", "0.1 for 10 %")),
    ("uncertainty in per cent", ("uncertainty", "inertia"), 20, ("inertia is 20", "0.1 for 10 %")),
    ("uncertainty as number", ("uncertainty",), 0.1, ("uncertainty: is 0.1", "mapping")),
    ("effects as list", ("effects",), ["ocean_current"], ("effects: is ['ocean_current']", "pairs")),
    ("effect without names", ("effects", "ocean_current"), 0.2, ("ocean_current is 0.2", "parameter")),
    ("effect nan", ("effects", "ocean_current", "v_north"), NAN, ("ocean_current.v_north is nan", "finite")),
    ("source", ("source",), 2004, ("source is 2004", "not a text")),
]


@pytest.mark.parametrize(("path", "value", "words"), [c[1:] for c in CASES], ids=[c[0] for c in CASES])
def test_refusal_names_file_field_value_and_cure(path: tuple, value: Any, words: tuple[str, ...]) -> None:
    with pytest.raises(ModelError) as refused:
        Vehicle.from_dict(changed(path, value), "my.yaml")
    message = str(refused.value)
    assert message.startswith("my.yaml: ")
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("data", [None, [], "rov95", 3, [("name", "x")]])
def test_what_is_not_a_mapping_is_refused(data: Any) -> None:
    with pytest.raises(ModelError, match="not a mapping"):
        Vehicle.from_dict(data)


def test_shown_eigenvalue_is_that_of_the_total_inertia() -> None:
    # Mass 50 and added mass -60 in sway leave -10, and nothing else is smaller.
    data = minimal() | {"added_mass": [20.0, -60.0, 60.0, 1.0, 2.0, 3.0], "center_of_gravity": [0, 0, 0]}
    with pytest.raises(ModelError, match=r"smallest eigenvalue of M_RB \+ M_A is -10\b"):
        Vehicle.from_dict(data)


def test_velocity_named_for_linear_damping_does_add_energy() -> None:
    matrix = np.array(with_entry(LINEAR, 0, 4, 50.0))
    nu = _velocity_in(_message(linear_damping=matrix.tolist()))
    assert nu @ matrix @ nu < 0


def test_velocity_named_for_quadratic_damping_does_add_energy() -> None:
    matrix = np.array(with_entry(QUADRATIC, 1, 5, -400.0))
    nu = _velocity_in(_message(quadratic_damping=matrix.tolist()))
    assert nu @ matrix @ (np.abs(nu) * nu) < 0


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_quadratic_check_finds_the_limit_of_a_pair(factor: float) -> None:
    # With a = b = 1 on the diagonal, a^3 + b^3 - k a b^2 vanishes first at b = 2^(1/3) a, k = 3 / 2^(2/3).
    matrix = np.eye(6)
    matrix[0, 1] = -factor * 3 / 2 ** (2 / 3)
    data = minimal() | {"quadratic_damping": matrix.tolist()}
    if factor < 1:
        assert Vehicle.from_dict(data).quadratic_damping is not None
    else:
        with pytest.raises(ModelError, match="adds energy"):
            Vehicle.from_dict(data)


def _message(**changes: Any) -> str:
    with pytest.raises(ModelError) as refused:
        Vehicle.from_dict(sample(**changes))
    return str(refused.value)


def _velocity_in(message: str) -> np.ndarray:
    named = dict(word.strip(";").split("=") for word in message.split() if "=" in word)
    return np.array([float(named.get(name, 0.0)) for name in "uvwpqr"])
