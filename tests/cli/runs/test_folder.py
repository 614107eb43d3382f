"""The folder of a run: new or empty, taken by one at a time, complete or unchanged."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from auvnn.cli.runs.folder import WORK, locked, refuse_taken, written
from auvnn.cli.runs.working import marked
from auvnn.errors import ConfigError, InputError


def files_below(path: Path) -> dict[str, str]:
    return {str(p.relative_to(path)): p.read_text() for p in sorted(path.rglob("*")) if p.is_file()}


def run_once(path: Path, text: str, *, overwrite: bool = False) -> None:
    with written(path, overwrite=overwrite) as folder:
        (folder / "answer.json").write_text(text)
        (folder / "figures").mkdir()
        (folder / "figures" / f"{text}.svg").write_text(text)


def test_a_run_leaves_its_files_and_nothing_else(tmp_path):
    run_once(tmp_path / "deep" / "out", "first")
    assert files_below(tmp_path) == {"deep/out/answer.json": "first", "deep/out/figures/first.svg": "first"}
    assert not (tmp_path / "deep" / "out" / WORK).exists()


def test_a_folder_with_something_in_it_is_refused_and_untouched(tmp_path):
    run_once(tmp_path, "first")
    before = files_below(tmp_path)
    with pytest.raises(ConfigError, match="overwrite=true"):
        run_once(tmp_path, "second")
    assert files_below(tmp_path) == before


def test_notes_of_a_run_do_not_make_a_folder_taken(tmp_path):
    (tmp_path / ".hydra").mkdir()
    (tmp_path / ".hydra" / "config.yaml").write_text("a: 1")
    run_once(tmp_path, "first")
    assert (tmp_path / "answer.json").read_text() == "first"


def test_overwriting_replaces_what_is_made_again_and_keeps_the_rest(tmp_path):
    run_once(tmp_path, "first")
    (tmp_path / "notes.txt").write_text("mine")
    run_once(tmp_path, "second", overwrite=True)
    # The old figure goes with its folder: beside the new answer it would tell a lie.
    assert files_below(tmp_path) == {
        "answer.json": "second",
        "figures/second.svg": "second",
        "notes.txt": "mine",
    }


def test_a_run_that_fails_leaves_the_folder_as_it_was(tmp_path):
    run_once(tmp_path, "first")
    before = files_below(tmp_path)
    with pytest.raises(InputError), written(tmp_path, overwrite=True) as folder:
        (folder / "answer.json").write_text("half")
        raise InputError("the log ends here")
    assert files_below(tmp_path) == before
    assert not (tmp_path / WORK).exists()


def test_a_failed_run_into_a_new_place_leaves_no_folders_behind(tmp_path):
    with pytest.raises(KeyboardInterrupt), written(tmp_path / "a" / "b", overwrite=False):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_files_of_a_killed_run_neither_block_nor_reach_the_next(tmp_path):
    marked(tmp_path)
    stale = tmp_path / WORK / "new"
    stale.mkdir(parents=True)
    (stale / "stale.json").write_text("half")
    run_once(tmp_path, "first")
    assert files_below(tmp_path) == {"answer.json": "first", "figures/first.svg": "first"}


def test_folders_that_a_killed_run_had_moved_aside_come_back(tmp_path):
    marked(tmp_path)
    aside = tmp_path / WORK / "old" / "figures"
    aside.mkdir(parents=True)
    (aside / "precious.svg").write_text("kept")
    with pytest.raises(InputError), written(tmp_path, overwrite=True):
        raise InputError("fails at once")
    assert files_below(tmp_path) == {"figures/precious.svg": "kept"}


def test_two_runs_cannot_have_one_folder(tmp_path):
    with locked(tmp_path), pytest.raises(ConfigError, match="another run"), locked(tmp_path):
        pytest.fail("the lock was given twice")
    with locked(tmp_path):
        pass
    assert not (tmp_path / WORK).exists()


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(ConfigError, match="is not a folder"):
        refuse_taken(tmp_path / "out", overwrite=True)
    with pytest.raises(ConfigError, match="is not a folder"):
        refuse_taken(tmp_path / "out" / "deeper", overwrite=True)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_place_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(ConfigError, match="must not be written to"):
            refuse_taken(tmp_path / "out", overwrite=False)
    finally:
        tmp_path.chmod(0o700)


def test_what_a_run_could_have_gone_on_from_goes_when_it_is_complete(tmp_path):
    kept = tmp_path / WORK / "checkpoint"
    with pytest.raises(KeyboardInterrupt), written(tmp_path, overwrite=False):
        kept.mkdir()
        (kept / "state").write_text("so far")
        raise KeyboardInterrupt
    assert (kept / "state").read_text() == "so far"
    run_once(tmp_path, "whole")
    assert not (tmp_path / WORK).exists()
