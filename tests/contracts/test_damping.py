"""Damping forms and training schemes: each has its YAML file, whose values are the defaults and build it."""

from __future__ import annotations

import pytest

from auvnn.config import config_dir, read_yaml
from auvnn.damping import DAMPING
from auvnn.damping.bank import DampingBank
from auvnn.training.fit_damping import build_scheme
from auvnn.training.schemes import SCHEMES


def test_every_form_has_a_file_and_every_file_a_form():
    files = {path.stem for path in (config_dir() / "damping").glob("*.yaml")}
    assert files >= set(DAMPING.names())
    for name in files & set(DAMPING.names()):
        assert read_yaml(config_dir() / "damping" / f"{name}.yaml")["form"] == name


@pytest.mark.parametrize("name", DAMPING.names())
def test_a_file_of_a_form_states_its_options_and_defaults(name):
    told = read_yaml(config_dir() / "damping" / f"{name}.yaml")
    assert told.pop("each") is None
    assert told == DAMPING.get(name)((0,)).describe()
    assert DampingBank.from_description(told).describe() == told


def test_every_scheme_has_a_file_and_every_file_a_scheme():
    files = {path.stem for path in (config_dir() / "scheme").glob("*.yaml")}
    assert files == set(SCHEMES.names())


@pytest.mark.parametrize("name", SCHEMES.names())
def test_a_file_of_a_scheme_states_all_its_options(name):
    told = read_yaml(config_dir() / "scheme" / f"{name}.yaml")
    scheme = build_scheme(told)
    assert scheme.name == told.pop("scheme") == name
    assert scheme.options() == told
    assert set(told) == set(SCHEMES.get(name)().options())
