"""A stranger's folder of configs (--config-dir) says plain values for options of auvnn, and nothing else."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
import yaml

from auvnn.cli.options.foreign import is_plain_parameter, read_configs
from auvnn.cli.options.suggestions import resolver_in

GLOBAL = "# @package _global_\n"
SIMULATE = [
    "simulate",
    "model=rov95",
    "runs=1",
    "duration=1",
    "noise=none",
    "out=made",
    "--config-dir",
    "theirs",
]


@pytest.fixture(autouse=True)
def theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "theirs"
    (folder / "extra").mkdir(parents=True)
    (folder / "extra" / "good.yaml").write_text(GLOBAL + "seed: 5\n")
    monkeypatch.delenv("AUVNN_CC", raising=False)
    return folder


def write(text: str, name: str = "extra/bad.yaml") -> None:
    path = Path("theirs", name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


ENVIRONMENT = "hydra: {job: {env_set: {AUVNN_CC: ./script}}}\n"
SETTINGS = {
    "environment": GLOBAL + ENVIRONMENT,
    "environment by header": "# @package hydra.job\nenv_set: {AUVNN_CC: ./script}\n",
    "copied environment": GLOBAL + "hydra: {job: {env_copy: [HOME]}}\n",
    "folder": GLOBAL + "hydra: {run: {dir: elsewhere}}\n",
    "folder of many": GLOBAL + "hydra: {sweep: {subdir: ../../elsewhere}}\n",
    "search path": GLOBAL + "hydra: {searchpath: ['file:///']}\n",
    "sweep": GLOBAL + "hydra: {sweeper: {params: {model: rov90}}}\n",
    "shell": GLOBAL + "hydra: {launcher: {setup: [touch ran]}}\n",
    "shell in a name": GLOBAL + 'hydra: {launcher: {partition: "x\\ntouch ran"}}\n',
    "evaluated": GLOBAL + "hydra: {launcher: {pre_dispatch: 'print(1)'}}\n",
    "target": GLOBAL + "hydra: {callbacks: {x: {_target_: os.mkdir, path: ran}}}\n",
    "logging": GLOBAL + "hydra: {job_logging: {version: 1}}\n",
    "logging chosen": GLOBAL + "defaults:\n  - override hydra/job_logging: default\n",
    "into hydra": GLOBAL + "defaults:\n  - /extra@hydra.job: environ\n",
    "out of the folder": GLOBAL + "defaults:\n  - ../../outside/evil\n",
    "resolver": GLOBAL + "mapping: ${oc.env:HOME}\n",
    "resolver put together": GLOBAL + "mapping: ${oc.${noise}:HOME}\n",
    "reference": GLOBAL + "mapping: ${model}\n",
    "tag": GLOBAL + "seed: !!python/object/apply:os.system ['touch ran']\n",
    "alias": GLOBAL + "a: &a [1]\nb: *a\n",
    "deep": GLOBAL + "a: " + "[" * 30_000 + "]" * 30_000 + "\n",
    "deep and open": GLOBAL + "a: " + "[" * 30_000 + "\n",
    "deep blocks": GLOBAL + "".join(" " * n + f"k{n}:\n" for n in range(1000)),
    "huge": GLOBAL + "# " + "x" * 1_100_000 + "\nseed: 1\n",
    "not text": "\xff\xfe\x00",
    "twice": GLOBAL + "seed: 1\nseed: 2\n",
    "header": "# @package a b\nseed: 1\n",
    "a list": "- 1\n",
}


@pytest.mark.parametrize("text", SETTINGS.values(), ids=list(SETTINGS))
def test_what_is_not_a_plain_option_is_refused(refused, text):
    write(text)
    write("env_set: {AUVNN_CC: ./script}\n", "extra/environ.yaml")
    begin = time.perf_counter()
    line = refused(*SIMULATE, "+extra=bad")
    assert "bad.yaml" in line or "--config-dir theirs" in line
    assert time.perf_counter() - begin < 5.0
    assert not Path("made").exists() and not Path("ran").exists() and "AUVNN_CC" not in os.environ


@pytest.mark.parametrize("how", [[], ["-j", "2"]])
@pytest.mark.parametrize("name", ["environment", "resolver", "into hydra", "tag"])
def test_the_second_value_of_a_sweep_is_judged_before_the_first_starts(refused, name, how):
    write(SETTINGS[name])
    write("env_set: {AUVNN_CC: ./script}\n", "extra/environ.yaml")
    refused(*SIMULATE, "+extra=good,bad", "-m", *how)
    assert not Path("made").exists() and "AUVNN_CC" not in os.environ


def test_the_second_value_is_judged_by_what_it_composes_to(refused):
    """A config that is harmless where it stands, put below hydra by the command line."""
    write("env_set: {AUVNN_CC: ./script}\n", "extra/environ.yaml")
    line = refused(*SIMULATE, "+extra@hydra.job=environ")
    assert "hydra.job.env_set" in line
    write(GLOBAL + "sead: 5\n")
    assert "'sead'" in refused(*SIMULATE, "+extra=good,bad", "-m")
    assert not Path("made").exists()


def test_an_alias_bomb_ends_at_once(refused):
    lines = ["a: &a [x, x, x, x, x, x, x, x, x]"]
    lines += [f"{b}: &{b} [{', '.join(['*' + a] * 9)}]" for a, b in zip("abcdefgh", "bcdefghi", strict=True)]
    write(GLOBAL + "\n".join(lines))
    begin = time.perf_counter()
    assert "alias" in refused(*SIMULATE, "+extra=bad")
    assert time.perf_counter() - begin < 5.0


def test_a_folder_for_hydra_and_links_to_folders_are_refused(refused, tmp_path):
    write("n_jobs: 2\n", "hydra/launcher/mine.yaml")
    assert "configs for Hydra itself" in refused(*SIMULATE, "+extra=good")
    Path("theirs/hydra/launcher/mine.yaml").unlink()
    Path("theirs/hydra/launcher").rmdir()
    Path("theirs/hydra").rmdir()
    Path("theirs/link").symlink_to(tmp_path, target_is_directory=True)
    assert "is a link" in refused(*SIMULATE, "+extra=good")


def test_a_pipe_and_too_many_files_are_refused(refused):
    os.mkfifo("theirs/pipe.yaml")
    assert "no plain file" in refused(*SIMULATE, "+extra=good")
    Path("theirs/pipe.yaml").unlink()
    for number in range(501):
        write("", f"many/{number}.yaml")
    assert "more than 500" in refused(*SIMULATE, "+extra=good")


def test_two_folders_cannot_be_named(refused):
    Path("second").mkdir()
    for second in (["-cd", "second"], ["--config-dir=second"]):
        assert "not two" in refused(*SIMULATE, *second)


def test_what_is_composed_is_what_was_judged(auvnn, monkeypatch):
    """The user's folder is exchanged after it was read: the copy counts."""
    from auvnn.cli.runs import application

    def then_exchanged(folder: Path) -> dict[str, str]:
        found = read_configs(folder)
        Path("theirs/extra/good.yaml").write_text(GLOBAL + ENVIRONMENT)
        return found

    monkeypatch.setattr(application, "read_configs", then_exchanged)
    status, out, _ = auvnn(*SIMULATE, "+extra=good", "--cfg", "job")
    assert status == 0 and yaml.safe_load(out)["seed"] == 5 and "AUVNN_CC" not in os.environ


