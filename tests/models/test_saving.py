"""Models on disk: nothing is lost, nothing damaged is read, and what a file says decides."""

from __future__ import annotations

import json

import pytest
import torch
import yaml

from auvnn.config import config_dir
from auvnn.damping.bank import DampingBank
from auvnn.effects import EFFECTS
from auvnn.errors import AuvnnError, ConfigError, InputError, ModelError
from auvnn.models import GreyBox, load, remove, save
from auvnn.testing import example_vehicle, make_scene
from auvnn.testing.scene import Predictor, together, typical_values
from auvnn.vehicle import builtin_vehicles, load_vehicle

DOUBLE = torch.float64


def predictions(model):
    with torch.no_grad():
        return together(Predictor(model)(make_scene(model.vehicle, model.actuation)))


@pytest.fixture
def model(bank):
    """Return a model with everything: all effects of the catalogue, and subnetworks of several forms."""
    vehicle = example_vehicle()
    values = {name: typical_values(EFFECTS.get(name), vehicle, "thrusters") for name in EFFECTS.names()}
    return GreyBox(vehicle, damping=bank).with_effects(values)


def test_a_model_comes_back_to_the_last_bit(model, tmp_path):
    expected = predictions(model)
    folder = model.save(tmp_path / "model")
    assert {p.name for p in folder.iterdir()} == {"model.yaml", "weights.safetensors", "manifest.json"}
    back = load(folder)
    assert torch.equal(predictions(back), expected)
    assert back.effect_names == model.effect_names and back.actuation == "thrusters"
    assert back.damping.describe() == model.damping.describe()
    for (name, a), (other, b) in zip(model.state_dict().items(), back.state_dict().items(), strict=True):
        assert name == other and torch.equal(a, b)
    again = back.save(tmp_path / "again")
    for name in ("model.yaml", "weights.safetensors", "manifest.json"):
        assert (again / name).read_bytes() == (folder / name).read_bytes()


@pytest.mark.parametrize(
    "form", ["mlp", "polynomial", "dissipative", "zero", {"form": "mlp", "hidden": 3, "inputs": "quadratic"}]
)
def test_every_form_of_subnetworks_comes_back(form, tmp_path):
    bank = DampingBank.from_description(form, seed=3)
    bank.set_scales(torch.randn(20, 6, dtype=DOUBLE), torch.randn(20, 6, dtype=DOUBLE))
    model = GreyBox(load_vehicle("bluerov2"), damping=bank)
    model.save(tmp_path / "m")
    assert torch.equal(predictions(load(tmp_path / "m")), predictions(model))


def test_single_precision_comes_back_as_the_same_numbers(bank, tmp_path):
    model = GreyBox(load_vehicle("rov95"), damping=bank).float()
    model.save(tmp_path / "m")
    back = load(tmp_path / "m")
    for a, b in zip(model.damping.parameters(), back.damping.parameters(), strict=True):
        assert torch.equal(a.double(), b)


def test_a_model_without_subnetworks_needs_no_weights(tmp_path):
    model = GreyBox(load_vehicle("rov95")).with_effects({"net_buoyancy": {"force": 1 / 3}})
    folder = model.save(tmp_path / "m")
    assert {p.name for p in folder.iterdir()} == {"model.yaml", "manifest.json"}
    assert load(folder).effect("net_buoyancy").values() == {"force": 1 / 3}


def test_refitted_moments_of_inertia_come_back_too(tmp_path):
    """They are no cause in the catalogue, but may be part of a model."""
    model = GreyBox(load_vehicle("rov95")).with_effects({"inertia": {"K": 1.2, "N": 0.9}})
    back = load(model.save(tmp_path / "m"))
    assert back.effect("inertia").values() == {"K": 1.2, "M": 1.0, "N": 0.9}
    assert torch.equal(predictions(back), predictions(model))


def test_the_file_can_be_read_as_a_vehicle_that_states_its_effects(model, tmp_path):
    folder = model.save(tmp_path / "m")
    vehicle = load_vehicle(folder)
    assert vehicle.effects == {e.name: e.values() for e in model.effects}
    data = yaml.safe_load((folder / "model.yaml").read_text())
    assert data["mass"] == model.vehicle.mass and data["actuation"] == "thrusters"


def test_removing_an_effect_gives_back_the_model_without_it_to_the_last_bit(bank):
    before = GreyBox(example_vehicle(), damping=bank).with_effects({"thruster_lag": {"time_constant": 0.2}})
    extended = before.with_effects({"ocean_current": {"v_north": 0.3}, "cg_offset": {"x": 0.02}})
    expected = predictions(before)
    assert not torch.equal(predictions(extended), expected)
    back = remove(extended, ["ocean_current", "cg_offset"])
    assert back.effect_names == ["thruster_lag"] and torch.equal(predictions(back), expected)
    assert extended.effect_names == ["thruster_lag", "ocean_current", "cg_offset"]
    with pytest.raises(ConfigError, match="no effect 'waves'; it has: thruster_lag"):
        remove(before, "waves")


