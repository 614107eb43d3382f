"""Models that exports are measured on: the built-in vehicles, and models with everything that is hard to write out."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import torch

from auvnn.damping.bank import DampingBank
from auvnn.models import GreyBox, load
from auvnn.testing import example_vehicle

LAG = {"thruster_lag": {"time_constant": 0.15}}
LATE = {"actuation_delay": {"delay": 0.13}}
TURNING = {"propeller_lag": {"time_constant": 0.2}}
OVER = {"thrust_overshoot": {"time_constant": 0.8, "thruster_1": 0.4, "thruster_3": -0.2}}
VEHICLES = ("bluerov2", "bluerov2_heavy", "remus100", "rov90", "rov95")
OTHERS = ("networks", "actuators", "everything", "payload")
DAMPING = {"form": "mlp", "each": {"K": "zero", "M": "polynomial", "N": "dissipative"}}


@lru_cache(maxsize=1)
def trained_like():
    """Return subnetworks of several forms away from their start."""
    bank = DampingBank.from_description(DAMPING, seed=1)
    generator = torch.Generator().manual_seed(4)
    with torch.no_grad():
        for parameter in bank.parameters():
            parameter.add_(0.2 * torch.randn(parameter.shape, generator=generator, dtype=torch.float64))
        bank.input_scale.copy_(torch.tensor([0.7, 0.5, 0.4, 0.3, 0.3, 0.6], dtype=torch.float64))
        bank.output_scale.copy_(torch.tensor([3.0, 4.0, 5.0, 0.3, 0.4, 0.5], dtype=torch.float64))
    return bank


@lru_cache(maxsize=16)
def model(name):
    """Return a model by name; not to be changed."""
    if name == "networks":
        return GreyBox(load("rov95").vehicle, (), trained_like())
    if name == "actuators":
        more = {
            "thruster_deadband": {"width": 0.05},
            "thrust_curve": {"thruster_1_positive": 0.8},
            "thrust_polynomial": {"thruster_2_degree_2": 0.1, "thruster_3_degree_3": -0.1},
        }
        return load("bluerov2").with_effects({**LAG, **LATE, **TURNING, **OVER, **more})
    if name == "payload":
        held = {"time": 10.0, "mass": 2.0, "x": 0.2, "buoyancy": 5.0, "X": 1.3}
        return load("rov90").with_effects(
            {"payload": held, "flooding": {"rate": 0.02}, "tether": {"stiffness": 20.0}}
        )
    if name == "everything":
        # Full matrices, damping elements, a thrust table, fins, networks; effects by every hook.
        return GreyBox(example_vehicle(), (), trained_like()).with_effects({
            **LAG, "ocean_current": {"v_north": 0.2, "v_east": -0.1}, "waves": {"amplitude": 0.2},
            "drag_only_current": {"share": 0.3},
            "voltage_droop": {"exponent": 1.2}, "bottom_proximity": {"strength": 0.4},
            "fin_stall": {"factor": 1.5, "separated": 0.6, "sharpness": 0.4, "crossflow": 0.5},
            "fin_gain": {"fin_1": 0.7},
            "body_lift": {"Yuv": 3.0}, "body_lift_stall": {"share": 0.4},
            "compressibility": {"per_metre": 1e-3}, "propeller_torque": {"coefficient": 0.02},
            "thrust_inflow_loss": {"coefficient": 2.0}, "cross_flow_drag": None,
        })  # fmt: skip
    return load(name)


def differs(mine, theirs):
    """Return the largest difference, relative to the largest element of each column.

    A column below 1e-5 of the largest element is held to that: below it 1e-9 of a column is under double precision.
    """
    mine, theirs = np.asarray(mine, dtype=float), np.asarray(theirs, dtype=float)
    size = np.abs(theirs).max(axis=0)
    return float((np.abs(mine - theirs).max(axis=0) / np.maximum(size, 1e-5 * max(size.max(), 1e-30))).max())
