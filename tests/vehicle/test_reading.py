"""What is read is what was written: shorthands, defaults, frames, round trips."""

from __future__ import annotations

import copy
import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from auvnn.config import read_yaml, write_yaml
from auvnn.errors import AuvnnError, ModelError
from auvnn.vehicle import DEFAULT_UNCERTAINTY, ThrustTable, Vehicle, builtin_vehicles, load_vehicle
from tests.vehicle.vehicle_samples import minimal, sample


def test_every_key_arrives() -> None:
    data = sample()
    vehicle = Vehicle.from_dict(data)
    for key in (
        "name",
        "gravity",
        "water_density",
        "mass",
        "buoyancy",
        "length",
        "reference_voltage",
        "source",
    ):
        assert getattr(vehicle, key) == data[key]
    for key in ("center_of_gravity", "inertia", "added_mass", "linear_damping", "quadratic_damping"):
        np.testing.assert_array_equal(getattr(vehicle, key), data[key])
    assert vehicle.effects == data["effects"]
    assert vehicle.uncertainty == DEFAULT_UNCERTAINTY | data["uncertainty"]
    assert vehicle.warnings == ()
    first, second = vehicle.thrusters
    np.testing.assert_allclose(first.direction, np.array([2.0, 0.5, 0.25]) / 4.3125**0.5, rtol=1e-15)
    assert (first.max_forward, first.max_reverse, first.handedness) == (90.0, 72.0, -1)
    assert isinstance(second.curve, ThrustTable)
    assert (second.max_forward, second.max_reverse, second.handedness) == (50.0, 40.0, 1)
    np.testing.assert_array_equal(vehicle.damping_elements[0].axes[:, 0], [0.8, 0.6, 0.0])
    assert vehicle.fins[0].area == 0.01
    assert (vehicle.n_thrusters, vehicle.n_fins, vehicle.has_damping) == (2, 1, True)
    assert vehicle.weight == pytest.approx(62.0 * 9.81)


def test_what_is_not_stated_is_assumed_and_said() -> None:
    vehicle = Vehicle.from_dict(minimal())
    assert vehicle.gravity == 9.81
    assert vehicle.water_density == 1025.0
    assert vehicle.buoyancy == vehicle.weight
    assert vehicle.length**3 * 1025.0 == pytest.approx(50.0)
    assert not vehicle.has_damping
    assert vehicle.linear_damping is None
    assert vehicle.uncertainty == DEFAULT_UNCERTAINTY
    for word in ("gravity", "water_density", "buoyancy", "length", "added_mass", "inertia"):
        assert [w for w in vehicle.warnings if word in w and "assumed" in w], word
    # What is not there needs no uncertainty, and what is exact by default no warning.
    assert not [w for w in vehicle.warnings if "damping" in w or "for mass" in w]


def test_uncertainty_of_drag_elements_is_asked_for_too() -> None:
    element = {"position": [0, 0, 0], "quadratic": [1.0] * 6}
    warnings = Vehicle.from_dict(minimal() | {"damping_elements": [element]}).warnings
    assert [w for w in warnings if "quadratic_damping: 0.2 assumed" in w]
    assert not [w for w in warnings if "linear_damping" in w]


