"""Tensors on disk come back to the last bit, and nothing else is taken for them."""

from __future__ import annotations

import pickle
import zipfile

import pytest
import torch

from auvnn.errors import ModelError
from auvnn.storage import tensors_from_bytes, tensors_to_bytes
from tests.storage.stored import Bomb

WEIGHTS = {
    "weight": torch.randn(3, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64),
    "count": torch.tensor([1, 2]),
    "bias": torch.zeros(3),
}
EXPECTED = {name: (tuple(tensor.shape), tensor.dtype) for name, tensor in WEIGHTS.items()}


@pytest.mark.parametrize("kind", ["pickle", "zip", "torch"])
def test_foreign_bytes_in_place_of_weights(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "foreign"
    if kind == "pickle":
        path.write_bytes(pickle.dumps(Bomb()))
    elif kind == "torch":
        torch.save({"a": torch.zeros(1)}, path)
    else:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("a", "b")
    with pytest.raises(ModelError, match="a pickle or a zip archive"):
        tensors_from_bytes(path.read_bytes())
    assert not (tmp_path / "bomb-went-off").exists()


def test_tensors_come_back_with_shape_dtype_and_bits():
    found = tensors_from_bytes(tensors_to_bytes(WEIGHTS), EXPECTED)
    assert set(found) == set(WEIGHTS)
    for name, tensor in WEIGHTS.items():
        assert found[name].dtype == tensor.dtype and torch.equal(found[name], tensor)


def test_views_and_shared_memory_are_written_as_they_look():
    base = torch.arange(12.0).view(3, 4)
    found = tensors_from_bytes(tensors_to_bytes({"view": base.T, "same": base, "again": base}))
    assert torch.equal(found["view"], base.T) and torch.equal(found["again"], base)


def test_every_difference_is_listed():
    given = {"weight": torch.zeros(2, 3), "bias": torch.zeros(3), "stranger": torch.zeros(1)}
    with pytest.raises(ModelError) as caught:
        tensors_from_bytes(tensors_to_bytes(given), EXPECTED, where="here")
    words = str(caught.value)
    for part in (
        "here: ",
        "count is missing",
        "stranger is not known here",
        "weight has shape (2, 3) instead of (3, 2)",
        "weight is torch.float32 instead of torch.float64",
    ):
        assert part in words
    assert "bias" not in words


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_not_finite(value):
    bad = {"good": torch.zeros(2), "bad": torch.tensor([1.0, value])}
    with pytest.raises(ModelError, match="in bad: not saved"):
        tensors_to_bytes(bad)
    data = tensors_to_bytes(bad, finite=False)
    with pytest.raises(ModelError, match="bad holds NaN or infinity"):
        tensors_from_bytes(data)
    assert set(tensors_from_bytes(data, finite=False)) == {"good", "bad"}


@pytest.mark.parametrize(
    "data", [b"", b"\x00" * 64, b"\xff" * 64, b"garbage that is long enough", (1 << 62).to_bytes(8, "little")]
)
def test_bytes_that_are_no_tensors(data):
    with pytest.raises(ModelError, match="not a readable safetensors file"):
        tensors_from_bytes(data)


def test_a_truncated_tensor_file_is_refused_at_any_length():
    data = tensors_to_bytes(WEIGHTS)
    for length in range(0, len(data), 7):
        with pytest.raises(ModelError):
            tensors_from_bytes(data[:length], EXPECTED)
