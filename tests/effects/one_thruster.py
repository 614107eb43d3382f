"""A vehicle at rest with one thruster, what it pushes with, and the table of a real one."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import torch

from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

MASS = 70.0
UNIT = {"position": [0, 0, 0], "direction": [1, 0, 0], "max_forward": 40.0, "max_reverse": 30.0}
ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(os.environ.get("AUVNN_DATA", ROOT.parent / "shared" / "data")) / "t200" / "static.csv"
needs_table = pytest.mark.skipif(
    not TABLE.exists(), reason="the T200's table is not here: set AUVNN_DATA to the folder above t200/"
)


def model_with(effects):
    """Return the model of the vehicle with effects."""
    return GreyBox(plain_vehicle(thrusters=[UNIT])).with_effects(effects)


def thrust(model, command):
    """Return the force, N, of the vehicle at rest at one command, or at each of many, (n,)."""
    given = torch.as_tensor(command, dtype=torch.float64).unsqueeze(-1)
    rest = torch.zeros(*given.shape[:-1], 6, dtype=torch.float64)
    return model(rest, rest, given)[..., 0] * MASS


def measured():
    """Yield commands and forces, kgf, of the T200 at each voltage, (n,) each, but for those close to zero."""
    table = np.genfromtxt(TABLE, delimiter=",", names=True)
    for voltage in np.unique(table["voltage_V"]):
        rows = table[table["voltage_V"] == voltage]
        command = (rows["pwm_us"] - 1500.0) / 400.0
        moving = np.abs(command) > 0.02
        yield command[moving], rows["force_kgf"][moving]
