"""The documentation tells the truth: its pages are listed, its code runs, its tables hold what the package has."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import torch
import yaml

import auvnn
from auvnn.cli.main import VERBS, main
from auvnn.cli.pages import PAGES
from auvnn.config import config_dir
from auvnn.docs import FOLDER, page, page_names
from auvnn.effects import EFFECTS
from auvnn.effects.describe import describe_all
from auvnn.errors import ConfigError
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.online.adapter_parts import with_subnetworks
from auvnn.vehicle import Vehicle

pytestmark = pytest.mark.usefixtures("catalogue_as_before")
# Launchers that need a package of their own: their lines are only looked at.
FOREIGN = "hydra/launcher="


def blocks(name: str, language: str) -> list[str]:
    """Return the code blocks of a page in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page(name), re.MULTILINE | re.DOTALL)


def rows(name: str) -> dict[str, str]:
    """Return the rows of a page's tables by the name in their first cell."""
    return {m[1]: m[0] for m in re.finditer(r"^\| `([a-z0-9_]+)`.*\|$", page(name), re.MULTILINE)}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Return a folder with the files that pages speak of: logs, a folder of dives, a model file, a saved model."""
    folder = tmp_path_factory.mktemp("pages")
    model = auvnn.load("rov95")
    made = auvnn.simulate(model, "multisine", "realistic", runs=2, duration=8.0, seed=1)
    for name in ("dive", "other-dive"):
        made.log.write(folder / f"{name}.parquet")
    for name in ("dives", "made"):
        (folder / name).mkdir()
    made.log.write(folder / "made" / "log.parquet")
    made.log.write(folder / "dives" / "first.parquet")
    (folder / "my-rov.yaml").write_text((config_dir() / "vehicle" / "rov95.yaml").read_text())
    auvnn.load("rov95").save(folder / "better" / "model")
    auvnn.export(model, to="sdf", out=folder / "sim")
    return folder


@pytest.mark.parametrize("name", page_names())
def test_python_blocks_run(name, place, monkeypatch):
    monkeypatch.chdir(place)
    model = auvnn.load("rov95")
    trained = with_subnetworks(model, "mlp") if name == "training" else model
    size = model.actuators.size
    zeros = {key: torch.zeros(n).double() for key, n in (("eta", 7), ("nu", 6), ("command", size))}
    zeros["eta"][3] = 1.0
    times = torch.arange(0.0, 1.0, 0.05, dtype=torch.float64)
    given = {
        "auvnn": auvnn, "model": trained, "t": 0.0, **zeros, "eta0": zeros["eta"], "nu0": zeros["nu"],
        "times": times, "commands": torch.zeros(len(times), size).double(), "log": auvnn.Log.read("dive.parquet"),
        "held_out": auvnn.Log.read("other-dive.parquet"),
    }  # fmt: skip
    for block in blocks(name, "python"):
        exec(compile(block, f"{name}.md", "exec"), given)


@pytest.mark.parametrize("name", page_names())
def test_commands_are_composed_as_printed(name, place, monkeypatch, capfd):
    monkeypatch.chdir(place)
    for line in "".join(blocks(name, "sh")).splitlines():
        words = shlex.split(line, comments=True)
        if not words or words[0] != "auvnn" or any(w.startswith(FOREIGN) for w in words):
            continue
        if words[1:2] and words[1] in PAGES:
            assert main(words[1:]) == 0, line
            continue
        kept = [w for w in words[1:] if not w.startswith(("out=", "-j")) and w != "2"]
        status = main([*kept, "dry_run=true"])
        assert status == 0, (line, capfd.readouterr().err)


@pytest.mark.parametrize("name", page_names())
def test_yaml_blocks_are_models_or_mappings(name):
    for block in blocks(name, "yaml"):
        data = yaml.safe_load(block)
        if "columns" in data:
            Mapping.read(data)
        elif "mass" in data:
            Vehicle.from_dict(data, f"{name}.md")


def test_the_page_of_effects_is_made_from_the_classes():
    made = describe_all([EFFECTS.get(name) for name in EFFECTS.names()])
    assert page("effects") == made, "write it again: auvnn effects all > auvnn/docs/effects.md"


@pytest.mark.parametrize("name", EFFECTS.names())
def test_what_an_effect_says_of_others_is_in_the_catalogue(name):
    kind = EFFECTS.get(name)
    assert set(kind.confused_with) <= set(EFFECTS.names()) and name not in kind.confused_with
    assert kind.told_apart_by and (config_dir() / "excitation" / f"{kind.manoeuvre}.yaml").is_file()


@pytest.mark.parametrize("name", EFFECTS.names())
def test_one_effect_is_printed(name, capsys):
    assert main(["effects", name]) == 0
    text = capsys.readouterr().out
    assert text.startswith(f"## {name}\n") and "| parameter | unit |" in text and "*Reference*" in text


@pytest.mark.parametrize("verb", VERBS.names())
def test_every_verb_is_documented_with_what_it_writes(verb):
    row = rows("commands")[verb]
    for name in VERBS.get(verb).writes:
        assert f"`{name}`" in row, name


def test_no_verb_and_no_vehicle_is_documented_that_does_not_exist():
    assert list(rows("commands")) == VERBS.names()
    assert sorted(rows("vehicles")) == sorted(p.stem for p in (config_dir() / "vehicle").glob("*.yaml"))


def test_the_first_page_lists_the_others():
    assert sorted(rows("index")) == sorted(name for name in page_names() if name != "index")


def test_pages_are_printed_and_a_wrong_name_is_told(capsys):
    assert main(["docs"]) == 0
    assert all(name in capsys.readouterr().out for name in page_names()[:1])
    assert main(["docs", "vehicles"]) == 0
    assert capsys.readouterr().out.strip() == page("vehicles").strip()
    assert main(["docs", "vehicels"]) == 2
    assert "Did you mean 'vehicles'" in capsys.readouterr().err
    with pytest.raises(ConfigError):
        page("../secret")


def test_pages_name_no_place_outside_the_package():
    for path in FOLDER.glob("*.md"):
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", path.read_text(encoding="utf-8")):
            assert re.match(r"https://", target) or (path.parent / target).exists(), (path.name, target)


def test_the_pages_are_shipped():
    assert Path(auvnn.__file__).parent in FOLDER.parents
