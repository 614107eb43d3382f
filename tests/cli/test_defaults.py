"""The command line and Python have the same defaults, and the help says their numbers."""

from __future__ import annotations

import inspect
import re
from typing import Any

import pytest
import yaml

import auvnn
from auvnn.cli.main import VERBS
from auvnn.config import config_dir

# Verbs with a call of the same name.
CALLS = {
    # The package of the page is no call, though another test may have made it an attribute.
    v: getattr(auvnn, "import_model" if v == "import" else v)
    for v in VERBS.names()
    if v != "app" and hasattr(auvnn, v)
}
# What is said otherwise in a config and means the same.
SAME: dict[tuple[str, str], tuple[Any, Any]] = {
    ("train", "resume"): (None, False),
    ("adapt", "guards"): ("the numbers of", "full"),
}


def defaults(verb: str) -> dict[str, Any]:
    """Return a verb's defaults: of its own keys, of what every verb takes, and the members of its groups."""
    data = yaml.safe_load((config_dir() / f"{verb}.yaml").read_text())
    out: dict[str, Any] = {}
    for entry in data.get("defaults", []):
        if isinstance(entry, str) and entry.startswith("options/"):
            out |= yaml.safe_load((config_dir() / f"{entry}.yaml").read_text())
        elif isinstance(entry, dict):
            out |= {k: v for k, v in entry.items() if not k.startswith("override")}
    return {k: v for k, v in (out | data).items() if k not in ("hydra", "defaults")}


def plain(value: Any) -> Any:
    """Return a default as it is compared: nothing for a mapping of nothing, horizons as text."""
    if isinstance(value, dict) and all(v is None for v in value.values()):
        return None
    return (
        [f"{v:g}" if isinstance(v, float) else str(v) for v in value]
        if isinstance(value, (list, tuple))
        else value
    )


def shared() -> list[tuple[str, str, Any, Any]]:
    """Return every argument that a verb and its call have in common, with both defaults."""
    found = []
    for verb, call in CALLS.items():
        known = defaults(verb)
        for name, parameter in inspect.signature(call).parameters.items():
            if name in known and parameter.default is not inspect.Parameter.empty:
                found.append((verb, name, known[name], parameter.default))
    return found


@pytest.mark.parametrize(("verb", "name", "cli", "python"), shared(), ids=lambda v: str(v)[:20])
def test_defaults_are_the_same(verb, name, cli, python):
    if (verb, name) in SAME:
        if verb == "adapt":
            from auvnn.online.guards import Guards

            assert {k: v for k, v in cli.items() if k != "enabled"} == {
                k: v for k, v in vars(Guards()).items() if k in cli and k != "enabled"
            }
            return
        assert (cli, python) == SAME[verb, name]
        return
    assert plain(cli) == plain(python)


def test_the_comparison_covers_what_it_should():
    names = {(verb, name) for verb, name, *_ in shared()}
    assert {
        ("simulate", "noise"),
        ("simulate", "duration"),
        ("improve", "seconds"),
        ("train", "seed"),
    } <= names


@pytest.mark.parametrize("verb", VERBS.names())
def test_the_help_says_the_numbers_of_the_defaults(verb):
    known = defaults(verb)
    text = yaml.safe_load((config_dir() / f"{verb}.yaml").read_text())["hydra"]["help"]["template"]
    entries = re.split(r"\n  (?=\w+=\s)", text)
    shown = {e.partition("=")[0]: " ".join(e.split()) for e in entries[1:]}
    for key, value in known.items():
        if isinstance(value, (int, float)) and not isinstance(value, bool) and key in shown:
            assert re.search(rf"default[^;]*?\b{re.escape(f'{value:g}')}\b", shown[key]), (verb, key)
