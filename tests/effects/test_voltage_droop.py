"""Voltage droop: against the power law, and where there is nothing to compare with."""

from __future__ import annotations

import pytest
import torch

from auvnn.effects.voltage_droop import VoltageDroop
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

UNIT = {"position": [0, 0, 0], "direction": [1, 0, 0], "max_forward": 40.0, "max_reverse": 30.0}


@pytest.mark.parametrize("volts", [12.0, 14.0, 16.0, 17.5])
def test_thrust_is_the_power_of_the_voltage(level, still, vector, volts):
    model = GreyBox(plain_vehicle(thrusters=[UNIT], reference_voltage=16.0))
    model = model.with_effects({"voltage_droop": {"exponent": 1.2}})
    found = model(level, still, vector(1.0), voltage=torch.tensor(volts, dtype=torch.float64))[0].item()
    assert found == pytest.approx(40 * (volts / 16) ** 1.2 / 70, rel=1e-13)


def test_without_voltage_or_reference_nothing_happens(level, still, vector):
    for vehicle in (plain_vehicle(thrusters=[UNIT]), plain_vehicle(thrusters=[UNIT], reference_voltage=16.0)):
        model = GreyBox(vehicle).with_effects({"voltage_droop": {"exponent": 1.2}})
        given = None if vehicle.reference_voltage else torch.tensor(12.0)
        assert model(level, still, vector(1.0), voltage=given)[0].item() == pytest.approx(40 / 70)
    assert VoltageDroop.lacks(plain_vehicle(), "wrench") == ("reference_voltage",)
    assert VoltageDroop.lacks(plain_vehicle(reference_voltage=16.0), "wrench") == ()
