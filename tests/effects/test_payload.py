"""Payload: against a vehicle that was built with the load, before and after, and the impulse of the grasp."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.effects import Extent, effect_class
from auvnn.models import GreyBox
from auvnn.physics.attitude import euler_to_quat
from auvnn.testing import make_scene, plain_vehicle

PLACE, MASS, LIFT, WHEN = np.array([0.2, -0.1, 0.45]), 12.0, 30.0, 15.0
VALUES = {"time": WHEN, "mass": MASS, "buoyancy": LIFT, **dict(zip("xyz", PLACE.tolist(), strict=True))}
KNOWN = {"center_of_gravity": [0.02, 0.0, 0.03], "quadratic_damping": [20.0, 30, 40, 2, 3, 4]}


def inertia_with_load() -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass, centre and inertia about it of vehicle and load, from their 6x6 matrices at the origin."""
    bare = plain_vehicle(**KNOWN)

    def screw(r):
        h = np.eye(6)
        h[:3, 3:] = -np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
        return h

    point = np.diag([MASS] * 3 + [0.0] * 3)
    whole = bare.rigid_body + screw(PLACE).T @ point @ screw(PLACE)
    mass = whole[0, 0]
    centre = np.array([whole[4, 2] / -mass, whole[3, 2] / mass, whole[4, 0] / mass])
    centre[2] = whole[4, 0] / mass
    back = screw(-centre).T @ whole @ screw(-centre)
    assert np.abs(back[:3, 3:]).max() < 1e-12
    return mass, centre, back[3:, 3:]


def test_after_the_grasp_it_is_the_vehicle_with_the_load():
    mass, centre, inertia = inertia_with_load()
    bare = plain_vehicle(**KNOWN)
    lifted = (bare.buoyancy * bare.center_of_buoyancy + LIFT * PLACE) / (bare.buoyancy + LIFT)
    loaded = plain_vehicle(
        mass=mass, center_of_gravity=centre.tolist(), inertia=(0.5 * (inertia + inertia.T)).tolist(),
        buoyancy=bare.buoyancy + LIFT, center_of_buoyancy=lifted.tolist(),
        quadratic_damping=KNOWN["quadratic_damping"],
    )  # fmt: skip
    truth = GreyBox(loaded, actuation="wrench")
    before = GreyBox(bare, actuation="wrench")
    model = before.with_effects({"payload": VALUES})
    scene = make_scene(bare, "wrench", runs=10)
    row = scene.inputs.each()[0]
    with torch.no_grad():
        for reference, time in ((before, WHEN - 5), (truth, WHEN + 5)):
            expected = reference(scene.eta, scene.nu, row.command)
            found = model(scene.eta, scene.nu, row.command, time=time)
            torch.testing.assert_close(found, expected, rtol=1e-9, atol=1e-10)


def test_the_drag_grows_by_its_factors(plain, level, vector, still):
    drag = [20.0, 30, 40, 2, 3, 4]
    factors = {"X": 1.5, "Y": 0.7, "Z": 2.0, "K": 1.1, "M": 3.0, "N": 0.5}
    model = plain({"payload": {"time": 1.0, **factors}}, quadratic_damping=drag)
    for axis in range(6):
        nu = still.clone()
        nu[axis] = 0.4
        expected = -list(factors.values())[axis] * drag[axis] * 0.16 / [70, 80, 90, 3, 4.5, 6.5][axis]
        assert model(level, nu, still, time=50.0)[axis].item() == pytest.approx(expected)


def test_the_grasp_conserves_momentum(plain, level, vector):
    """A load at the origin that was at rest: (M + A) u before is (M + A + m_p) u after."""
    model = plain({"payload": {"time": 2.0, "mass": 14.0, "buoyancy": 14.0 * 9.81}})
    times = torch.arange(0, 5, 0.02, dtype=torch.float64)
    run = model.rollout(level, vector(0.5, 0, 0, 0, 0, 0), torch.zeros(250, 6, dtype=torch.float64), times)
    assert run.nu[-1, 0].item() == pytest.approx(0.5 * 70 / 84, rel=1e-6)
    assert run.nu[-1, 1:].abs().max().item() < 1e-9


def test_the_first_orientation_does_not_matter():
    """Turning the world about the vertical turns nothing in the body."""
    model = GreyBox(plain_vehicle(**KNOWN), actuation="wrench").with_effects({"payload": VALUES})
    nu = torch.tensor([0.3, -0.2, 0.1, 0.2, -0.1, 0.3], dtype=torch.float64)
    rates = []
    for heading in (0.0, 2.0):
        euler = torch.tensor([0.3, -0.2, heading], dtype=torch.float64)
        eta = torch.cat([torch.zeros(3, dtype=torch.float64), euler_to_quat(euler)])
        rates.append(model(eta, nu, torch.zeros(6, dtype=torch.float64), time=WHEN))
    torch.testing.assert_close(rates[0], rates[1], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(
    ("time", "seen"),
    [(0.0, False), (0.9, False), (1.1, True), (30.0, True), (59.5, False), (75.0, False), (130.0, True)],
)
def test_a_load_is_taken_within_what_was_recorded(time, seen):
    # Two dives, with a pause between them.
    extent = Extent(0.0, 160.0, 60.0, (3.0, 8.0), ((0.0, 60.0), (0.0, 40.0), (100.0, 160.0)))
    assert effect_class("payload").happens({**VALUES, "time": time}, extent) is seen
    assert effect_class("net_buoyancy").happens({"force": 3.0}, extent)
