"""The named conditions are what they are said to be, and their configs say the same as the code."""

from __future__ import annotations

import pytest

from auvnn.config import config_dir, read_yaml
from auvnn.simulation import EXCITATIONS, make_excitation, make_noise
from auvnn.studies.hidden import SIZES


def members(group: str) -> list[str]:
    return sorted(path.stem for path in (config_dir() / group).glob("*.yaml"))


def test_every_excitation_has_a_config_and_every_config_an_excitation():
    assert members("excitation") == sorted(EXCITATIONS.names())


@pytest.mark.parametrize("name", EXCITATIONS.names())
def test_an_excitations_config_shows_all_its_options_at_their_defaults(name):
    shown = read_yaml(config_dir() / "excitation" / f"{name}.yaml")
    made = make_excitation(shown, EXCITATIONS)
    assert made == make_excitation(name, EXCITATIONS)
    assert set(shown) == {"name", *vars(made)}


def test_realistic_noise_is_that_of_the_contract():
    noise = make_noise("realistic")
    assert not noise.accelerations and not noise.relative
    expected = {
        **dict.fromkeys("uvw", 0.006),
        **dict.fromkeys("pqr", 0.003),
        "phi": 0.003,
        "theta": 0.003,
        "psi": 0.008,
        "x": 0.05,
        "y": 0.05,
        "z": 0.01,
        "voltage": 0.02,
        "altitude": 0.02,
    }
    assert dict(noise.standard_deviation) == expected


def test_the_papers_noise_is_that_of_its_second_case():
    noise = make_noise("paper")
    assert noise.accelerations
    assert dict(noise.standard_deviation) == {
        **dict.fromkeys(["du", "dv", "dw"], 0.5),
        **dict.fromkeys(["dp", "dq", "dr"], 0.05),
    }
    assert dict(noise.relative) == dict.fromkeys("uvwpqr", 0.001)


def test_no_noise_is_none():
    noise = make_noise("none")
    assert noise.accelerations and not noise.relative and not noise.standard_deviation


def test_sizes_are_in_standard_errors():
    shown = {name: read_yaml(config_dir() / "size" / f"{name}.yaml") for name in members("size")}
    assert {name: size["standard_errors"] for name, size in shown.items()} == SIZES
    assert SIZES == {"small": 5.0, "medium": 10.0, "large": 30.0}
    assert all(size["name"] == name for name, size in shown.items())
