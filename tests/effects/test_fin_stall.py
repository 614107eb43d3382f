"""Fin stall: against a vehicle whose file states the other angle."""

from __future__ import annotations

from dataclasses import replace

import torch

from auvnn.effects.fin_stall import FinStall
from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene, plain_vehicle


def test_it_is_the_vehicle_with_that_stall():
    vehicle = example_vehicle()
    other = replace(vehicle, fins=tuple(replace(f, stall=0.7 * f.stall) for f in vehicle.fins))
    scene = make_scene(vehicle, "thrusters", runs=20)
    row = scene.inputs.each()[0]
    model = GreyBox(vehicle).with_effects({"fin_stall": {"factor": 0.7}})
    with torch.no_grad():
        found, expected, nominal = (
            m(scene.eta, scene.nu, row.command, fins=row.fins)
            for m in (model, GreyBox(other), GreyBox(vehicle))
        )
    torch.testing.assert_close(found, expected, rtol=1e-12, atol=1e-13)
    assert (found - nominal).abs().max() > 1e-3


def test_a_vehicle_without_fins_lacks_them():
    assert FinStall.lacks(plain_vehicle(), "wrench") == ("fins",)
