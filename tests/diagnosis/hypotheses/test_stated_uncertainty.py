"""What is stated has an uncertainty: priors from the model file, saved with what was fitted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import auvnn
from auvnn.diagnosis.hypotheses.stated_priors import REACH, lay_out, priors
from auvnn.errors import ConfigError, ModelError
from auvnn.models import GreyBox, load
from auvnn.vehicle import Vehicle, load_vehicle

CURRENT = {"v_north": 0.2, "v_east": -0.1}


def stated(**changes):
    return Vehicle.from_dict({**load_vehicle("rov95").to_dict(), **changes}, where="my-rov.yaml")


def spread_of(model, name):
    layout = lay_out(model, ["net_buoyancy"])
    return layout.spreads[name], priors(layout, [name])


def test_a_stated_effect_may_move_by_its_uncertainty_and_no_further():
    vehicle = stated(effects={"ocean_current": {**CURRENT, "uncertainty": {"v_north": 0.02}}})
    from auvnn.models.loading import from_vehicle

    model = from_vehicle(vehicle)
    _, east, down = (p.scale for p in model.effect("ocean_current").parameters_of)
    spread, prior = spread_of(model, "ocean_current")
    # As stated; a tenth of the scale, which is more than a tenth of the value; the same for what is zero.
    assert spread == pytest.approx([0.02, max(0.01, 0.1 * east), 0.1 * down])
    assert prior.precision == pytest.approx(spread**-2.0) and prior.reach == pytest.approx(REACH * spread)
    # Asked for, it is as free as any candidate.
    free = priors(lay_out(model, []), ["ocean_current"], ["ocean_current"])
    assert np.isinf(free.reach).all()


def test_a_tenth_of_a_large_value_is_more_than_a_tenth_of_the_scale():
    model = load("rov95").with_effects({"net_buoyancy": {"force": 60.0}})
    scale = model.effect("net_buoyancy").parameters_of[0].scale
    assert scale < 60.0
    assert lay_out(model, []).spreads["net_buoyancy"] == pytest.approx([6.0])


def test_what_is_exact_unless_stated_can_have_an_uncertainty():
    plain = load("rov95")
    assert not {"net_buoyancy", "thruster_gain", "cg_offset", "trapped_water"} & {
        *lay_out(plain, []).nuisance
    }
    vehicle = load_vehicle("remus100")
    of = {
        **vehicle.uncertainty,
        "buoyancy": 0.01,
        "thrust": 0.05,
        "fins": 0.1,
        "mass": 0.02,
        "center_of_gravity": 0.003,
    }
    layout = lay_out(GreyBox(dataclasses.replace(vehicle, uncertainty=of)), [])
    expected = {
        "net_buoyancy": 0.01 * vehicle.buoyancy, "thruster_gain": 0.05, "fin_gain": 0.1,
        "trapped_water": 0.02 * vehicle.mass, "cg_offset": 0.003 * vehicle.length,
    }  # fmt: skip
    for name, size in expected.items():
        assert name in layout.nuisance and layout.spreads[name] == pytest.approx(
            np.full(len(layout.columns[name]), size)
        )


def test_what_was_fitted_is_saved_with_its_standard_errors(tmp_path):
    model = load("rov95")
    hidden = {"net_buoyancy": {"force": 8.0}}
    log = auvnn.simulate(
        model, "multisine", "realistic", hidden, seed=3, runs=3, duration=15.0, max_step=0.05
    ).log
    better = auvnn.add(model, log, "net_buoyancy", horizons=("5",))
    std = better.parameters["net_buoyancy"]["force"]["std"]
    assert better.model.effect("net_buoyancy").uncertainty == {"force": pytest.approx(std)}
    better.model.save(tmp_path / "better")
    again = load(tmp_path / "better")
    assert again.effect("net_buoyancy").uncertainty == {"force": pytest.approx(std)}
    assert lay_out(again, []).spreads["net_buoyancy"] == pytest.approx([std])
    copied = again.rebuilt(again.copied_effects())
    assert copied.effect("net_buoyancy").uncertainty == again.effect("net_buoyancy").uncertainty


@pytest.mark.parametrize(("given", "words"), [
    ({"v_nort": 0.1}, "no parameter of ocean_current called 'v_nort'. Did you mean 'v_north'"),
    ({"v_north": -0.1}, "my-rov.yaml: effects: ocean_current: uncertainty.v_north is -0.1"),
    (0.1, "my-rov.yaml: effects: ocean_current: uncertainty is 0.1; write"),
])  # fmt: skip
def test_what_is_no_deviation_is_refused(given, words):
    from auvnn.models.loading import from_vehicle

    with pytest.raises((ConfigError, ModelError), match=words):
        from_vehicle(stated(effects={"ocean_current": {**CURRENT, "uncertainty": given}}))
