"""Rows 65 to 72: what can be wrong with options, model files and mapping files, and where answers may go."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import yaml

from auvnn.errors import AuvnnError
from auvnn.logs import Log
from auvnn.models import load
from tests.faults.vehicles import four, put


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["check", "lgo=good.csv"], ["'lgo'", "'log'"]),
        (
            ["compare", "log=good.csv", "model=four.yaml", "derivative.methd=measured"],
            ["'derivative.method'"],
        ),
        (["compare", "log=good.csv", "model=rov59"], ["'rov59'", "'rov95'"]),
        (
            ["compare", "log=good.csv", "model=spoilt.yaml"],
            ["spoilt.yaml", "'linear_dampning'", "'linear_damping'"],
        ),
        (["check", "log=good.csv", "mapping=spoilt-map.yaml"], ["spoilt-map.yaml", "'colums'", "'columns'"]),
        (
            ["add", "log=good.csv", "model=four.yaml", "effect=ocean_curent"],
            ["'ocean_curent'", "'ocean_current'"],
        ),
    ],
)
def test_row_65_a_misspelt_key_or_name(refused, arguments, parts):
    put("spoilt.yaml", linear_damping=None, linear_dampning=[1.0] * 6)
    Path("spoilt-map.yaml").write_text("colums: {u: surge}\n")
    line = refused(*arguments)
    for part in parts:
        assert part in line


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ({"mass": -50.0}, ["mass is -50", "must be positive"]),
        ({"water_density": 0}, ["water_density is 0", "must be positive"]),
        ({"mass": "heavy"}, ["mass is 'heavy'", "a number is written as text"]),
        ({"added_mass": [1.0, 2.0]}, ["added_mass", "6"]),
        ({"uncertainty": {"added_mass": -0.1}}, ["uncertainty", "added_mass", "fraction"]),
    ],
)
def test_row_66_a_value_in_a_model_file_of_the_wrong_type_or_range(refused, change, parts):
    line = refused("compare", "log=good.csv", f"model={put('spoilt.yaml', **change)}")
    assert "spoilt.yaml" in line
    for part in parts:
        assert part in line


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["simulate", "model=four.yaml", "rate=0"], ["rate"]),
        (["simulate", "model=four.yaml", "duration=-3"], ["duration"]),
        (["simulate", "model=four.yaml", "seed=1.5"], ["whole number"]),
        (["check", "log=good.csv", "overwrite=perhaps"], ["true or false"]),
        (["diagnose", "log=good.csv", "model=four.yaml", "max_effects=0"], ["max_effects", "at least 1"]),
    ],
)
def test_row_66_an_option_of_the_wrong_type_or_range(refused, words, parts):
    line = refused(*words)
    for part in parts:
        assert part in line


def test_row_67_what_is_required(refused):
    assert "log= is needed" in refused("check")
    assert "model= is needed" in refused("simulate")
    assert "mass is missing; add a line `mass: ...`" in refused(
        "compare", "log=good.csv", f"model={put('spoilt.yaml', mass=None)}"
    )


def test_row_68_what_contradicts_itself(refused):
    with_current = put("current.yaml", effects={"ocean_current": {"v_north": 0.1}})
    twice = ["add", "log=good.csv", "effect=[ocean_current,ocean_current]"]
    assert "twice" in refused(*twice, "model=four.yaml")
    line = refused("add", "log=good.csv", "effect=ocean_current", f"model={with_current}")
    assert "the model has ocean_current already" in line
    Path("double.yaml").write_text(Path("four.yaml").read_text() + "added_mass: [1, 1, 1, 1, 1, 1]\n")
    assert "the key 'added_mass' stands there twice" in refused(
        "compare", "log=good.csv", "model=double.yaml"
    )


BOMBS = {
    "aliases": ("a: &a [1, 1]\nb: [*a, *a]\n", "alias"),
    "depth": ("mass: " + "[" * 2000 + "]" * 2000 + "\n", "32 levels deep"),
    "size": ("mass: 1 # " + "x" * 1_100_000 + "\n", "larger than 1000000 bytes"),
}


@pytest.mark.parametrize("bomb", BOMBS)
@pytest.mark.parametrize("arguments", [["check", "mapping=bomb.yaml"], ["compare", "model=bomb.yaml"]])
def test_row_69_a_file_that_would_exhaust_the_machine(refused, bomb, arguments):
    text, words = BOMBS[bomb]
    Path("bomb.yaml").write_text(text)
    line = refused(arguments[0], "log=good.csv", *arguments[1:])
    assert "bomb.yaml" in line and words in line


@pytest.mark.parametrize(
    "text",
    [
        "_target_: os.mkdir\n",
        "effects: {_target_: os.mkdir, path: ran}\n",
        "os.mkdir: ran\n",
        "name: !!python/object/apply:os.mkdir [ran]\n",
        "__reduce__: [os.mkdir, ran]\n",
    ],
)
def test_row_70_code_in_a_file(refused, text):
    Path("evil.yaml").write_text(text + "mass: 1.0\n")
    for arguments in (["compare", "model=evil.yaml"], ["check", "mapping=evil.yaml"]):
        line = refused(arguments[0], "log=good.csv", *arguments[1:])
        assert "evil.yaml" in line and "refused" in line
    assert "never Python code" in refused("check", "log=good.csv", "+x={_target_: os.mkdir, path: ran}")
    assert not Path("ran").exists()


@pytest.mark.parametrize("value", ["${oc.env:HOME}", "${mass}", "${oc.decode:1}"])
def test_row_71_interpolation_and_the_environment(refused, value):
    Path("spoilt.yaml").write_text(yaml.safe_dump(four(name=value)))
    line = refused("compare", "log=good.csv", "model=spoilt.yaml")
    assert "asks for interpolation" in line and os.environ["HOME"] not in line.replace(str(Path.cwd()), "")
    line = refused("check", "log=good.csv", f"mapping={value}")
    assert "write the value itself" in line or "'mass' not found" in line


def test_row_71_a_path_that_leads_out_of_a_model_folder(refused, tmp_path):
    Path("secret.yaml").write_text("mass: 1\n")
    folder = load(put()).save("saved")
    manifest = folder / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"model.yaml"', '"../secret.yaml"'))
    assert "'../secret.yaml' is not a plain file name" in refused("compare", "log=good.csv", "model=saved")


def test_row_71_a_name_is_no_path(tmp_path):
    """What a file calls its vehicle never decides where something is written or read."""
    model = load(put("odd.yaml", name="../../etc/odd"))
    assert model.vehicle.name == "../../etc/odd"
    before = {p for p in tmp_path.rglob("*")}
    model.save("saved")
    assert all("saved" in p.parts for p in set(tmp_path.rglob("*")) - before)
    with pytest.raises(AuvnnError, match="no such"):
        load("../odd.yaml")


def test_row_72_a_folder_with_something_in_it(refused, auvnn):
    Path("full").mkdir()
    Path("full/mine.txt").write_text("mine")
    assert "out=full: is not empty" in refused("simulate", "model=four.yaml", "out=full")
    assert [p.name for p in Path("full").iterdir()] == ["mine.txt"]
    words = ["simulate", "model=four.yaml", "noise=none", "runs=1", "duration=2", "rate=10", "max_step=0.1"]
    assert auvnn(*words, "out=full", "overwrite=true")[0] == 0
    assert Path("full/mine.txt").read_text() == "mine" and Log.read("full/log.parquet").samples == 21
    assert "overwrite=true" in refused(*words, "out=full")
