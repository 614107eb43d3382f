"""What a user can get wrong on the command line, and the one line that each gets."""

from __future__ import annotations

from pathlib import Path

import pytest

pytestmark = pytest.mark.usefixtures("stand_in")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["chek"], ["'chek'", "'check'", "simulate"]),
        (["check", "lgo=dive.csv"], ["'lgo'", "Did you mean 'log'", "mapping"]),
        (["check", "log=dive.csv", "overwite=true"], ["'overwite'", "'overwrite'"]),
        (["simulate", "model=rov95", "noise=relistic"], ["'relistic'", "'realistic'", "paper"]),
        (["simulate", "model=rov95", "nois=paper"], ["'nois'", "'noise'"]),
        (["simulate", "model=rov95", "noise.acelerations=true"], ["'noise.accelerations'"]),
        (["simulate", "model=rov95", "noise.standart_deviation.u=1"], ["'noise.standard_deviation'"]),
        (["check", "log=dive.csv", "+extra=1"], ["'extra'", "There are"]),
        (["check", "dive.csv"], ["key=value", "log=dive.csv"]),
        (["check", "log=[dive.csv"], ["cannot be read", "quotes"]),
        (["check", "log=" + "[" * 3000], ["cannot be read"]),
        (["check", "~log"], ["~log", "null"]),
    ],
)
def test_a_misspelt_word_gets_the_nearest_names(refused, arguments, parts):
    line = refused(*arguments)
    for part in parts:
        assert part in line


@pytest.mark.parametrize("verb", ["check", "simulate", "train", "compare", "diagnose", "add", "remove"])
def test_a_required_value_that_is_missing_is_named(refused, verb):
    assert "= is needed" in refused(verb)


@pytest.mark.parametrize(
    ("arguments", "needed"),
    [
        (["check", "log=dive.csv", "overwrite=maybe"], "true or false"),
        (["check", "log=dive.csv", "json=1"], "true or false"),
        (["simulate", "model=rov95", "seed=1.5"], "whole number"),
        (["simulate", "model=rov95", "duration=long"], "number"),
        (["simulate", "model=rov95", "duration=-3"], "duration"),
        (["simulate", "model=rov95", "rate=0"], "rate"),
        (["simulate", "model=rov95", "runs=0"], "runs"),
        (["diagnose", "model=rov95", "log=dive.csv", "max_effects=two"], "whole number"),
    ],
)
def test_a_value_of_the_wrong_kind_or_size_is_refused(refused, arguments, needed):
    assert needed in refused(*arguments)


def test_a_missing_file_is_named_with_its_neighbour(refused):
    line = refused("check", "log=dvie.csv", "out=new")
    assert "log=dvie.csv" in line and "'dive.csv'" in line
    assert not Path("new").exists()


def test_a_missing_file_in_a_missing_folder_is_named(refused):
    assert "nowhere" in refused("check", "log=nowhere/dive.csv")


def test_two_values_without_multirun_are_explained(refused):
    line = refused("check", "log=a.csv,b.csv")
    assert "log=[a.csv,b.csv]" in line and "--multirun" in line


@pytest.mark.parametrize(
    "word",
    [
        "model=${oc.env:HOME}",
        "out=${oc.env:HOME}/x",
        "model=${oc.decode:1}",
        "out='${now:%Y}'",
        "+a={b: '${python_version:minor}'}",
    ],
)
def test_resolvers_are_refused(refused, word):
    assert "${" in refused("check", "log=dive.csv", word)


@pytest.mark.parametrize(
    "word",
    [
        "model._target_=os.system",
        "+evil={_target_: os.system, command: id}",
        "hydra.callbacks.x._target_=os.system",
        "+hydra.callbacks.x={_target_: os.system}",
        "hydra/job_logging=default",
    ],
)
def test_code_is_refused(refused, word):
    assert "never Python code" in refused("check", "log=dive.csv", word)


def test_code_in_a_folder_of_configs_is_refused(refused, tmp_path):
    folder = tmp_path / "theirs" / "extra"
    folder.mkdir(parents=True)
    marker = tmp_path / "ran"
    (folder / "evil.yaml").write_text(
        f"# @package _global_\nhydra:\n  callbacks:\n    x:\n      _target_: os.mkdir\n      path: {marker}\n"
    )
    line = refused("check", "log=dive.csv", "--config-dir", str(tmp_path / "theirs"), "+extra=evil")
    assert "'_target_' could name code" in line
    assert not marker.exists()


def test_environment_variables_in_a_folder_of_configs_are_refused(refused, tmp_path):
    folder = tmp_path / "theirs" / "extra"
    folder.mkdir(parents=True)
    (folder / "leak.yaml").write_text("# @package _global_\nmapping: ${oc.env:HOME}\n")
    line = refused("check", "log=dive.csv", "--config-dir", str(tmp_path / "theirs"), "+extra=leak")
    assert "'${oc.env:HOME}' asks for interpolation" in line


@pytest.mark.parametrize(
    "text",
    ["a: &a [1, 1]\nb: [*a, *a]\n", "# " + "x" * 1_100_000 + "\na: 1\n", "a: " + "[" * 20000 + "\n"],
    ids=["aliases", "huge", "deep"],
)
def test_a_config_that_would_exhaust_the_machine_is_refused(refused, tmp_path, text):
    folder = tmp_path / "theirs" / "extra"
    folder.mkdir(parents=True)
    (folder / "bomb.yaml").write_text(text)
    refused("check", "log=dive.csv", "--config-dir", str(tmp_path / "theirs"), "+extra=bomb")


@pytest.mark.parametrize(
    "flags",
    [
        ["--experimental-rerun", "config.pickle"],
        ["--experimental-r=x"],
        ["--config-path", "."],
        ["-cn", "add"],
    ],
)
def test_flags_that_load_what_is_foreign_are_refused(refused, flags):
    assert "no flag" in refused("check", "log=dive.csv", *flags)


def test_an_option_written_as_a_flag_is_explained(refused):
    assert "json=true" in refused("check", "--json=true")
    assert "--multirun" in refused("check", "--multrun")


@pytest.mark.parametrize(
    "word", ["hydra.run.dir=x", "hydra.sweep.dir=x", "hydra.mode=MULTIRUN", "hydra.searchpath=[x]"]
)
def test_what_out_decides_cannot_be_set_beside_it(refused, word):
    assert "out=" in refused("check", "log=dive.csv", word)


def test_a_name_given_twice_is_refused(refused):
    line = refused("simulate", "model=rov95", "hidden=[ocean_current,ocean_current]")
    assert "twice" in line
