"""Folders on disk: whole or absent, and refused when anything about them is wrong."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import zipfile

import pytest
import torch

from auvnn import storage
from auvnn.errors import InputError, ModelError
from auvnn.storage import folder_exists, read_folder, tensors_from_bytes, tensors_to_bytes, write_folder

FILES = {"model.yaml": "name: ß\n", "weights.safetensors": tensors_to_bytes({"a": torch.arange(6.0)})}
WEIGHTS = {
    "weight": torch.randn(3, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64),
    "count": torch.tensor([1, 2]),
    "bias": torch.zeros(3),
}
EXPECTED = {name: (tuple(tensor.shape), tensor.dtype) for name, tensor in WEIGHTS.items()}


@pytest.fixture
def folder(tmp_path):
    return write_folder(tmp_path / "model", FILES)


def test_what_was_written_is_read(folder):
    content = read_folder(folder)
    assert content == {
        "model.yaml": "name: ß\n".encode(),
        "weights.safetensors": FILES["weights.safetensors"],
    }
    assert not [path for path in folder.parent.iterdir() if path.name.startswith(".")]


def test_parents_are_made_and_an_empty_folder_is_filled(tmp_path):
    (tmp_path / "empty").mkdir()
    write_folder(tmp_path / "empty", FILES)
    write_folder(tmp_path / "a" / "b c" / "für", FILES)
    assert read_folder(tmp_path / "empty") == read_folder(tmp_path / "a" / "b c" / "für")


def test_nothing_that_was_there_is_lost(folder, tmp_path):
    with pytest.raises(InputError, match="overwrite=true"):
        write_folder(folder, FILES)
    write_folder(folder, {"model.yaml": "new"}, overwrite=True)
    assert read_folder(folder) == {"model.yaml": b"new"}
    (folder / "my notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"also holds my notes\.txt"):
        write_folder(folder, FILES, overwrite=True)
    foreign = tmp_path / "photos"
    foreign.mkdir()
    (foreign / "cat.png").write_bytes(b"cat")
    with pytest.raises(InputError, match="not written by auvnn"):
        write_folder(foreign, FILES, overwrite=True)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="in the way"):
        write_folder(tmp_path / "file", FILES, overwrite=True)
    assert (foreign / "cat.png").read_bytes() == b"cat" and (folder / "my notes.txt").read_text() == "mine"


def calls_that_write(monkeypatch, stop_at):
    """Raise at the n-th call that touches the disk, as a kill or a full disk would."""
    count = 0

    def counted(name, function):
        def call(*args, **kwargs):
            nonlocal count
            count += 1
            if count == stop_at:
                raise KeyboardInterrupt(name)
            return function(*args, **kwargs)

        return call

    for module, name in ((os, "replace"), (os, "fsync"), (storage.tempfile, "mkdtemp")):
        monkeypatch.setattr(module, name, counted(name, getattr(module, name)))
    return lambda: count


@pytest.mark.parametrize("stop_at", range(1, 8))
def test_interrupted_anywhere_the_old_folder_is_intact(folder, monkeypatch, stop_at):
    old = read_folder(folder)
    with monkeypatch.context() as patch:
        calls_that_write(patch, stop_at)
        with pytest.raises(KeyboardInterrupt):
            write_folder(folder, {"model.yaml": "new"}, overwrite=True)
    assert read_folder(folder) in (old, {"model.yaml": b"new"})
    if stop_at < 7:
        assert read_folder(folder) == old
    assert not list(folder.parent.glob("*.partial")) and not list(folder.parent.glob(".*.partial"))


def test_the_interruptions_above_cover_every_write(folder, monkeypatch):
    made = calls_that_write(monkeypatch, -1)
    write_folder(folder, {"model.yaml": "new"}, overwrite=True)
    assert made() == 7  # mkdtemp, two files, their folder, old aside, new in place, parent


def test_killed_between_the_two_moves_the_old_folder_is_found_and_put_back(folder):
    old = read_folder(folder)
    folder.rename(folder.parent / ".model.previous")  # where SIGKILL would have left it
    assert folder_exists(folder) and not folder.exists()
    assert read_folder(folder) == old
    with pytest.raises(InputError, match="overwrite=true"):
        write_folder(folder, FILES)
    assert read_folder(folder) == old and not (folder.parent / ".model.previous").exists()


def test_there_is_no_such_folder(tmp_path):
    assert not folder_exists(tmp_path / "none")
    with pytest.raises(InputError, match="no such folder"):
        read_folder(tmp_path / "none")


@pytest.mark.parametrize("name", [*FILES, "manifest.json"])
def test_truncated(folder, name):
    data = (folder / name).read_bytes()
    (folder / name).write_bytes(data[: len(data) // 2])
    with pytest.raises(ModelError, match=name):
        read_folder(folder)


@pytest.mark.parametrize("name", FILES)
def test_every_flipped_bit_is_seen(folder, name):
    data = (folder / name).read_bytes()
    for place in range(0, len(data), max(1, len(data) // 12)):
        flipped = data[:place] + bytes([data[place] ^ (1 << place % 8)]) + data[place + 1 :]
        (folder / name).write_bytes(flipped)
        with pytest.raises(ModelError, match="changed or damaged"):
            read_folder(folder)
    (folder / name).write_bytes(data)
    assert read_folder(folder)


def test_all_that_is_wrong_is_listed(folder):
    (folder / "model.yaml").unlink()
    (folder / "weights.safetensors").write_bytes(b"")
    with pytest.raises(
        ModelError, match=r"model.yaml is missing; weights.safetensors has 0 bytes instead of"
    ):
        read_folder(folder)


def test_a_file_that_the_manifest_does_not_name_is_not_read(folder):
    (folder / "extra.pt").write_bytes(pickle.dumps({"a": 1}))
    assert set(read_folder(folder)) == set(FILES)


def rewrite(folder, **changes):
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(manifest | changes))


@pytest.mark.parametrize(
    ("schema", "words"),
    [
        ("auvnn/folder/2", "upgrade auvnn"),
        ("auvnn/folder/0", "reads up to"),
        ("auvnn/checkpoint/1", "holds 'auvnn/checkpoint/1'"),
        ("somebody/else/1", "holds 'somebody/else/1'"),
        ("auvnn", "damaged"),
        (7, "damaged"),
    ],
)
def test_another_schema(folder, schema, words):
    rewrite(folder, schema=schema)
    with pytest.raises(ModelError, match=words):
        read_folder(folder)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "null",
        '{"schema": "auvnn/folder/1"}',
        '{"schema": "auvnn/folder/1", "files": 3}',
        "[" * 9999,
    ],
)
def test_a_manifest_that_is_none(folder, text):
    (folder / "manifest.json").write_text(text)
    with pytest.raises(ModelError, match="damaged"):
        read_folder(folder)


def test_no_manifest_or_a_huge_one(folder):
    (folder / "manifest.json").write_text(" " * 1_000_001)
    with pytest.raises(ModelError, match="larger than"):
        read_folder(folder)
    (folder / "manifest.json").unlink()
    with pytest.raises(ModelError, match=r"no manifest\.json"):
        read_folder(folder)


@pytest.mark.parametrize(
    "name", ["../secret.json", "/etc/passwd", "a/b.json", ".hidden.json", "..", "C:\\x.json"]
)
def test_names_that_lead_elsewhere(folder, tmp_path, name):
    (tmp_path / "secret.json").write_text("{}")
    rewrite(folder, files={name: {"sha256": "0" * 64, "bytes": 2}})
    with pytest.raises(ModelError, match="not a plain file name"):
        read_folder(folder)
    with pytest.raises(InputError, match="not a plain file name"):
        write_folder(tmp_path / "new", {name: "x"})
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("name", ["weights.pt", "weights.pkl", "data.npz", "model.exe"])
def test_formats_that_can_run_code(folder, tmp_path, name):
    with pytest.raises(InputError, match="files in this folder end in"):
        write_folder(tmp_path / "new", {name: b"x"})
    (folder / name).write_bytes(b"x")
    rewrite(folder, files={name: {"sha256": "0" * 64, "bytes": 1}})
    with pytest.raises(ModelError, match=name):
        read_folder(folder)


def test_a_size_beyond_reason_is_refused_before_reading(folder):
    rewrite(folder, files={"model.yaml": {"sha256": "0" * 64, "bytes": 290 * 1024**3}})
    with pytest.raises(ModelError, match="more than is sensible"):
        read_folder(folder)


def test_the_manifest_is_not_given_by_the_caller(tmp_path):
    with pytest.raises(InputError, match="leave it out"):
        write_folder(tmp_path / "new", {"manifest.json": "{}"})


class Bomb:
    def __reduce__(self):
        return (os.mkdir, ("bomb-went-off",))


@pytest.mark.parametrize("name", ["model.pt", "model.pkl", "model.zip", "model.safetensors"])
def test_a_foreign_file_in_place_of_a_folder(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(ModelError, match="give a folder that auvnn saved"):
        read_folder(tmp_path / name)
    assert not (tmp_path / "bomb-went-off").exists()


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


def test_copies_of_a_folder_are_as_good(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    assert read_folder(tmp_path / "copy") == read_folder(folder)
