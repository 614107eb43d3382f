"""How hard a vehicle may be driven: wrench and fins by its thrusters, its drag and its stiffness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.models import GreyBox, Inputs
from auvnn.models.equations_of_motion import DRAG_TERMS
from auvnn.simulation.allocation import Allocation
from auvnn.simulation.cruise import Cruise, cruise
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]

# Speeds aimed at where no thruster sets the limit, for a vehicle of one metre.
SPEED, TURN = 0.5, 0.4
# Speed that a controller stays below, as a share of that at which the hull's own moment overturns it: where
# nothing but the restoring moment holds the pitch, and where thrusters help.
TIPPING, TIPPING_HELD = 0.7, 1.2
# Mean thrust of vehicles that must move to be steered, as a share of the most they have.
MEAN = 0.82
_LEANING = np.array([False, False, False, True, True, False])


@dataclass(frozen=True)
class Limits:
    """Ranges for open-loop driving.

    Attributes:
        wrench: peak of each degree of freedom, N and N m, (6,); roll and pitch no more than leaning needs.
        range: largest wrench of each degree of freedom alone, for a controller, (6,); zero out of reach.
        trim: wrench that carries what weight and buoyancy leave over, (6,).
        mean: constant share of the surge force, for vehicles that must move to be steered.
        fins: number of fins that are driven.
        angle: largest departure of the fins from their trim, rad, (fins,).
        steady: how a vehicle that must move to be steered holds its depth, or None.
        allocation: the thrusters, or None where the wrench is commanded.
        reference_voltage: V, or None.
    """

    wrench: Array
    range: Array
    trim: Array
    mean: float
    fins: int
    angle: Array
    steady: Cruise | None
    allocation: Allocation | None
    reference_voltage: float | None

    def drive(self, unit: Array, effort: Array | float, tilt: Array | float) -> tuple[Array, Array | None]:
        """Return commands (..., n) and fin angles (..., m) from signals with peak one (..., 6 + m).

        Args:
            unit: signals of the six degrees of freedom, then of the fins.
            effort: share of the thrusters' limits at the peak.
            tilt: factor on roll, pitch and fins beside it.
        """
        wrench = self.wrench * unit[..., :6]
        if self.mean:
            wrench[..., 0] = self.wrench[0] * (self.mean + (1.0 - self.mean) * unit[..., 0])
        wrench = wrench * np.where(_LEANING, tilt, 1.0)
        fins = None
        if self.fins:
            fins = self.angle * (tilt * unit[..., 6:]) + (0.0 if self.steady is None else self.steady.fins)
        if self.allocation is None:
            return self.trim + effort * wrench, fins
        thrust = self.allocation.thrust(wrench)
        base = self.allocation.thrust(self.trim)
        # The largest factor at which no thruster leaves its limits, over the whole run.
        high = np.maximum(self.allocation.high - base, 1e-9)
        low = np.minimum(self.allocation.low - base, -1e-9)
        peak = np.abs(thrust / np.where(thrust > 0, high, low)).max(axis=(-1, -2), keepdims=True)
        return self.allocation.command(base + effort * thrust / np.maximum(peak, 1e-12)), fins

    def voltage(self, shape: tuple[int, ...], times: Array) -> torch.Tensor | None:
        """Return the reference voltage all along, (..., T), or None."""
        if self.reference_voltage is None:
            return None
        return torch.full((*shape, len(times)), float(self.reference_voltage), dtype=torch.float64)


def drag_at(model: GreyBox, nu: Array) -> Array:
    """Return the resistance at velocities nu (..., 6) through still water, N and N m, (..., 6)."""
    with torch.no_grad():
        moving = torch.tensor(np.ascontiguousarray(nu))
        lead = moving.shape[:-1]
        still = torch.zeros((*lead, 3), dtype=torch.float64)
        level = torch.eye(3, dtype=torch.float64).expand(*lead, 3, 3)
        nothing = Inputs(torch.zeros((*lead, model.actuators.size), dtype=torch.float64))
        time = torch.zeros(lead, dtype=torch.float64)
        terms = model.wrenches(still, level, moving, nothing.command, nothing, time)
        total = torch.zeros_like(moving)
        for name, term in terms.items():
            if name in DRAG_TERMS:
                total = total - term
        return total.numpy()


def limits_of(model: GreyBox) -> Limits:
    """Return the limits of a model's vehicle."""
    vehicle = model.vehicle
    by_drag = _drag_limits(model)
    allocation = Allocation(vehicle) if model.actuation == "thrusters" else None
    # Enough to lean by half a radian against the restoring moment, and to turn against the drag.
    lean = 0.5 * vehicle.weight * _arm(vehicle) + by_drag[3:5]
    if allocation is None:
        wrench, most = by_drag.copy(), 2.0 * by_drag
        wrench[3:5] = lean
    else:
        wrench, most = allocation.limits.copy(), 0.7 * allocation.limits
        wrench[3:5] = np.minimum(wrench[3:5], 2.0 * lean)
    trim = np.zeros(6)
    cruising = allocation is not None and bool(vehicle.fins) and np.count_nonzero(allocation.limits) < 4
    if not cruising and (allocation is None or allocation.limits[2] > 0):
        trim[2] = vehicle.buoyancy - vehicle.weight
        if allocation is not None:
            trim[2] = np.clip(trim[2], -0.3 * allocation.limits[2], 0.3 * allocation.limits[2])
    fins = len(vehicle.fins)
    # A commanded wrench stands for all that moves the vehicle: fins are then held at zero.
    angle, steady = np.array([0.8 * f.stall * (allocation is not None) for f in vehicle.fins]), None
    if cruising and allocation is not None:
        surge = np.array([MEAN * wrench[0], 0, 0, 0, 0, 0])
        most = 0.95 * allocation.limits
        steady = cruise(model, allocation.command(allocation.thrust(surge)))
        angle = angle - np.abs(steady.fins)
    mean = MEAN if cruising else 0.0
    return Limits(wrench, most, trim, mean, fins, angle, steady, allocation, vehicle.reference_voltage)


