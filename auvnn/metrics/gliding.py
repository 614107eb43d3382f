"""A log as a reduced model sees it: in its plane, turned by the measured attitude, driven by ballast and moving mass.

What a ballast and the water's density change of the buoyancy acts along the world's vertical, what a moving mass changes
of the weight's place is a moment; both are turned into the body by the measured attitude and stand as a wrench:

    F = -g (rho (V + V_b) - rho_0 V) n,   n = R^T e_z,   V = B / (g rho_0)
    tau = [F, r_cb x F_rho + r_b x F_b + s a x m_p g n]

with V_b the ballast, s the shift of the mass m_p along its axis a. Means over each interval are taken, because a command
is held over it. Reference: Graver (2005), Underwater Gliders: Dynamics, Control and Design, Princeton, chapter 3;
Merckelbach, Berger, Krahmann, Dengler and Carpenter (2019), J. Atmos. Oceanic Technol. 36(2), section 2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs import Run
from auvnn.logs.channels import EULER, POSITION, VELOCITY
from auvnn.logs.signals.differences import of_attitudes
from auvnn.logs.signals.rotation import conjugate, from_euler, multiply, rotate
from auvnn.models import GreyBox
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]
DOWN = np.array([0.0, 0.0, 1.0])
# Share of the angle between integrated and measured attitude that each step takes back.
BACK = 0.3
# Per plane: the angle that is left, and the coordinates that are.
LEFT = {"vertical": ((1,), (2,)), "horizontal": ((2,), (0, 1))}


def in_plane(run: Run, model: GreyBox) -> Run:
    """Return the run without what a plane model has no degree of freedom for, marked as not counting."""
    reduced = model.vehicle.reduced
    if reduced.plane == "full":
        return run
    angles, places = LEFT[reduced.plane]
    euler = np.where(np.isin(np.arange(3), angles), run.euler, 0.0)
    nu = np.where(np.isin(np.arange(6), reduced.kept), run.nu, 0.0)
    marks = [n for k, n in enumerate(VELOCITY) if k not in reduced.kept]
    marks += [n for k, n in enumerate(EULER) if k not in angles]
    marks += [n for k, n in enumerate(POSITION) if k not in places]
    return replace(run, quaternion=from_euler(euler), nu=nu, estimated=(*run.estimated, *marks))


def driven(run: Run, model: GreyBox) -> Run:
    """Return the run with the wrench that moves such a model; itself where the model has thrusters.

    Raises:
        InputError: the log has no ballast, or no shift of the mass, and no wrench.
    """
    vehicle = model.vehicle
    turned = vehicle.reduced.attitude == "measured"
    if not vehicle.glides:
        return run
    for name in ("ballast", "moving_mass"):
        if getattr(vehicle, name) is not None and getattr(run, name) is None:
            raise InputError(
                f"run {run.number} has no column {name}, by which {vehicle.name} is driven: map it"
            )
    own = np.zeros((run.samples, 6)) if run.wrench is None else run.wrench.copy()
    own = own + _held(_of_drives(run, vehicle))
    if turned:
        nu = run.nu.copy()
        nu[:, 3:] = _rates(run)
        own[:, 3:] = _turning(run, nu[:, 3:])
        run = replace(run, nu=nu, given=(*run.given, *EULER), estimated=(*run.estimated, *VELOCITY[3:]))
    return replace(run, wrench=own)


def _of_drives(run: Run, vehicle: Vehicle) -> Array:
    """Return the wrench of ballast, density and moving mass at every sample, (N, 6)."""
    n = rotate(conjugate(run.quaternion), np.broadcast_to(DOWN, (run.samples, 3)))
    stated = float(vehicle.water_density)
    density = run.filled("density")
    density = np.full(run.samples, stated) if density is None else density
    volume = vehicle.buoyancy / (vehicle.gravity * stated)
    pumped = np.zeros(run.samples) if run.ballast is None else run.ballast
    of_water = -vehicle.gravity * ((density - stated) * volume)[:, None] * n
    of_ballast = -vehicle.gravity * (density * pumped)[:, None] * n
    at = np.zeros(3) if vehicle.ballast is None else np.array(vehicle.ballast.position)
    moment = np.cross(vehicle.center_of_buoyancy, of_water) + np.cross(at, of_ballast)
    if vehicle.moving_mass is not None and run.moving_mass is not None:
        weight = vehicle.moving_mass.mass * vehicle.gravity
        shift = run.moving_mass[:, None] * np.array(vehicle.moving_mass.axis)
        moment = moment + weight * np.cross(shift, n)
    return np.concatenate([of_water + of_ballast, moment], axis=1)


def _held(values: Array) -> Array:
    """Return the mean over each interval of what was given at its ends."""
    out = values.copy()
    out[:-1] = 0.5 * (values[:-1] + values[1:])
    return out


def _rates(run: Run) -> Array:
    """Return body rates (N, 3) at the samples; straight lines between them turn the run as its attitude was measured.

    omega_k is the mean rate of the attitude over the steps on both sides, plus a share of the angle by which the attitude
    that these rates add up to has come off the measured one: no error grows along a run.
    """
    middle, mean = of_attitudes(run.t, run.quaternion)
    if len(middle) < 1:
        return np.zeros((run.samples, 3))
    rates = np.stack([np.interp(run.t, middle, mean[:, k]) for k in range(3)], axis=1)
    steps, measured = np.diff(run.t), run.quaternion
    at = measured[0]
    for k, step in enumerate(steps):
        if not np.isfinite(at).all():
            at = measured[k]
        turn = 0.5 * (rates[k] + rates[k + 1]) * step
        at = multiply(at, _small(turn))
        off = 2.0 * multiply(conjugate(at), measured[k + 1])
        if np.isfinite(off).all():
            back = BACK * off[1:] * np.sign(off[0]) / step
            rates[k + 1] += back
            at = multiply(at, _small(0.5 * back * step))
    return rates


def _small(turn: Array) -> Array:
    """Return the quaternion of a rotation vector, (4,)."""
    angle = float(np.linalg.norm(turn))
    return np.concatenate([[np.cos(0.5 * angle)], 0.5 * np.sinc(0.5 * angle / np.pi) * turn])


def _turning(run: Run, rates: Array) -> Array:
    """Return the angular accelerations held over each interval, rad/s2, (N, 3), that give those rates."""
    out = np.zeros_like(rates)
    out[:-1] = np.diff(rates, axis=0) / np.diff(run.t)[:, None]
    return out
