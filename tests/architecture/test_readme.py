"""The README tells the truth: verbs, effects and vehicles are in it, its links and commands are real."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from auvnn.cli.main import VERBS
from auvnn.config import config_dir
from auvnn.effects import EFFECTS

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def rows(heading: str) -> dict[str, str]:
    """Return the rows of the table under a heading, by the name in their first cell."""
    section = README.split(f"\n## {heading}\n", 1)[1].split("\n## ", 1)[0]
    return {m[1]: m[0] for m in re.finditer(r"^\| `([a-z0-9_]+)`.*\|$", section, re.MULTILINE)}


@pytest.mark.parametrize("verb", VERBS.names())
def test_every_verb_is_documented_with_what_it_writes(verb):
    row = rows("Commands")[verb]
    for name in VERBS.get(verb).writes:
        assert f"`{name}`" in row, name


def test_no_verb_is_documented_that_does_not_exist():
    assert list(rows("Commands")) == VERBS.names()


@pytest.mark.parametrize("name", EFFECTS.names())
def test_every_effect_is_documented_with_its_parameters(name):
    from auvnn.vehicle import load_vehicle

    row = rows("Effects")[name]
    effect = EFFECTS.get(name).build(load_vehicle("rov95"), "wrench")
    for parameter in effect.parameters_of:
        assert f"`{parameter.name}`" in row


def test_no_effect_is_documented_that_does_not_exist():
    assert list(rows("Effects")) == EFFECTS.names()


def test_the_vehicles_are_documented():
    assert sorted(rows("Vehicles")) == sorted(path.stem for path in (config_dir() / "vehicle").glob("*.yaml"))


def test_links_and_pictures_are_there():
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", README):
        assert re.match(r"https://", target) or (ROOT / target).exists(), target


@pytest.mark.parametrize("what", ["demo", "tests"])
def test_there_is_one_command_for_each_beginning(what):
    commands = re.findall(rf"<!-- {what} -->\n```sh\n(.+?)\n```\n<!-- /{what} -->", README, re.DOTALL)
    assert len(commands) == 1 and "\n" not in commands[0]
    for path in re.findall(r"-c (\S+)", commands[0]):
        if path.startswith("."):
            assert (ROOT / path).exists()