def test_a_removed_effect_stays_removed_on_disk(tmp_path):
    model = GreyBox(load_vehicle("rov95")).with_effects({"net_buoyancy": {"force": 5.0}})
    model.save(tmp_path / "with")
    remove(load(tmp_path / "with"), "net_buoyancy").save(tmp_path / "without")
    assert load(tmp_path / "without").effect_names == []


@pytest.mark.parametrize("file", ["model.yaml", "weights.safetensors"])
def test_one_flipped_bit_is_refused(model, tmp_path, file):
    folder = model.save(tmp_path / "m")
    data = bytearray((folder / file).read_bytes())
    data[len(data) // 2] ^= 1
    (folder / file).write_bytes(bytes(data))
    with pytest.raises(ModelError, match=file) as caught:
        load(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("file", ["model.yaml", "weights.safetensors", "manifest.json"])
def test_a_missing_file_is_refused(model, tmp_path, file):
    folder = model.save(tmp_path / "m")
    (folder / file).unlink()
    with pytest.raises(ModelError, match=file.replace(".", r"\.")):
        load(folder)


def test_a_model_of_a_newer_auvnn_is_refused(model, tmp_path):
    folder = model.save(tmp_path / "m")
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["schema"] = manifest["schema"].rsplit("/", 1)[0] + "/99"
    (folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(ModelError, match="upgrade auvnn"):
        load(folder)


def test_weights_that_are_not_finite_are_not_saved(model, tmp_path):
    with torch.no_grad():
        next(model.damping.parameters()).fill_(torch.nan)
    with pytest.raises(ModelError, match="NaN"):
        model.save(tmp_path / "m")
    assert not (tmp_path / "m").exists()


def test_nothing_that_was_there_is_lost(model, tmp_path):
    folder = model.save(tmp_path / "m")
    with pytest.raises(InputError, match="overwrite"):
        model.save(folder)
    other = remove(model, "cg_offset")
    assert save(other, folder, overwrite=True) == folder
    assert "cg_offset" not in load(folder).effect_names


@pytest.mark.parametrize("name", builtin_vehicles())
def test_a_built_in_vehicle_is_loaded_by_name_and_by_file(name):
    by_name, by_file = load(name), load(config_dir() / "vehicle" / f"{name}.yaml")
    assert by_name.vehicle == by_file.vehicle and by_name.actuation == "thrusters"
    assert load(name, actuation="wrench").actuation == "wrench"


def test_effects_that_a_file_states_are_in_the_model(tmp_path):
    data = load_vehicle("rov95").to_dict()
    data["effects"] = {"ocean_current": {"v_north": 0.2, "v_east": -0.1}, "thruster_lag": None}
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data))
    model = load(path)
    assert model.effect_names == ["ocean_current", "thruster_lag"]
    assert model.effect("ocean_current").values() == {"v_north": 0.2, "v_east": -0.1, "v_down": 0.0}


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ({"ocean_curent": {}}, "Did you mean 'ocean_current'"),
        ({"ocean_current": {"north": 1.0}}, "v_north"),
        ({"ocean_current": {"v_north": 50.0}}, "out of bounds"),
        ({"ocean_current": {"v_north": "fast"}}, "number"),
    ],
)
def test_effects_that_a_file_states_wrongly_are_refused(tmp_path, effects, words):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({**load_vehicle("rov95").to_dict(), "effects": effects}))
    with pytest.raises(AuvnnError, match=words) as caught:
        load(path)
    assert "\n" not in str(caught.value)


def test_what_is_no_model_is_refused(tmp_path):
    for source in (tmp_path, tmp_path / "nowhere.yaml", "rov59"):
        with pytest.raises(AuvnnError) as caught:
            load(source)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["1e-3", "no", "ROV: großer", "007"])
def test_names_that_look_like_numbers_come_back_as_names(tmp_path, name):
    from dataclasses import replace

    model = GreyBox(replace(load_vehicle("rov95"), name=name))
    assert load(model.save(tmp_path / "m")).vehicle.name == name


@pytest.mark.parametrize("with_networks", [False, True])
def test_the_actuation_is_kept_and_can_be_chosen_anew(tmp_path, bank, with_networks):
    damping = bank if with_networks else None
    folder = GreyBox(load_vehicle("rov95"), damping=damping, actuation="wrench").save(tmp_path / "m")
    assert load(folder).actuation == "wrench"
    assert load(folder, actuation="thrusters").actuation == "thrusters"
