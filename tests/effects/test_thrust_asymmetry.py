"""An asymmetry of the thrust: its two sides by hand, and the mean force that it leaves where the command swings."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.diagnosis.selection.model_comparison import forms_that_leave
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

THRUSTER = {
    "position": [0.0, 0.0, 0.0],
    "direction": [1.0, 0.0, 0.0],
    "max_forward": 100.0,
    "max_reverse": 60.0,
}


def thrust(command, lean=0.2, **more):
    """Return the thrust, N, at a command and at rest."""
    vehicle = plain_vehicle(thrusters=[THRUSTER])
    model = GreyBox(vehicle).with_effects({"thrust_asymmetry": {"thruster_1": lean}, **more})
    eta, nu = torch.tensor([0.0, 0, 5, 1, 0, 0, 0]).double(), torch.zeros(6).double()
    with torch.no_grad():
        rate = model(eta, nu, torch.tensor([command]).double())
    return float(rate[0]) * 70.0


def test_more_ahead_and_less_astern():
    assert thrust(1.0) == pytest.approx(120.0, rel=1e-10)
    assert thrust(-1.0) == pytest.approx(-48.0, rel=1e-10)
    assert thrust(0.5, lean=-0.2) == pytest.approx(20.0, rel=1e-10)
    assert thrust(-0.5, lean=-0.2) == pytest.approx(-18.0, rel=1e-10)
    assert thrust(0.0) == 0.0


def test_a_swinging_command_leaves_a_mean_force():
    # A half period of c^2 = sin^2 makes a quarter of the whole period's mean: (1 + a) 100 / 4 - (1 - a) 60 / 4.
    phases = 2.0 * np.pi * (np.arange(64) + 0.5) / 64
    mean = np.mean([thrust(float(np.sin(p))) for p in phases])
    assert mean == pytest.approx(1.2 * 25.0 - 0.8 * 15.0, rel=1e-7)


@pytest.mark.parametrize("form", ["thrust_asymmetry", "thrust_curve"])
def test_up_and_down_a_mean_force_of_the_form_is_a_weight(form):
    """Over a period of a vertical thruster the thrust changes, in the mean, by what a net buoyancy is."""
    vehicle = plain_vehicle(thrusters=[{**THRUSTER, "direction": [0.0, 0.0, 1.0]}])
    own = {"thruster_1": 0.2} if form == "thrust_asymmetry" else {"thruster_1_positive": 0.8}
    eta, nu = torch.tensor([0.0, 0, 5, 1, 0, 0, 0]).double(), torch.zeros(6).double()
    phases = torch.arange(64).double() / 64 * 2.0 * np.pi
    command = torch.sin(phases)[:, None]
    plain, curved = GreyBox(vehicle), GreyBox(vehicle).with_effects({form: own})
    with torch.no_grad():
        change = (curved(eta, nu, command) - plain(eta, nu, command)).mean(0)
        lighter = GreyBox(vehicle).with_effects({"net_buoyancy": {"force": 10.0}})
        weight = lighter(eta, nu, command[:1])[0] - plain(eta, nu, command[:1])[0]
    along = change @ weight / (weight @ weight)
    assert abs(float(along)) > 0.1
    assert torch.allclose(change, along * weight, atol=1e-12)
    assert forms_that_leave("net_buoyancy", ["payload", form]) == [form]


def test_with_a_gain_it_gives_each_direction_its_own_factor():
    gain = {"thruster_gain": {"thruster_1": 1.1}}
    assert thrust(1.0, **gain) == pytest.approx(100.0 * 1.1 * 1.2, rel=1e-10)
    assert thrust(-1.0, **gain) == pytest.approx(-60.0 * 1.1 * 0.8, rel=1e-10)
