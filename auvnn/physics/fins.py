"""Control fins: lift from the local flow, with a smooth stall."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from auvnn.physics.products import ProductTable, cross, matvec, per_vector
from auvnn.shapes import FinFrame, Number, PerPart, Scalar, Vectors3, Velocity, Wrench

_FORWARD = ProductTable([[1.0, 0.0, 0.0]])

SHARPNESS = 12.0
"""Stall angle over the width of the transition from attached to separated flow (50 per rad at 14 degrees)."""


def fin_frame(position: Vectors3, axis: Vectors3) -> FinFrame:
    """Return per fin the two rows that turn nu_r into the flow in the fin's plane; constant for a vehicle.

    Rows [e, r x e] and [b, r x b]: e is the body's forward direction x without its part along the axis a,
    normalised, the chord of the fin at angle zero; b = a x e is where a positive angle takes the leading
    edge.

    Args:
        position: of the fins in body axes, m (..., n, 3).
        axis: unit vectors about which a positive angle turns the fins (..., n, 3), not along x.

    Returns:
        (..., n, 2, 6).
    """
    x = _FORWARD.like(axis)[0]
    chord = x - axis[..., :1] * axis
    chord = chord / torch.linalg.vector_norm(chord, dim=-1, keepdim=True).clamp_min(1e-12)
    plane = torch.stack((chord, cross(axis, chord)), -2)
    moment = cross(position.unsqueeze(-2), plane)
    return torch.cat((plane.expand_as(moment), moment), -1)


def lift_coefficient(
    angle: Scalar,
    lift_slope: Scalar,
    stall: Scalar,
    sharpness: Tensor | float = SHARPNESS,
    separated: Tensor | float = 1.0,
    crossflow: Tensor | float = 0.0,
) -> Scalar:
    """Return the lift coefficient: attached flow blended smoothly into that of a flat plate.

    C_L = (1 - s) (c_La alpha + c_c alpha |alpha|) + s c_s 2 sin(alpha) |sin(alpha)| cos(alpha)
    1 - s = (1 + exp(-k)) / (1 + exp(k (|alpha| / alpha_0 - 1))) with k = 12, c_s = 1, c_c = 0

    The lift peaks a little before alpha_0, falls to the plate's and vanishes at +-pi/2. The slope at zero is c_La,
    however gentle the transition.

    Args:
        angle: angle of attack alpha, rad, within +-pi/2 (...).
        lift_slope: c_La, 1/rad (...).
        stall: angle alpha_0 in the middle of the transition, rad, positive (...).
        sharpness: k, alpha_0 over the width of the transition.
        separated: c_s, share of the normal force of a long flat plate, 2 sin(alpha)^2, that the separated flow has.
        crossflow: c_c, 1/rad^2, lift of the flow around the tips, the cross-flow drag over the effective aspect ratio
            (Whicker and Fehlner 1958).

    Returns:
        (...), with a continuous slope. After Beard and McLain 2012, Small Unmanned Aircraft, section 4.2.
    """
    at_zero = 1.0 + (torch.exp(-sharpness) if isinstance(sharpness, Tensor) else math.exp(-sharpness))
    attached = at_zero * torch.sigmoid(sharpness - (sharpness / stall) * angle.abs())
    sine = torch.sin(angle)
    plate = 2.0 * separated * sine * sine.abs() * torch.cos(angle)
    return plate + attached * ((lift_slope + crossflow * angle.abs()) * angle - plate)


def fin_wrench(
    nu_r: Velocity,
    angle: PerPart,
    frame: FinFrame,
    area: PerPart,
    lift_slope: PerPart,
    stall: PerPart,
    density: Number,
    sharpness: Tensor | float = SHARPNESS,
    separated: Tensor | float = 1.0,
    crossflow: Tensor | float = 0.0,
) -> Wrench:
    """Return the wrench of fins whose geometry is already in ``frame`` (see ``fin_frame``, ``fin_force``).

    Args:
        nu_r: velocity through the water, m/s and rad/s, (..., 6).
        angle: of the fins, rad, (..., n).
        frame: from `fin_frame`, (..., n, 2, 6).
        area: m2, (..., n).
        lift_slope: 1/rad, (..., n).
        stall: angle in the middle of the transition, rad, (..., n).
        density: of the water, kg/m3.
        sharpness: of the transition, see `lift_coefficient`.
        separated: share of a long flat plate's normal force that the separated flow has.
        crossflow: lift of the flow around the tips, 1/rad^2.
    """
    rows = matvec(frame.flatten(-3, -2), nu_r)
    flow = rows.unflatten(-1, (-1, 2))
    along, across = flow[..., 0], flow[..., 1]
    speed = torch.linalg.vector_norm(flow, dim=-1)
    # At rest the direction is arbitrary (the force is zero): a fixed one keeps the gradient finite.
    inflow = torch.atan2(across, torch.where(speed > 0.0, along, 1.0))
    # A fin is taken as symmetric fore and aft: its angle to the flow counts modulo pi.
    attack = torch.remainder(angle - inflow + 0.5 * math.pi, math.pi) - 0.5 * math.pi
    coefficient = lift_coefficient(attack, lift_slope, stall, sharpness, separated, crossflow)
    size = 0.5 * per_vector(density) * area * coefficient * speed
    lift = torch.stack((-size * across, size * along), -1)
    return matvec(frame.flatten(-3, -2).mT, lift.flatten(-2))


def fin_force(
    nu_r: Velocity,
    angle: PerPart,
    position: Vectors3,
    axis: Vectors3,
    area: PerPart,
    lift_slope: PerPart,
    stall: PerPart,
    density: Number,
) -> Wrench:
    """Return the wrench of control fins, about the origin, on the right-hand side.

    The fin at r turns about its axis a; a positive angle delta turns it by the right-hand rule. At zero angle
    its chord is the body's forward direction e (x without its part along a). It meets the water with
    V = v_r + omega x r, of which only the part V_p across the axis counts:

    beta = atan2(V_p . (a x e), V_p . e)    the direction of motion, from e about a
    alpha = delta - beta                    the angle of attack, modulo pi, within +-pi/2
    F = 1/2 rho A C_L(alpha) |V_p| (a x V_p),    tau = [F ; r x F]

    With small angles F = 1/2 rho A c_La |V_p|2 alpha in the direction a x V_p/|V_p|: in forward motion
    towards a x e. At the stern a rudder (a = z) with a positive angle pushes to starboard (Y > 0, N < 0: the
    nose turns to port) and a stern plane (a = y) pushes up (Z < 0, M < 0: the nose goes down); alpha is
    delta_r - (v + x r)/u and delta_s + (w - x q)/u. The force is perpendicular to the flow, so it does no
    work at the fin: the fins' drag belongs to the vehicle's damping. At rest force and gradient are zero.

    Args:
        nu_r: velocity through the water, m/s and rad/s (..., 6).
        angle: fin angles delta, rad (..., n).
        position: of the fins' centres of pressure in body axes, m (n, 3).
        axis: unit vectors about which a positive angle turns the fins (n, 3), not along x.
        area: A, m2 (n).
        lift_slope: c_La, 1/rad (n).
        stall: angle at which the flow separates, rad (n), positive; see ``lift_coefficient``.
        density: rho of the water, kg/m3.

    Returns:
        (..., 6), N and N m. Prestero 2001, control fin forces and moments; Fossen 2011, section 12.3.
    """
    return fin_wrench(nu_r, angle, fin_frame(position, axis), area, lift_slope, stall, density)
