"""Coupled damping: against drag that acts off the origin, and SNAME's signs one by one."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from auvnn.effects.coupled_damping import NAMES
from auvnn.models import GreyBox
from auvnn.testing import example_vehicle, make_scene, plain_vehicle

INERTIA = dict(zip("XYZKMN", [70, 80, 90, 3, 4.5, 6.5], strict=True))


@pytest.mark.parametrize("name", NAMES)
def test_each_pushes_where_its_name_says(plain, level, still, name):
    model = plain({"coupled_damping": {name: 0.7}}, quadratic_damping=[1.0] * 6)
    nu = still.clone()
    nu["uvwpqr".index(name[1])] = -0.4
    rate = model(level, nu, still) - plain(quadratic_damping=[1.0] * 6)(level, nu, still)
    expected = torch.zeros(6, dtype=torch.float64)
    expected["XYZKMN".index(name[0])] = 0.7 * 0.4 * -0.4 / INERTIA[name[0]]
    torch.testing.assert_close(rate, expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("x, z", [(-0.4, 0.0), (0.15, -0.2)])
def test_drag_off_the_origin_is_what_it_stands_for(level, still, x, z):
    """Translating without turning, an element at (x, 0, z) gives the moments of its lever arm: r x f."""
    drag = [12.0, 15.0, 20.0, 0.0, 0.0, 0.0]
    element = {"position": [x, 0.0, z], "axes": np.eye(3).tolist(), "linear": [0.0] * 6, "quadratic": drag}
    truth = GreyBox(plain_vehicle(damping_elements=[element]), actuation="wrench")
    moments = {"Kv": z * drag[1], "Nv": -x * drag[1], "Mw": x * drag[2], "Mu": -z * drag[0]}
    central = GreyBox(plain_vehicle(quadratic_damping=drag), actuation="wrench")
    model = central.with_effects({"coupled_damping": moments})
    for nu in np.random.default_rng(0).normal(size=(20, 3)):
        nu = torch.tensor([*nu, 0.0, 0.0, 0.0])
        torch.testing.assert_close(model(level, nu, still), truth(level, nu, still), rtol=1e-12, atol=1e-12)


def test_the_stern_trails(plain, level, still, vector):
    """With its drag aft a vehicle that slips to starboard turns its bow to starboard, into the motion."""
    model = plain({"coupled_damping": {"Nv": 0.4 * 15.0}}, quadratic_damping=[0, 15, 0, 0, 0, 0])
    assert model(level, vector(0, 0.5, 0, 0, 0, 0), still)[5] > 0


def test_it_counts_speed_through_the_water():
    vehicle = example_vehicle()
    scene = make_scene(vehicle, "thrusters")
    row = scene.inputs.each()[0]
    values = {"Nv": 8.0, "Zq": -3.0}
    models = [GreyBox(vehicle), GreyBox(vehicle).with_effects({"coupled_damping": values})]
    current = {"v_north": 0.3, "v_east": -0.2}
    models += [m.with_effects({"ocean_current": current}) for m in models]
    still, moving = (
        [m(scene.eta, scene.nu, row.command, fins=row.fins) for m in pair]
        for pair in (models[:2], models[2:])
    )
    q = scene.eta[:, 3:].numpy()
    turn = Rotation.from_quat(q[:, [1, 2, 3, 0]])
    relative = scene.nu.numpy().copy()
    relative[:, :3] -= turn.inv().apply([0.3, -0.2, 0.0])
    force = np.zeros_like(relative)
    force[:, 5] = 8.0 * np.abs(relative[:, 1]) * relative[:, 1]
    force[:, 2] = -3.0 * np.abs(relative[:, 4]) * relative[:, 4]
    expected = force @ np.linalg.inv(vehicle.inertia_matrix).T
    np.testing.assert_allclose((moving[1] - moving[0]).detach().numpy(), expected, rtol=1e-9, atol=1e-12)
    assert not torch.allclose(moving[1] - moving[0], still[1] - still[0])
