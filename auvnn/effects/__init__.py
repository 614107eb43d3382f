"""The catalogue of physical effects: one line per cause. A new effect is one file and one line here."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from auvnn.catalogue import Catalogue

if TYPE_CHECKING:
    from auvnn.effects.base import HOOKS, Effect
    from auvnn.effects.hooks import Body, Extent, Moment, Parameter, Response, Sensed

EFFECTS = Catalogue(
    "effect",
    {
        "ocean_current": "auvnn.effects.ocean_current:OceanCurrent",
        "current_shear": "auvnn.effects.current_shear:CurrentShear",
        "waves": "auvnn.effects.waves:Waves",
        "drag_only_current": "auvnn.effects.drag_only_current:DragOnlyCurrent",
        "bottom_proximity": "auvnn.effects.bottom_proximity:BottomProximity",
        "surface_proximity": "auvnn.effects.surface_proximity:SurfaceProximity",
        "compressibility": "auvnn.effects.compressibility:Compressibility",
        "added_mass": "auvnn.effects.added_mass:AddedMass",
        "trapped_water": "auvnn.effects.trapped_water:TrappedWater",
        "linear_damping": "auvnn.effects.linear_damping:LinearDamping",
        "quadratic_damping": "auvnn.effects.quadratic_damping:QuadraticDamping",
        "unstated_damping": "auvnn.effects.unstated_damping:UnstatedDamping",
        "drag_curve": "auvnn.effects.drag_curve:DragCurve",
        "coupled_damping": "auvnn.effects.coupled_damping:CoupledDamping",
        "cross_flow_drag": "auvnn.effects.cross_flow_drag:CrossFlowDrag",
        "body_lift": "auvnn.effects.body_lift:BodyLift",
        "body_lift_stall": "auvnn.effects.body_lift_stall:BodyLiftStall",
        "munk_moment": "auvnn.effects.munk_moment:MunkMoment",
        "added_mass_coriolis": "auvnn.effects.added_mass_coriolis:AddedMassCoriolis",
        "biofouling": "auvnn.effects.biofouling:Biofouling",
        "cg_offset": "auvnn.effects.cg_offset:CgOffset",
        "net_buoyancy": "auvnn.effects.net_buoyancy:NetBuoyancy",
        "payload": "auvnn.effects.payload:Payload",
        "flooding": "auvnn.effects.flooding:Flooding",
        "thruster_gain": "auvnn.effects.thruster_gain:ThrusterGain",
        "thrust_asymmetry": "auvnn.effects.thrust_asymmetry:ThrustAsymmetry",
        "thrust_curve": "auvnn.effects.thrust_curve:ThrustCurve",
        "thrust_polynomial": "auvnn.effects.thrust_polynomial:ThrustPolynomial",
        "thruster_deadband": "auvnn.effects.thruster_deadband:ThrusterDeadband",
        "thruster_lag": "auvnn.effects.thruster_lag:ThrusterLag",
        "propeller_lag": "auvnn.effects.propeller_lag:PropellerLag",
        "thrust_overshoot": "auvnn.effects.thrust_overshoot:ThrustOvershoot",
        "turning_forces": "auvnn.effects.turning_forces:TurningForces",
        "tilted_vertical": "auvnn.effects.tilted_vertical:TiltedVertical",
        "actuation_delay": "auvnn.effects.actuation_delay:ActuationDelay",
        "thrust_inflow_loss": "auvnn.effects.thrust_inflow_loss:ThrustInflowLoss",
        "thrust_advance": "auvnn.effects.thrust_advance:ThrustAdvance",
        "voltage_droop": "auvnn.effects.voltage_droop:VoltageDroop",
        "propeller_torque": "auvnn.effects.propeller_torque:PropellerTorque",
        "fin_stall": "auvnn.effects.fin_stall:FinStall",
        "fin_gain": "auvnn.effects.fin_gain:FinGain",
        "fin_offset": "auvnn.effects.fin_offset:FinOffset",
        "fin_drag": "auvnn.effects.fin_drag:FinDrag",
        "fin_lag": "auvnn.effects.fin_lag:FinLag",
        "tether": "auvnn.effects.tether:Tether",
        "constant_force": "auvnn.effects.constant_force:ConstantForce",
        "gyro_bias": "auvnn.effects.gyro_bias:GyroBias",
        "accelerometer_tilt": "auvnn.effects.accelerometer_tilt:AccelerometerTilt",
        "velocity_misalignment": "auvnn.effects.velocity_misalignment:VelocityMisalignment",
        "velocity_lever_arm": "auvnn.effects.velocity_lever_arm:VelocityLeverArm",
        "velocity_scale": "auvnn.effects.velocity_scale:VelocityScale",
    },
    "auvnn.effects",
)

# Known, so that a model that holds one can be saved and loaded, but not offered as a name for what is missing.
_UNOFFERED = {
    "learned_drag": "auvnn.effects.learned_drag:LearnedDrag",
    "inertia": "auvnn.effects.inertia_factors:InertiaFactors",
    "residual_force": "auvnn.effects.residual_force:ResidualForce",
}


def effect_class(name: str) -> type[Effect]:
    """Return the class of any effect that a model may hold, whether the catalogue offers it or not.

    Raises:
        ConfigError: there is no such effect.
    """
    if name in _UNOFFERED:
        module, _, attribute = _UNOFFERED[name].partition(":")
        return getattr(importlib.import_module(module), attribute)
    return EFFECTS.get(name)


__all__ = [
    "EFFECTS",
    "HOOKS",
    "Body",
    "Effect",
    "Extent",
    "Moment",
    "Parameter",
    "Response",
    "Sensed",
    "effect_class",
]


def __getattr__(name: str) -> Any:
    # The list of names must not cost the import of torch.
    if name in __all__ and name != "effect_class":
        from auvnn.effects import base

        return getattr(base, name)
    raise AttributeError(f"module 'auvnn.effects' has no attribute {name!r}")
