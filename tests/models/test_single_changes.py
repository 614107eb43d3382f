"""No single change of a value in a valid model ends as a fault of the program, with whatever hash beside it."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from auvnn.damping.bank import DampingBank
from auvnn.errors import AuvnnError, ModelError
from auvnn.models import GreyBox, load
from auvnn.models.loading import from_contents
from auvnn.storage import read_folder, tensors_from_bytes, tensors_to_bytes
from auvnn.storage.manifest import MANIFEST

FEW = [None, 0, float("nan"), "x", []]
MORE = [-1, 1e308, {}, True, [1, 2], {"a": 1}, 1e-320, "", 10**30]
VALUES = [*FEW, *(pytest.param(value, marks=pytest.mark.long) for value in MORE)]


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    known = load("rov95")
    model = GreyBox(known.vehicle, (), DampingBank.from_description("mlp", 0))
    return model.with_effects({"ocean_current": None, "payload": None}).save(
        tmp_path_factory.mktemp("m") / "model"
    )


def places(data: Any, before: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place in nested data, of a list the first two."""
    if before:
        yield before
    inside = data.items() if isinstance(data, dict) else enumerate(data[:2]) if isinstance(data, list) else ()
    for key, value in inside:
        yield from places(value, (*before, key))


def changed(data: Any, place: tuple[Any, ...], value: Any) -> Any:
    whole = copy.deepcopy(data)
    part = whole
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    return whole


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_of_the_model_file(saved, value):
    files = read_folder(saved)
    data = yaml.safe_load(files["model.yaml"])
    refused = 0
    for place in places(data):
        text = yaml.safe_dump(changed(data, place, value)).encode()
        try:
            from_contents({**files, "model.yaml": text}, saved)
        except AuvnnError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 10


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_of_the_manifest(saved, value):
    file = saved / MANIFEST
    text = file.read_text()
    data = json.loads(text)
    try:
        for place in places(data):
            file.write_text(json.dumps(changed(data, place, value)))
            try:
                load(saved)
                assert place[-1] not in ("sha256", "schema", "files"), place
            except AuvnnError as error:
                assert "\n" not in str(error)
    finally:
        file.write_text(text)


@pytest.mark.parametrize("name", ["input_scale", "output_scale"])
@pytest.mark.parametrize("value", [0.0, -1.0])
def test_of_the_scales_in_the_weights(saved, name, value):
    files = read_folder(saved)
    tensors = tensors_from_bytes(files["weights.safetensors"])
    tensors[name][2] = value
    with pytest.raises(ModelError, match=f"{name} must be positive"):
        from_contents({**files, "weights.safetensors": tensors_to_bytes(tensors)}, saved)
