"""A current of which the drag feels more than the rest: accelerations by hand, and where it does nothing."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.simulation import simulate
from auvnn.testing import plain_vehicle

DRAG = [30.0, 60.0, 70.0, 2.0, 3.0, 4.0]
CURRENT = {"v_north": 0.3, "v_east": -0.2, "v_down": 0.1}
NU = np.array([0.5, 0.1, -0.1, 0.1, 0.2, 0.4])
TURNED = Rotation.from_euler("ZYX", [0.7, 0.2, -0.1])


def vehicle():
    return plain_vehicle(linear_damping=DRAG)


def acceleration(model):
    x, y, z, w = TURNED.as_quat()
    eta = torch.tensor([1.0, 2.0, 5.0, w, x, y, z], dtype=torch.float64)
    with torch.no_grad():
        return model(eta, torch.tensor(NU), torch.zeros(6, dtype=torch.float64)).numpy()


def by_hand(share):
    """Momentum of the body and impulse of the water, each with its own velocity: (P, L) turns with the body."""
    known = vehicle()
    v, turn = NU[:3], NU[3:]
    stream = TURNED.inv().apply(list(CURRENT.values()))
    felt = v - (1.0 - share) * stream
    added = np.diag(known.added_mass)
    impulse, spin = added[:3] * felt, added[3:] * turn
    inertia = np.diag(known.inertia)
    force = -np.cross(turn, known.mass * v) - np.cross(turn, impulse)
    moment = -np.cross(turn, inertia * turn) - np.cross(turn, spin) - np.cross(felt, impulse)
    # The stream turns in the body's axes: its part of the impulse changes without any force on the body.
    force = force - (1.0 - share) * added[:3] * np.cross(turn, stream)
    drag = -np.array(DRAG) * np.concatenate([v - stream, turn])
    total = np.concatenate([known.mass + added[:3], inertia + added[3:]])
    return (np.concatenate([force, moment]) + drag) / total


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_the_drag_feels_the_whole_current_and_the_rest_a_share(share):
    model = GreyBox(vehicle(), actuation="wrench").with_effects(
        {"ocean_current": CURRENT, "drag_only_current": {"share": share}}
    )
    assert acceleration(model) == pytest.approx(by_hand(share), rel=1e-12, abs=1e-14)


def test_it_does_nothing_in_still_water():
    bare = GreyBox(vehicle(), actuation="wrench")
    assert np.array_equal(
        acceleration(bare.with_effects({"drag_only_current": {"share": 0.7}})), acceleration(bare)
    )


def test_learned_drag_feels_the_whole_current():
    bank = DampingBank.from_description("mlp", seed=1)
    bank.set_scales(torch.randn(20, 6).double(), 20.0 * torch.randn(20, 6).double())
    with torch.no_grad():
        for p in bank.parameters():
            p.add_(0.3)
    water = {"ocean_current": CURRENT}
    for damping in (None, bank):
        whole = GreyBox(vehicle(), damping=damping, actuation="wrench").with_effects(water)
        part = whole.with_effects({"drag_only_current": {"share": 1.0}})
        change = acceleration(part) - acceleration(whole)
        # What the share changes is the water's inertia, whatever the drag is.
        assert change == pytest.approx(by_hand(1.0) - by_hand(0.0), rel=1e-9, abs=1e-12)


def test_alone_it_cannot_be_hidden():
    how = dict(runs=1, duration=2.0, rate=20.0)
    with pytest.raises(ConfigError, match="hide ocean_current, current_shear or waves with it"):
        simulate("rov95", "multisine", "none", {"drag_only_current": None}, **how)
    made = simulate("rov95", "multisine", "none", {"drag_only_current": None, "ocean_current": None}, **how)
    assert {*made.truth["hidden"]} == {"drag_only_current", "ocean_current"}