def test_diagonals_are_matrices() -> None:
    vehicle = Vehicle.from_dict(minimal() | {"linear_damping": [1, 2, 3, 4, 5, 6]})
    np.testing.assert_array_equal(vehicle.inertia, np.diag([2.0, 3.0, 4.0]))
    np.testing.assert_array_equal(vehicle.added_mass, np.diag([20.0, 40.0, 60.0, 1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(vehicle.linear_damping, np.diag([1.0, 2, 3, 4, 5, 6]))


def test_rounded_asymmetry_is_averaged_away() -> None:
    matrix = np.array(sample()["added_mass"])
    matrix[1, 5] += 0.001
    vehicle = Vehicle.from_dict(sample(added_mass=matrix.tolist()))
    np.testing.assert_array_equal(vehicle.added_mass, vehicle.added_mass.T)
    assert vehicle.added_mass[1, 5] == pytest.approx(4.0005)


def test_numpy_arrays_are_taken() -> None:
    data = sample(added_mass=np.array(sample()["added_mass"]), mass=np.float64(62.0))
    assert Vehicle.from_dict(data) == Vehicle.from_dict(sample())


@pytest.mark.parametrize("data", [sample(), minimal()], ids=["full", "minimal"])
def test_round_trip_is_exact(data: dict[str, Any], tmp_path: Path) -> None:
    vehicle = Vehicle.from_dict(data)
    again = Vehicle.from_dict(vehicle.to_dict())
    assert again == vehicle
    assert again.to_dict() == vehicle.to_dict()
    json.dumps(vehicle.to_dict(), allow_nan=False)
    assert load_vehicle(write_yaml(tmp_path / "v.yaml", vehicle.to_dict())) == vehicle


@pytest.mark.parametrize("name", builtin_vehicles())
def test_round_trip_of_builtin_vehicles_is_exact(name: str, tmp_path: Path) -> None:
    vehicle = load_vehicle(name)
    assert load_vehicle(write_yaml(tmp_path / "v.yaml", vehicle.to_dict())) == vehicle


def test_a_different_vehicle_is_not_equal() -> None:
    vehicle = Vehicle.from_dict(sample())
    data = sample()
    data["fins"][0]["area"] = 0.0100001
    assert Vehicle.from_dict(data) != vehicle
    assert vehicle != "sample"
    assert hash(vehicle) == hash(Vehicle.from_dict(sample()))


def test_reading_leaves_its_input_alone_and_shares_nothing() -> None:
    data = sample()
    vehicle = Vehicle.from_dict(data)
    assert data == sample()
    vehicle.to_dict()["effects"]["ocean_current"]["v_north"] = 9.0
    assert vehicle.effects["ocean_current"]["v_north"] == 0.2
    data["effects"]["ocean_current"]["v_north"] = 9.0
    assert vehicle.effects["ocean_current"]["v_north"] == 0.2


def test_numbers_cannot_be_changed() -> None:
    vehicle = Vehicle.from_dict(sample())
    with pytest.raises(ValueError):
        vehicle.added_mass[0, 0] = 1.0
    with pytest.raises(ValueError):
        vehicle.thrusters[0].position[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        vehicle.mass = 3.0  # pyright: ignore
    heavier = dataclasses.replace(vehicle, mass=70.0)
    assert (heavier.mass, vehicle.mass) == (70.0, 62.0)


def test_flu_file_describes_the_same_vehicle() -> None:
    # By hand: in FLU, y and z components change sign, of polar and axial vectors alike, and a matrix
    # entry does where exactly one of its two indices is a y or a z component.
    sign = [1, -1, -1, 1, -1, -1]
    data = sample(frame="FLU", effects={})
    for key in ("inertia", "added_mass", "linear_damping", "quadratic_damping"):
        data[key] = [[x * sign[i] * sign[j] for j, x in enumerate(row)] for i, row in enumerate(data[key])]

    def turn(vector: list[float]) -> list[float]:
        return [x * s for x, s in zip(vector, sign[:3], strict=True)]

    for key in ("center_of_gravity", "center_of_buoyancy"):
        data[key] = turn(data[key])
    for thruster in data["thrusters"]:
        thruster["position"], thruster["direction"] = turn(thruster["position"]), turn(thruster["direction"])
    for fin in data["fins"]:
        fin["position"], fin["axis"] = turn(fin["position"]), turn(fin["axis"])
    for element in data["damping_elements"]:
        element["position"] = turn(element["position"])
        columns = [turn(list(c)) for c in zip(*element["axes"], strict=True)]
        element["axes"] = [list(row) for row in zip(*columns, strict=True)]
    flu, frd = Vehicle.from_dict(data), Vehicle.from_dict(sample(effects={}))
    assert flu == frd
    assert "-0.0," not in json.dumps(flu.to_dict())


def test_flu_up_is_frd_down() -> None:
    data = minimal() | {"frame": "FLU", "center_of_gravity": [0.0, 0.0, -0.05]}
    data["thrusters"] = [
        {"position": [0, 0.3, 0.1], "direction": [0, 0, 1], "max_forward": 9, "max_reverse": 9}
    ]
    vehicle = Vehicle.from_dict(data)
    assert vehicle.center_of_gravity[2] == 0.05
    np.testing.assert_array_equal(vehicle.thrusters[0].position, [0, -0.3, -0.1])
    np.testing.assert_array_equal(vehicle.thrusters[0].direction, [0, 0, -1])


def test_effects_of_a_flu_file_are_not_turned_and_it_says_so() -> None:
    vehicle = Vehicle.from_dict(minimal() | {"frame": "FLU", "effects": {"constant_force": {"Y": 1.0}}})
    assert vehicle.effects == {"constant_force": {"Y": 1.0}}
    assert [w for w in vehicle.warnings if "FLU" in w and "FRD" in w]


DOUBTS = [
    ({"center_of_gravity": [0, 0, -0.05]}, "turns over"),
    ({"buoyancy": 50.0}, "given in N"),
    ({"water_density": 1.025}, "not that of water"),
    ({"gravity": 1.62}, "gravity"),
    ({"inertia": [2e6, 3e6, 4e6]}, "kg m2"),
    ({"center_of_gravity": [0, 0, 20.0]}, "metres"),
    ({"added_mass": [[20, 0, 0, 0, 0, 0], [0, 40, 0, 0, 0, 11.5], [0, 0, 60, 0, 0, 0], [0, 0, 0, 1, 0, 0],
                     [0, 0, 0, 0, 2, 0], [0, 11.5, 0, 0, 0, 3]]}, "semi-definite"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), DOUBTS, ids=[d[1] for d in DOUBTS])
def test_what_is_unlikely_is_warned_about(change: dict[str, Any], words: str) -> None:
    full = minimal() | {"gravity": 9.81, "water_density": 1000.0, "buoyancy": 490.5, "length": 1.0}
    assert not [w for w in Vehicle.from_dict(full).warnings if words in w]
    assert [w for w in Vehicle.from_dict(full | change).warnings if words in w]


def test_rigid_body_inertia_gives_the_kinetic_energy_of_a_cloud_of_points() -> None:
    # Six point masses in +-pairs about the centre of gravity: an inertia known without any formula of ours.
    arms = np.array([[0.5, 0.1, 0.0], [0.0, 0.6, 0.2], [0.1, 0.0, 0.7]])
    cg = np.array([0.1, -0.2, 0.3])
    points, mass = np.concatenate([arms, -arms]), 2.0
    inertia = sum(mass * (p @ p * np.eye(3) - np.outer(p, p)) for p in points)
    data = minimal() | {"mass": 12.0, "center_of_gravity": cg, "inertia": inertia}
    rigid = Vehicle.from_dict(data).rigid_body
    nu = np.array([0.3, -0.5, 0.7, 0.2, 0.4, -0.6])
    speeds = nu[:3] + np.cross(nu[3:], points + cg)
    assert nu @ rigid @ nu == pytest.approx(mass * (speeds**2).sum(), rel=1e-12)


def test_total_inertia_is_the_sum() -> None:
    vehicle = Vehicle.from_dict(sample())
    np.testing.assert_array_equal(vehicle.inertia_matrix, vehicle.rigid_body + vehicle.added_mass)


def test_vehicles_are_found_by_name_file_and_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    vehicle = Vehicle.from_dict(sample())
    path = write_yaml(tmp_path / "my-rov.yaml", vehicle.to_dict())
    assert load_vehicle(path) == load_vehicle(str(path)) == vehicle
    folder = tmp_path / "better"
    extra = {"actuation": "thrusters", "damping_subnetworks": {"form": "mlp"}}
    write_yaml(folder / "model.yaml", vehicle.to_dict() | extra)
    assert load_vehicle(folder) == vehicle
    monkeypatch.chdir(tmp_path)
    write_yaml(tmp_path / "rov95" / "model.yaml", vehicle.to_dict())
    assert load_vehicle("rov95").name == "rov95"
    assert load_vehicle("./rov95") == vehicle


def test_other_keys_are_left_alone_only_where_asked() -> None:
    data = sample() | {"actuation": "wrench"}
    assert Vehicle.from_dict(data, also=["actuation"]) == Vehicle.from_dict(sample())
    with pytest.raises(ModelError, match="no vehicle key called 'actuation'"):
        Vehicle.from_dict(data)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("rov59", ("Did you mean 'rov95'", "bluerov2_heavy", "path of a YAML file")),
        ("", ("bluerov2",)),
        ("nowhere/my.yaml", ("no such file", "rov95")),
        ("my.yaml", ("no such file", "rov95")),
        ("../nowhere", ("no such file",)),
        ("a\nb", ("a\\nb", "no path")),
        ("x\0y", ("no path",)),
        ("x" * 5000, ("name a file", "rov95")),
    ],
)
def test_unknown_vehicle_says_what_there_is(name: str, words: tuple[str, ...]) -> None:
    with pytest.raises(AuvnnError) as refused:
        load_vehicle(name)
    assert "\n" not in str(refused.value)
    for word in words:
        assert word in str(refused.value)


def test_folder_without_a_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"model\.yaml"):
        load_vehicle(tmp_path)


def test_message_names_the_file(tmp_path: Path) -> None:
    path = write_yaml(tmp_path / "heavy.yaml", sample(mass=-1.0))
    with pytest.raises(ModelError, match=r"heavy\.yaml: mass is -1\.0"):
        load_vehicle(path)


def test_a_typed_in_file_reads_as_meant(tmp_path: Path) -> None:
    path = tmp_path / "typed.yaml"
    path.write_text(
        "name: no\nmass: 5e1  # kg\ncenter_of_gravity: [0, 0, 2e-2]\ncenter_of_buoyancy: [0, 0, 0]\n"
        "inertia: [2, 3, 4]\nadded_mass: [020, 40, 60, 1, 2, 3]\n"
    )
    vehicle = load_vehicle(path)
    assert (vehicle.name, vehicle.mass, vehicle.center_of_gravity[2]) == ("no", 50.0, 0.02)
    assert vehicle.added_mass[0, 0] == 20.0
    assert read_yaml(path)["name"] == "no"


def test_deepcopy_keeps_the_numbers() -> None:
    vehicle = Vehicle.from_dict(sample())
    assert copy.deepcopy(vehicle) == vehicle
