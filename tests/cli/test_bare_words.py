"""Whoever leaves out the keys is told the whole command."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["compare", "rov95", "x.csv"], "auvnn compare model=rov95 log=x.csv"),
        (["compare", "x.csv", "rov95", "horizons=[5]"], "auvnn compare log=x.csv model=rov95 horizons=[5]"),
        (
            ["add", "model=rov95", "dive.parquet", "ocean_current"],
            "model=rov95 log=dive.parquet effect=ocean_current",
        ),
        (["check", "dive.mcap"], "auvnn check log=dive.mcap"),
        (["simulate", "bluerov2"], "auvnn simulate model=bluerov2"),
        (["compare", "my-rov.yaml", "dive"], "auvnn compare model=my-rov.yaml log=dive"),
        (["import", "robot.sdf"], "auvnn import file=robot.sdf"),
    ],
)
def test_the_command_that_was_meant_is_said(auvnn, words, meant):
    status, out, err = auvnn(*words)
    assert status == 2 and out == "" and meant in err and len(err.splitlines()) == 1


def test_what_cannot_be_guessed_points_to_the_help(auvnn):
    status, _, err = auvnn("demo", "quickly")
    assert status == 2 and "auvnn demo --help" in err


@pytest.mark.parametrize("words", [["version"], ["--version"], ["-V"]])
def test_version_is_said_however_it_is_asked_for(auvnn, words):
    from auvnn import __version__

    assert auvnn(*words) == (0, f"auvnn {__version__}\n", "")


def test_help_of_a_verb_either_way(auvnn):
    assert auvnn("help", "compare")[1] == auvnn("compare", "--help")[1]
