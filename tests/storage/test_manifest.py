"""What a manifest may say, and what is refused before a byte of the files is read."""

from __future__ import annotations

import json

import pytest

from auvnn.errors import InputError, ModelError
from auvnn.storage import read_folder, write_folder


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
