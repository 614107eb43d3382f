"""Fin stall: against a vehicle whose file states the other angle."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import torch

from auvnn.effects.fin_stall import FinStall
from auvnn.models import GreyBox, load
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


def test_effects_on_the_lift_act_together():
    """A share of the lift with the late stall at the true angle: as of a vehicle whose file and log say all that."""
    vehicle = example_vehicle()
    fins = [replace(f, stall=1.4 * f.stall, area=0.6 * f.area) for f in vehicle.fins]
    scene = make_scene(vehicle, "thrusters", runs=20)
    row = scene.inputs.each()[0]
    names = [f"fin_{i + 1}" for i in range(len(fins))]
    changes = {
        "fin_gain": dict.fromkeys(names, 0.6),
        "fin_stall": {"factor": 1.4},
        "fin_offset": dict.fromkeys(names, 0.04),
    }
    expected = GreyBox(replace(vehicle, fins=tuple(fins)))(
        scene.eta, scene.nu, row.command, fins=row.fins + 0.04
    )
    for order in permutations(changes):
        model = GreyBox(vehicle).with_effects({n: changes[n] for n in order})
        found = model(scene.eta, scene.nu, row.command, fins=row.fins)
        torch.testing.assert_close(found, expected, rtol=1e-10, atol=1e-12)


def test_a_model_saved_with_the_stall_angle_alone_is_still_read(tmp_path):
    model = GreyBox(example_vehicle()).with_effects({"fin_stall": {"factor": 1.3}})
    model.save(tmp_path)
    text = (tmp_path / "model.yaml").read_text()
    assert "{factor: 1.3, separated: 1.0, sharpness: 1.0, crossflow: 0.0}" in text
    (tmp_path / "older.yaml").write_text(
        text.replace(", separated: 1.0, sharpness: 1.0, crossflow: 0.0", "").replace(
            "actuation: thrusters\n", ""
        )
    )
    (effect,) = load(tmp_path / "older.yaml").members
    assert effect.values() == {"factor": 1.3, "separated": 1.0, "sharpness": 1.0, "crossflow": 0.0}


def test_a_vehicle_without_fins_lacks_them():
    assert FinStall.lacks(plain_vehicle(), "wrench") == ("fins",)
