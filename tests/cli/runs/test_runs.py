"""What a run says, writes and returns, alone and as one job of many."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from auvnn.cli.runs.sweep import note, statuses
from auvnn.errors import InputError
from tests.cli.stand_ins import Plain, write_two

pytestmark = pytest.mark.usefixtures("stand_in")


def test_a_run_says_where_its_answer_is(auvnn):
    status, out, err = auvnn("check", "log=dive.csv", "out=checked")
    assert (status, err) == (0, "")
    assert out.splitlines()[0] == "read it"
    assert f"{Path('checked') / 'report.html'}" in out.splitlines()[-1]
    assert sorted(p.name for p in Path("checked").iterdir()) == [".hydra", "figures", "quality.json"]


def test_the_options_of_a_run_are_kept_with_its_answer(auvnn):
    auvnn("check", "log=dive.csv", "mapping=map.yaml", "out=checked")
    kept = yaml.safe_load(Path("checked/.hydra/config.yaml").read_text())
    assert (kept["log"], kept["mapping"], kept["overwrite"]) == ("dive.csv", "map.yaml", False)
    assert "mapping=map.yaml" in yaml.safe_load(Path("checked/.hydra/overrides.yaml").read_text())


def test_without_out_there_is_a_new_dated_folder_each_time(auvnn):
    for _ in range(2):
        assert auvnn("check", "log=dive.csv")[0] == 0
    names = sorted(p.name for p in Path("outputs").iterdir())
    assert len(names) == 2 and all("_check" in name for name in names)


def test_json_alone_on_standard_output(auvnn):
    status, out, err = auvnn("check", "log=dive.csv", "json=true", "out=checked")
    assert (status, err) == (0, "")
    assert json.loads(out) == {"schema": "test/1", "mapping": None}


def test_a_dry_run_names_what_it_would_touch_and_touches_nothing(auvnn):
    before = sorted(Path().rglob("*"))
    for extra in ([], ["mapping=a,b", "--multirun"]):
        status, out, err = auvnn("check", "log=dive.csv", "out=checked", "dry_run=true", *extra)
        assert (status, err) == (0, "")
        assert "would read   log=dive.csv" in out and "quality.json" in out and "checked" in out
        assert sorted(Path().rglob("*")) == before


def test_a_dry_run_finds_a_refusal(refused):
    assert "dive.cvs" in refused("check", "log=dive.cvs", "dry_run=true")
    Path("full").mkdir()
    Path("full/file").touch()
    assert "not empty" in refused("check", "log=dive.csv", "dry_run=true", "out=full")


def test_a_refused_run_changes_nothing_in_a_full_folder(auvnn, refused):
    auvnn("check", "log=dive.csv", "mapping=first", "out=checked")
    before = {p: p.read_bytes() for p in sorted(Path("checked").rglob("*")) if p.is_file()}
    assert "not empty" in refused("check", "log=dive.csv", "mapping=second", "out=checked")
    assert {p: p.read_bytes() for p in sorted(Path("checked").rglob("*")) if p.is_file()} == before


def test_overwriting_replaces_answer_and_options_together(auvnn):
    auvnn("check", "log=dive.csv", "mapping=first", "out=checked")
    assert auvnn("check", "log=dive.csv", "mapping=second", "out=checked", "overwrite=true")[0] == 0
    assert Path("checked/quality.json").read_text() == "second"
    assert yaml.safe_load(Path("checked/.hydra/config.yaml").read_text())["mapping"] == "second"
    assert [p.name for p in Path("checked/figures").iterdir()] == ["second.png"]


def test_a_failed_overwrite_loses_nothing(auvnn, stand_in):
    auvnn("check", "log=dive.csv", "mapping=first", "out=checked")

    def fail(job):
        write_two(job)
        raise InputError("the log ends\nin the middle")

    stand_in(fail)
    status, _, err = auvnn("check", "log=dive.csv", "mapping=second", "out=checked", "overwrite=true")
    assert (status, err) == (2, "auvnn check: the log ends in the middle\n")
    assert Path("checked/quality.json").read_text() == "first"
    assert yaml.safe_load(Path("checked/.hydra/config.yaml").read_text())["mapping"] == "first"


def test_bad_input_leaves_no_folder(refused, stand_in):
    def fail(job):
        raise InputError("not a log")

    stand_in(fail)
    assert refused("check", "log=dive.csv", "out=a/b/c") == "auvnn check: not a log"
    assert not Path("a").exists()


def test_a_fault_is_one_line_and_a_trace_in_the_folder(auvnn, stand_in):
    def fail(job):
        raise ZeroDivisionError("a bug\nof ours")

    stand_in(fail)
    status, _, err = auvnn("check", "log=dive.csv", "out=checked")
    assert status == 1 and err.count("\n") == 1
    assert "ZeroDivisionError: a bug of ours" in err
    place = Path(err.split("the trace is in ")[1].strip())
    assert place.parent.parent == Path("checked")
    assert "Traceback" in place.read_text() and "in fail" in place.read_text()
    stand_in(write_two)
    assert auvnn("check", "log=dive.csv", "out=checked")[0] == 0, "a trace does not make the folder taken"


def test_a_fault_shows_its_trace_when_debugging(auvnn, stand_in, monkeypatch):
    def fail(job):
        raise ZeroDivisionError("a bug")

    stand_in(fail)
    monkeypatch.setenv("AUVNN_DEBUG", "1")
    status, _, err = auvnn("check", "log=dive.csv", "out=checked")
    assert status == 1 and "Traceback" in err and "in fail" in err
    assert not Path("checked").exists()


@pytest.mark.parametrize(
    ("error", "status"), [(PermissionError(13, "x", "locked.csv"), 2), (OSError(28, "x"), 2)]
)
def test_what_the_disk_does_is_not_our_fault(auvnn, stand_in, error, status):
    def fail(job):
        raise error

    stand_in(fail)
    got, _, err = auvnn("check", "log=dive.csv", "out=checked")
    assert got == status and err.count("\n") == 1 and "fault" not in err


def test_of_many_jobs_one_may_fail(auvnn, stand_in):
    def second_fails(job):
        if job["mapping"] == "b":
            raise InputError("no such mapping")
        return write_two(job)

    stand_in(second_fails)
    status, out, err = auvnn("check", "log=dive.csv", "mapping=a,b,c", "out=many", "--multirun")
    assert status == 2
    assert err.splitlines() == [
        "auvnn check (job 1): no such mapping",
        "auvnn check: 1 of 3 jobs failed: 1",
    ]
    assert Path("many/0/quality.json").read_text() == "a"
    assert Path("many/2/quality.json").read_text() == "c"
    assert not Path("many/1").exists()
    assert out.count("read it") == 2


def test_jobs_run_in_processes_of_their_own_and_one_may_fail(auvnn):
    words = ["simulate", "model=rov90,nosuch", "runs=1", "duration=2", "noise=none", "out=many"]
    status, out, err = auvnn(*words, "--multirun", "-j", "2")
    assert status == 2
    first, last = err.splitlines()
    assert first.startswith("auvnn simulate (job 1): ") and "nosuch" in first
    assert last == "auvnn simulate: 1 of 2 jobs failed: 1"
    assert Path("many/0/log.parquet").exists() and not Path("many/1").exists()
    assert [p.name for p in Path("many").iterdir()] == ["0"]
    assert out.count("written") == 1


@pytest.mark.parametrize(
    "words", [["-j", "2"], ["-m", "-j", "none"], ["-m", "-j", "2", "hydra/launcher=basic"]]
)
def test_jobs_are_asked_for_in_one_way(refused, words):
    assert "-j" in refused("check", "log=dive.csv", "mapping=a,b", "out=many", *words)


def test_a_job_that_leaves_no_word_has_failed(tmp_path):
    with statuses(tmp_path, 3) as ended:
        note(tmp_path, 0, 0)
        note(tmp_path, 2, 2)
    assert ended == [0, 1, 2]
    assert not any(tmp_path.rglob("ended"))


def test_a_fault_in_one_of_many_jobs_weighs_most(auvnn, stand_in):
    def fail(job):
        raise {"a": InputError("bad"), "b": ZeroDivisionError("bug")}[job["mapping"]]

    stand_in(fail)
    status, _, err = auvnn("check", "log=dive.csv", "mapping=a,b", "out=many", "--multirun")
    assert status == 1
    assert err.splitlines()[-1] == "auvnn check: 2 of 2 jobs failed: 0, 1"
    assert Path("many/1/.auvnn/fault.txt").exists()


def test_many_jobs_need_a_place_of_their_own_too(auvnn, refused):
    assert auvnn("check", "log=dive.csv", "mapping=a,b", "out=many", "--multirun")[0] == 0
    assert "not empty" in refused("check", "log=dive.csv", "mapping=c,d", "out=many", "--multirun")
    again = ["check", "log=dive.csv", "mapping=c,d", "out=many", "overwrite=true", "--multirun"]
    assert auvnn(*again)[0] == 0
    assert Path("many/0/quality.json").read_text() == "c"


def test_jobs_cannot_be_told_to_share_a_folder(refused):
    assert "separate folder" in refused("check", "log=dive.csv", "out=a,b", "--multirun")


@pytest.mark.parametrize(
    "name",
    [
        "two words.csv",
        "dätei.csv",
        "dive (1).csv",
        "a=b.csv",
        "it's.csv",
        "a,b.csv",
        "[odd].csv",
        "{x}.csv",
    ],
)
def test_any_file_name_works(auvnn, stand_in, name):
    Path(name).touch()
    seen = []

    def look(job):
        from auvnn.cli.runs.job import files

        seen.extend(files(job.options, "log"))
        return Plain()

    stand_in(look)
    # A comma means several values, and a bracket a list, unless the name is in quotes.
    plain = not set(name) & set(",[{")
    word = name if plain else "'" + name + "'"
    status, _, err = auvnn("check", f"log={word}", f"out=out of {name}" if plain else "out=odd")
    assert (status, err) == (0, "")
    assert [str(p) for p in seen] == [name]


def test_a_list_of_odd_names_works(auvnn, stand_in):
    seen = []
    stand_in(lambda job: seen.extend(job["log"]) or Plain())
    for name in ("ä.csv", "b c.csv"):
        Path(name).touch()
    assert auvnn("check", "log=[ä.csv,b c.csv]", "out=x")[0] == 0
    assert seen == ["ä.csv", "b c.csv"]


def test_home_is_understood(auvnn, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path / "hüme"))
    (tmp_path / "hüme").mkdir()
    (tmp_path / "hüme" / "dive.csv").touch()
    assert auvnn("check", "log=~/dive.csv", "out=~/checked")[0] == 0
    assert (tmp_path / "hüme" / "checked" / "quality.json").exists()


def test_an_optional_group_can_be_said_to_be_null(auvnn):
    assert auvnn("simulate", "size=null", "--cfg", "job")[0] == 0


def test_a_mapping_of_the_users_own_keys_takes_them(auvnn):
    status, out, _ = auvnn("simulate", "noise=none", "noise.relative={u: 0.1}", "--cfg", "job")
    assert status == 0 and yaml.safe_load(out)["noise"]["relative"] == {"u": 0.1}
    status, out, _ = auvnn("simulate", "noise=none", "noise.relative.u=0.2", "--cfg", "job")
    assert status == 0 and yaml.safe_load(out)["noise"]["relative"] == {"u": 0.2}


def test_colour_is_for_a_person_at_a_terminal(auvnn):
    assert "\x1b" not in auvnn("check", "log=dive.csv", "out=checked")[1]


def test_a_folder_of_configs_adds_its_own(auvnn, refused):
    Path("mine/dive").mkdir(parents=True)
    Path("mine/dive/first.yaml").write_text("# @package _global_\nlog: dive.csv\nmapping: theirs.yaml\n")
    Path("mine/noise").mkdir()
    Path("mine/noise/harbour.yaml").write_text("name: harbour\naccelerations: false\n")
    assert auvnn("check", "--config-dir", "mine", "+dive=first", "out=checked")[0] == 0
    assert Path("checked/quality.json").read_text() == "theirs.yaml"
    status, out, _ = auvnn("simulate", "--config-dir", "mine", "noise=harbour", "--cfg", "job")
    assert status == 0 and yaml.safe_load(out)["noise"] == {"name": "harbour", "accelerations": False}
    assert "'harbour'" in refused("simulate", "--config-dir", "mine", "noise=habour")
    assert "no such folder" in refused("simulate", "--config-dir", "nine", "noise=harbour")
