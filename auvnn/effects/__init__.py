"""The catalogue of physical effects: one line per cause. A new effect is one file and one line here."""

from auvnn.catalogue import Catalogue
from auvnn.effects.base import Body, Effect, Moment, Parameter, Sensed

EFFECTS = Catalogue(
    "effect",
    {
        "ocean_current": "auvnn.effects.ocean_current:OceanCurrent",
        "added_mass": "auvnn.effects.added_mass:AddedMass",
        "linear_damping": "auvnn.effects.linear_damping:LinearDamping",
        "quadratic_damping": "auvnn.effects.quadratic_damping:QuadraticDamping",
        "cg_offset": "auvnn.effects.cg_offset:CgOffset",
        "net_buoyancy": "auvnn.effects.net_buoyancy:NetBuoyancy",
        "thruster_gain": "auvnn.effects.thruster_gain:ThrusterGain",
        "thruster_lag": "auvnn.effects.thruster_lag:ThrusterLag",
        "constant_force": "auvnn.effects.constant_force:ConstantForce",
        "velocity_lever_arm": "auvnn.effects.velocity_lever_arm:VelocityLeverArm",
    },
    "auvnn.effects",
)

__all__ = ["EFFECTS", "Body", "Effect", "Moment", "Parameter", "Sensed"]
