"""The working folder of a run is no way out of the answer's folder: links are not followed, foreign things are kept."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from auvnn.cli.runs.folder import WORK, locked, written
from auvnn.cli.runs.working import LOCK, MARK, cleared, mark_of, marked
from auvnn.errors import ConfigError, InputError

SIMULATE = ("simulate", "model=rov95", "runs=1", "duration=2", "noise=none")


@pytest.fixture
def precious(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of somebody's, with what a run would delete in a separate working folder."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "precious"
    for name in ("new", "old", "ended", "checkpoint", "samples"):
        (folder / name).mkdir(parents=True)
        (folder / name / "photo.png").write_text("kept")
    (folder / "thesis.tex").write_text("kept")
    return folder


def everything(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): p.read_text() if p.is_file() else "" for p in sorted(folder.rglob("*"))
    }


@pytest.mark.parametrize("verb", [SIMULATE, (*SIMULATE, "overwrite=true"), ("simulate", "model=nosuch"),
                                  (*SIMULATE, "seed=0,1", "-m"), (*SIMULATE, "seed=0,1", "-m", "-j", "2")])  # fmt: skip
def test_a_working_folder_that_is_a_link_is_refused_and_its_target_untouched(refused, precious, verb):
    before = everything(precious)
    Path("out").mkdir()
    Path("out", WORK).symlink_to(precious, target_is_directory=True)
    line = refused(*verb, "out=out")
    assert "is a link" in line and WORK in line
    assert everything(precious) == before and os.listdir("out") == [WORK]


def test_a_working_folder_of_somebody_else_is_refused_and_untouched(refused, precious):
    Path("out").mkdir()
    precious.rename(Path("out", WORK))
    before = everything(Path("out"))
    assert "was not made by this program" in refused(*SIMULATE, "out=out", "overwrite=true")
    assert everything(Path("out")) == before


@pytest.mark.parametrize("name", [LOCK, "new", "old", "ended", "checkpoint", "fault.txt", MARK])
def test_a_link_in_the_working_folder_is_refused_even_beside_a_mark(refused, precious, name):
    before = everything(precious)
    Path("out").mkdir()
    marked(Path("out"))
    Path("out", WORK, name).unlink(missing_ok=True)
    Path("out", WORK, name).symlink_to(
        precious / "new" if name not in (LOCK, MARK) else precious / "thesis.tex"
    )
    assert "is a link" in refused(*SIMULATE, "out=out")
    assert everything(precious) == before


def test_a_folder_that_is_put_there_during_a_run_is_not_emptied(precious, tmp_path):
    out = tmp_path / "out"
    before = everything(precious)
    with pytest.raises(ConfigError, match="exchanged"), written(out, overwrite=False) as new:
        (new / "answer.json").write_text("done")
        (out / WORK).rename(tmp_path / "aside")
        (out / WORK).symlink_to(precious, target_is_directory=True)
    assert everything(precious) == before


def test_links_inside_what_is_deleted_are_taken_away_and_not_followed(precious, tmp_path):
    before = everything(precious)
    with written(tmp_path / "out", overwrite=False) as new:
        (tmp_path / "out" / WORK / "checkpoint").mkdir()
        (tmp_path / "out" / WORK / "checkpoint" / "there").symlink_to(precious, target_is_directory=True)
        (new / "answer.json").write_text("done")
    assert os.listdir(tmp_path / "out") == ["answer.json"]
    assert everything(precious) == before


def test_what_is_overwritten_through_a_link_is_the_link(precious, tmp_path):
    before = everything(precious)
    out = tmp_path / "out"
    out.mkdir()
    (out / "figures").symlink_to(precious, target_is_directory=True)
    (out / "answer.json").symlink_to(precious / "thesis.tex")
    with written(out, overwrite=True) as new:
        (new / "figures").mkdir()
        (new / "answer.json").write_text("done")
    assert not (out / "figures").is_symlink() and (out / "answer.json").read_text() == "done"
    assert everything(precious) == before


@pytest.mark.parametrize("how", [[], ["-j", "2"]])
def test_a_job_of_many_does_not_leave_the_folder_through_a_link(auvnn, precious, how):
    before = everything(precious)
    Path("out").mkdir()
    Path("out", "1").symlink_to(precious, target_is_directory=True)
    status, _, err = auvnn(*SIMULATE, "seed=0,1", "out=out", "overwrite=true", "-m", *how)
    assert status == 2 and "out/1 is a link" in err
    assert Path("out/0/log.parquet").exists() and everything(precious) == before


def test_hydras_note_on_many_jobs_is_not_written_through_a_link(refused, precious):
    before = everything(precious)
    Path("out").mkdir()
    Path("out", "multirun.yaml").symlink_to(precious / "thesis.tex")
    assert "multirun.yaml is a link" in refused(*SIMULATE, "seed=0,1", "out=out", "overwrite=true", "-m")
    assert everything(precious) == before


def test_the_mark_goes_with_the_folder_and_stays_with_what_is_kept(tmp_path):
    with locked(tmp_path) as mark:
        assert mark_of(tmp_path) == mark
    assert not (tmp_path / WORK).exists()
    with pytest.raises(InputError), written(tmp_path, overwrite=False):
        (tmp_path / WORK / "checkpoint").mkdir()
        raise InputError("stop")
    kept = mark_of(tmp_path)
    assert kept is not None and os.listdir(tmp_path / WORK / "checkpoint") == []
    with locked(tmp_path) as again:
        assert again == kept


@pytest.mark.parametrize("text", ["", "{", "[]", '{"id": 3}', '{"id": "../../.."}', "[" * 5000])
def test_a_mark_that_is_none_gives_no_right_to_delete(tmp_path, text):
    (tmp_path / WORK).mkdir()
    (tmp_path / WORK / MARK).write_text(text)
    (tmp_path / WORK / "mine").write_text("kept")
    assert mark_of(tmp_path) is None
    cleared(tmp_path, "0" * 32)
    with pytest.raises(ConfigError, match="was not made by this program"), locked(tmp_path):
        pytest.fail("taken")
    assert (tmp_path / WORK / "mine").read_text() == "kept"


def test_a_mark_cut_short_by_a_kill_is_written_again(tmp_path):
    (tmp_path / WORK).mkdir()
    (tmp_path / WORK / MARK).touch()
    with locked(tmp_path) as mark:
        assert mark_of(tmp_path) == mark
