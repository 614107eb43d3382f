"""Fins' gain, offset and drag: against vehicles whose files say the same, and against drag worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.effects.fin_drag import FinDrag
from auvnn.effects.fin_gain import FinGain
from auvnn.effects.fin_offset import FinOffset
from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene, plain_vehicle

FIN = {"position": [-0.6, 0.0, 0.2], "axis": [0.0, 0.0, 1.0], "area": 0.01, "lift_slope": 3.0, "stall": 0.3}


def rates(model, scene, fins):
    with torch.no_grad():
        return model(scene.eta, scene.nu, scene.inputs.each()[0].command, fins=fins)


def test_a_gain_is_the_vehicle_with_fins_of_that_area():
    vehicle = example_vehicle()
    other = replace(
        vehicle,
        fins=tuple(replace(f, area=k * f.area) for f, k in zip(vehicle.fins, (0.6, 1.4), strict=True)),
    )
    scene = make_scene(vehicle, "thrusters", runs=20)
    fins = scene.inputs.each()[0].fins
    model = GreyBox(vehicle).with_effects({"fin_gain": {"fin_1": 0.6, "fin_2": 1.4}})
    torch.testing.assert_close(
        rates(model, scene, fins), rates(GreyBox(other), scene, fins), rtol=1e-12, atol=1e-13
    )


def test_an_offset_is_the_same_fins_at_those_angles():
    vehicle = example_vehicle()
    scene = make_scene(vehicle, "thrusters", runs=20)
    fins = scene.inputs.each()[0].fins
    model = GreyBox(vehicle).with_effects({"fin_offset": {"fin_1": 0.07, "fin_2": -0.03}})
    turned = fins + torch.tensor([0.07, -0.03], dtype=torch.float64)
    expected = rates(GreyBox(vehicle), scene, turned)
    torch.testing.assert_close(rates(model, scene, fins), expected, rtol=1e-12, atol=1e-13)
    assert (expected - rates(GreyBox(vehicle), scene, fins)).abs().max() > 1e-3


def test_drag_of_a_fin_is_that_of_its_coefficients():
    # Straight ahead at 1.5 m/s with the rudder at 0.1 rad, far from its stall: C_L = 3 * 0.1, by hand.
    vehicle = plain_vehicle(fins=[FIN])
    state = torch.tensor([0.0, 0, 5, 1, 0, 0, 0]).double()
    nu, still = torch.tensor([1.5, 0, 0, 0, 0, 0]).double(), torch.zeros(6).double()
    angle = torch.tensor([0.1]).double()
    bare = GreyBox(vehicle, actuation="wrench")
    with torch.no_grad():
        change = [
            (
                bare.with_effects({"fin_drag": values})(state, nu, still, fins=angle)
                - bare(state, nu, still, fins=angle)
            )
            for values in ({"zero_lift": 0.04}, {"induced": 0.2})
        ]
    size = 0.5 * 1000.0 * 0.01 * 1.5**2
    forces = [vehicle.inertia_matrix @ c.numpy() for c in change]
    assert forces[0] == pytest.approx([-size * 0.04, 0, 0, 0, -size * 0.04 * 0.2, 0], abs=1e-12)
    # The profile stalls smoothly: at a third of the angle, by less than a thousandth.
    assert forces[1][0] == pytest.approx(-size * 0.2 * 0.3**2, rel=2e-3)


def test_drag_takes_energy_wherever_the_flow_comes_from():
    vehicle = replace(example_vehicle(), buoyancy=example_vehicle().weight)
    scene = make_scene(vehicle, "wrench", runs=50)
    fins = scene.inputs.each()[0].fins
    bare = GreyBox(vehicle, actuation="wrench")
    change = rates(bare.with_effects({"fin_drag": {"zero_lift": 0.1, "induced": 0.5}}), scene, fins)
    force = (change - rates(bare, scene, fins)).numpy() @ vehicle.inertia_matrix.T
    assert np.all((force * scene.nu.numpy()).sum(1) < 0.0)


@pytest.mark.parametrize("kind", [FinGain, FinOffset, FinDrag])
def test_a_vehicle_without_fins_lacks_them(kind):
    assert kind.lacks(plain_vehicle(), "wrench") == ("fins",)