def test_plain_options_of_a_sweep_are_composed_and_the_copy_goes_away(auvnn):
    write(GLOBAL + "seed: 6\n", "extra/other.yaml")
    write("", "extra/empty.yaml")
    write(
        "name: harbour\nrelative: {u: 1.0e-3}\nstandard_deviation: {}\nresolution: {}\n", "noise/harbour.yaml"
    )
    status, _, err = auvnn(*SIMULATE, "+extra=good,other", "-m")
    assert (status, err) == (0, "")
    seeds = [yaml.safe_load(Path(f"made/{n}/.hydra/config.yaml").read_text())["seed"] for n in (0, 1)]
    assert seeds == [5, 6] and not Path("made/.auvnn").exists()


def test_a_launchers_plain_parameters_may_be_set():
    read_configs(Path("theirs"))
    write(GLOBAL + "hydra: {launcher: {n_jobs: 2, partition: short}, sweeper: {max_batch_size: 3}}\n")
    assert "n_jobs: 2" in read_configs(Path("theirs"))["extra/bad.yaml"]
    assert is_plain_parameter("hydra.launcher.timeout_min", 60)
    assert not is_plain_parameter("hydra.launcher.partition", "a b")
    assert not is_plain_parameter("hydra.launcher", {"n_jobs": 2})


@pytest.mark.parametrize(
    "word",
    [
        "${oc.env:HOME}",
        "${ oc.env :HOME}",
        "${oc.${noise.name}:HOME}",
        "${${a}.${b}:x}",
        "a${\noc.env:HOME}",
        "${${${a}}:{b: c}}",
    ],
)
def test_no_way_of_writing_a_resolver_passes(word):
    assert resolver_in(word)
    assert resolver_in("${out}/x: y ${hydra.${a}.b}") is None
