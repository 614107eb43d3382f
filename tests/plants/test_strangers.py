"""Strangers: nothing at strength zero, the stated degree of freedom, and no plant but those that know them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auvnn.effects import EFFECTS
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.plants import strangers
from auvnn.plants.strangers import STRANGERS
from auvnn.plants.strangers.base import AXES, Seen
from auvnn.simulation import simulate
from auvnn.vehicle import load_vehicle

SHORT = {"runs": 1, "duration": 2.0, "rate": 10.0}


def seen(name="rov95", count=400) -> Seen:
    vehicle, rng = load_vehicle(name), np.random.default_rng(0)
    angles = rng.normal(size=(count, 3)) * [3.0, 0.1, 0.1]
    return Seen(
        vehicle, float(rng.uniform(0, 20)), rng.normal(size=(count, 3)) * 3,
        Rotation.from_euler("ZYX", angles).as_matrix(),
        rng.normal(size=(count, 3)) * 0.4, rng.normal(size=(count, 3)) * 0.3, rng.normal(size=(count, 6)) * 30,
    )  # fmt: skip


def test_names_are_listed_and_are_none_of_the_catalogue():
    assert strangers.names() == STRANGERS.names() and len(strangers.names()) >= 6
    assert not set(strangers.names()) & set(EFFECTS.names())
    for name in strangers.names():
        assert STRANGERS.get(name).name == name and name.startswith("stranger_")
        assert "Not " in STRANGERS.get(name).__doc__, "says which effects it is not"


@pytest.mark.parametrize("name", STRANGERS.names())
def test_wrench_is_in_proportion_and_along_the_stated_axis(name):
    member, moment = STRANGERS.get(name), seen()
    one = member.wrench({"strength": 1.0}, moment)
    assert one.shape == (400, 6) and np.isfinite(one).all()
    assert not member.wrench({"strength": 0.0}, moment).any()
    assert np.allclose(member.wrench({"strength": -2.5}, moment), -2.5 * one)
    size = np.sqrt((one**2).mean(0)) / np.repeat([1.0, 0.1 * moment.vehicle.length], 3)
    axis = AXES.index(member.axis)
    assert size[axis] > 5 * np.delete(size, axis).max()
    # About what is called plausible: between a tenth and twice of two per cent of the weight.
    if name != "stranger_pitch_thrust":
        assert 0.1 < size[axis] / (0.02 * moment.vehicle.weight) < 2


@pytest.mark.parametrize("name", STRANGERS.names())
def test_hidden_in_a_log_it_moves_the_vehicle(name):
    model = GreyBox(load_vehicle("rov95"))
    logs = {}
    for strength in (0.0, 1.0):
        made = simulate(
            model, "multisine", plant="numpy", hidden={name: {"strength": strength}}, **SHORT, noise="none"
        )
        assert made.truth["hidden"] == {name: {"strength": strength}} and made.plant.effect_names == []
        logs[strength] = made.log.runs[0].nu
    nothing = simulate(model, "multisine", plant="numpy", **SHORT, noise="none").log.runs[0].nu
    assert np.array_equal(logs[0.0], nothing)
    assert np.abs(logs[1.0] - nothing).max() > 1e-4


def test_by_name_alone_it_gets_a_strength_and_company_changes_nothing():
    model = GreyBox(load_vehicle("rov95"))
    one = simulate(model, plant="numpy", hidden="stranger_layers", **SHORT, noise="none").truth["hidden"]
    assert 0.5 <= abs(one["stranger_layers"]["strength"]) <= 1.0
    hidden = ["net_buoyancy", "stranger_layers"]
    both = simulate(model, plant="numpy", hidden=hidden, **SHORT, noise="none").truth["hidden"]
    assert (
        set(both) == {"net_buoyancy", "stranger_layers"} and both["stranger_layers"] == one["stranger_layers"]
    )


def test_refused_where_it_cannot_act_or_is_no_number():
    model = GreyBox(load_vehicle("rov95"))
    with pytest.raises(ConfigError, match=r"plant own cannot hold the effect stranger_layers.*plant=numpy"):
        simulate(model, hidden="stranger_layers", **SHORT, noise="none")
    for values, words in (({"strenght": 1.0}, "Did you mean 'strength'"), ({"strength": "big"}, "finite number"),
                          ({"strength": float("nan")}, "finite number")):  # fmt: skip
        with pytest.raises(ConfigError, match=words):
            simulate(model, plant="numpy", hidden={"stranger_layers": values}, **SHORT, noise="none")
