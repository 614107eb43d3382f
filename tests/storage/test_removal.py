"""What is replaced or cleared away is what was written here: links are not followed, other things are kept."""

from __future__ import annotations

import pytest
import torch

from auvnn.errors import InputError
from auvnn.storage import read_folder, write_folder
from auvnn.storage.removal import remove_own, remove_unfinished
from auvnn.training.checkpoint import Checkpoints


def test_a_hidden_folder_of_somebody_else_beside_a_model_is_kept(tmp_path):
    write_folder(tmp_path / "model", {"a.txt": "first"})
    theirs = tmp_path / ".model.previous"
    theirs.mkdir()
    (theirs / "thesis.tex").write_text("kept")
    with pytest.raises(InputError, match=r"thesis\.tex"):
        write_folder(tmp_path / "model", {"a.txt": "second"}, overwrite=True)
    assert (theirs / "thesis.tex").read_text() == "kept"
    assert read_folder(tmp_path / "model") == {"a.txt": b"first"}


def test_a_model_that_is_a_link_is_replaced_and_its_target_kept(tmp_path):
    write_folder(tmp_path / "elsewhere", {"a.txt": "first"})
    (tmp_path / "model").symlink_to("elsewhere", target_is_directory=True)
    write_folder(tmp_path / "model", {"a.txt": "second"}, overwrite=True)
    assert read_folder(tmp_path / "elsewhere") == {"a.txt": b"first"}
    assert read_folder(tmp_path / "model") == {"a.txt": b"second"}
    assert {p.name for p in tmp_path.iterdir()} == {"elsewhere", "model"}


def test_a_checkpoint_folder_with_something_of_somebody_else_is_kept(tmp_path):
    states = Checkpoints(tmp_path, {})
    for iteration in range(3):
        states.save(iteration, {"x": torch.zeros(2)}, {})
        (tmp_path / f"checkpoint-{iteration:08d}" / "notes.txt").write_text("kept")
    states.save(3, {"x": torch.zeros(2)}, {})
    assert all((tmp_path / f"checkpoint-{n:08d}" / "notes.txt").exists() for n in range(3))
    with pytest.raises(InputError, match=r"notes\.txt"):
        states.save(2, {"x": torch.zeros(2)}, {})


def test_links_are_taken_away_themselves(tmp_path):
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "a.txt").write_text("kept")
    for name in ("link", ".checkpoint-1.partial"):
        (tmp_path / name).symlink_to("theirs", target_is_directory=True)
    remove_own(tmp_path / "link")
    remove_unfinished(tmp_path / ".checkpoint-1.partial")
    assert not (tmp_path / "link").is_symlink() and (tmp_path / "theirs" / "a.txt").read_text() == "kept"
