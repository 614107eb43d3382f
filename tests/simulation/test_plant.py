"""What is hidden in a plant: typical values, drawn coefficients."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from auvnn.effects import EFFECTS
from auvnn.models import GreyBox
from auvnn.simulation import simulate
from auvnn.simulation.plant import GROUPS, drawn_factors, make_plant, typical_values
from auvnn.vehicle import load_vehicle

SHORT = {"runs": 1, "duration": 1.0, "rate": 10.0, "max_step": 0.1}


def streams(seed: int) -> dict[str, np.random.Generator]:
    return {g: np.random.default_rng([seed, i]) for i, g in enumerate(GROUPS)}


@pytest.mark.parametrize("name", EFFECTS.names())
def test_typical_values_are_plausible_and_never_the_null(name):
    vehicle = load_vehicle("rov95")
    parameters = EFFECTS.get(name).describe(vehicle, "thrusters")
    signs = set()
    for seed in range(20):
        values = typical_values(parameters, np.random.default_rng(seed))
        EFFECTS.get(name).build(vehicle, "thrusters", values)
        for p in parameters:
            away = values[p.name] - p.null
            assert 0.2 * p.scale < abs(away) <= 1.0001 * p.scale
            signs.add(np.sign(away))
    # A lag, a leak or a width has one direction only.
    assert signs == ({1.0} if all(p.low >= p.null for p in parameters) else {1.0, -1.0})


def test_hidden_by_name_gets_typical_values_that_do_not_hang_on_the_order():
    model = GreyBox(load_vehicle("rov95"))
    one = simulate(model, "paper", hidden=["ocean_current", "net_buoyancy"], **SHORT, noise="none").truth[
        "hidden"
    ]
    other = {"net_buoyancy": None, "ocean_current": {}}
    assert simulate(model, "paper", hidden=other, **SHORT, noise="none").truth["hidden"] == one
    partly = simulate(model, "paper", hidden={"ocean_current": {"v_east": 0.1}}, **SHORT, noise="none").truth[
        "hidden"
    ]
    assert partly == {"ocean_current": {"v_north": 0.0, "v_east": 0.1, "v_down": 0.0}}


def test_drawn_coefficients_have_the_stated_spread():
    vehicle = dataclasses.replace(
        load_vehicle("rov95"),
        uncertainty={"added_mass": 0.1, "linear_damping": 0.2, "quadratic_damping": 0.15, "inertia": 0.05},
    )
    draws = [drawn_factors(vehicle, (), streams(s)) for s in range(300)]
    for group, std in vehicle.uncertainty.items():
        table = np.array([list(d[group].values()) for d in draws])
        assert table.shape[1] == (3 if group == "inertia" else 6)
        low, high = chi2.ppf([1e-5, 1 - 1e-5], table.size)
        assert low < ((table - 1) ** 2).sum() / std**2 < high
        assert abs(table.mean() - 1) < 4.5 * std / np.sqrt(table.size)


def test_drawn_coefficients_stay_physical():
    wide = dataclasses.replace(load_vehicle("remus100"), uncertainty=dict.fromkeys(GROUPS, 0.8))
    for seed in range(50):
        factors = drawn_factors(wide, (), streams(seed))
        assert "linear_damping" not in factors  # it has none
        assert min(min(f.values()) for f in factors.values()) >= 0.2
        if "inertia" in factors:
            x, y, z = np.sort(np.diagonal(wide.inertia) * list(factors["inertia"].values()))
            assert z <= x + y
        plant = make_plant(GreyBox(wide), {}, factors)
        assert np.linalg.eigvalsh(plant.prepare().total.detach().numpy()).min() > 0


def test_drawn_plant_has_exactly_these_coefficients():
    model = GreyBox(load_vehicle("rov90"))
    made = simulate(model, "paper", coefficients="drawn", **SHORT, noise="none")
    factors = made.truth["coefficients"]
    assert set(factors) == set(GROUPS)
    body, before = made.plant.prepare().body, model.prepare().body
    for group, name in (
        ("added_mass", "added_mass"), ("linear_damping", "linear"), ("quadratic_damping", "quadratic"),
        ("inertia", "inertia"),
    ):  # fmt: skip
        got, was = (np.diagonal(getattr(b, name).detach().numpy()) for b in (body, before))
        assert got / was == pytest.approx(list(factors[group].values()), rel=1e-12)
    exact = simulate(model, "paper", **SHORT, noise="none")
    assert exact.truth["coefficients"] == {} and exact.plant.effect_names == []


def test_a_hidden_group_stays_exact_beside_what_is_hidden():
    hidden = {"added_mass": {"X": 1.7}}
    made = simulate(
        GreyBox(load_vehicle("rov95")), "paper", hidden=hidden, coefficients="drawn", **SHORT, noise="none"
    )
    assert set(made.truth["coefficients"]) == {"linear_damping", "quadratic_damping", "inertia"}
    assert made.plant.effect("added_mass").values()["X"] == 1.7
    assert made.plant.effect("added_mass").values()["Y"] == 1.0


def test_drawing_multiplies_what_the_model_already_states():
    model = GreyBox(load_vehicle("rov95")).with_effects({"added_mass": {"X": 2.0}})
    made = simulate(model, "paper", coefficients="drawn", **SHORT, noise="none")
    factor = made.truth["coefficients"]["added_mass"]["X"]
    assert made.plant.effect("added_mass").values()["X"] == pytest.approx(2.0 * factor)
    assert made.truth["hidden"] == {}


def test_the_model_itself_is_left_alone():
    model = GreyBox(load_vehicle("rov95"))
    simulate(model, "paper", hidden=["ocean_current"], coefficients="drawn", **SHORT, noise="none")
    assert model.effect_names == [] and model.actuation == "thrusters"
