"""Folders on disk: whole or absent, and refused when anything about them is wrong."""

from __future__ import annotations

import os
import pickle
import shutil
import tempfile

import pytest

from auvnn.errors import InputError, ModelError
from auvnn.storage import folder_exists, read_folder, write_folder
from tests.storage.stored import FILES, Bomb


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

    for module, name in ((os, "replace"), (os, "fsync"), (tempfile, "mkdtemp")):
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


@pytest.mark.parametrize("name", ["model.pt", "model.pkl", "model.zip", "model.safetensors"])
def test_a_foreign_file_in_place_of_a_folder(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(ModelError, match="give a folder that auvnn saved"):
        read_folder(tmp_path / name)
    assert not (tmp_path / "bomb-went-off").exists()


def test_copies_of_a_folder_are_as_good(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "copy")
    assert read_folder(tmp_path / "copy") == read_folder(folder)