def _arm(vehicle: Vehicle) -> float:
    return max(1e-3, float(vehicle.center_of_gravity[2] - vehicle.center_of_buoyancy[2]))


def _drag_limits(model: GreyBox) -> Array:
    """Return the wrench that holds a moderate speed in each degree of freedom alone."""
    length = model.vehicle.length
    speeds = np.array([SPEED * np.sqrt(length)] * 3 + [TURN / np.sqrt(length)] * 3)
    drag = np.diagonal(drag_at(model, np.diag(speeds))).copy()
    # Where no damping is stated, that of a bluff body of this size.
    rho = model.vehicle.water_density
    bluff = 0.5 * rho * np.array([*0.5 * length**2 * speeds[:3] ** 2, *0.02 * length**5 * speeds[3:] ** 2])
    return np.where(drag > 1e-6, drag, bluff)


def top_speed(model: GreyBox, limits: Limits) -> float:
    """Return the forward speed up to which a controller keeps the vehicle in hand, m/s.

    There drag takes all the surge force that it may use, or the hull's moment (A33 - A11) u w outgrows the
    restoring moment W BG sin(theta) as w = u tan(theta) at level travel: u^2 = W BG / (A33 - A11).
    """
    speeds = np.linspace(0.0, 5.0, 501)
    nu = np.zeros((len(speeds), 6))
    nu[:, 0] = speeds
    enough = drag_at(model, nu)[:, 0] >= limits.range[0]
    top = speeds[enough.argmax()] if enough.any() else SPEED * np.sqrt(model.vehicle.length)
    broad = model.vehicle.added_mass[2, 2] - model.vehicle.added_mass[0, 0]
    if limits.steady is None and broad > 0:
        share = TIPPING_HELD if limits.range[4] > 0 else TIPPING
        top = min(top, share * np.sqrt(model.vehicle.weight * _arm(model.vehicle) / broad))
    return float(top)
