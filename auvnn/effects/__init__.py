"""The catalogue of physical effects: one line per cause. A new effect is one file and one line here."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from auvnn.catalogue import Catalogue

if TYPE_CHECKING:
    from auvnn.effects.base import HOOKS, Body, Effect, Moment, Parameter, Response, Sensed

EFFECTS = Catalogue(
    "effect",
    {
        "ocean_current": "auvnn.effects.ocean_current:OceanCurrent",
        "added_mass": "auvnn.effects.added_mass:AddedMass",
        "linear_damping": "auvnn.effects.linear_damping:LinearDamping",
        "quadratic_damping": "auvnn.effects.quadratic_damping:QuadraticDamping",
        "coupled_damping": "auvnn.effects.coupled_damping:CoupledDamping",
        "cg_offset": "auvnn.effects.cg_offset:CgOffset",
        "net_buoyancy": "auvnn.effects.net_buoyancy:NetBuoyancy",
        "thruster_gain": "auvnn.effects.thruster_gain:ThrusterGain",
        "thruster_lag": "auvnn.effects.thruster_lag:ThrusterLag",
        "actuation_delay": "auvnn.effects.actuation_delay:ActuationDelay",
        "constant_force": "auvnn.effects.constant_force:ConstantForce",
        "velocity_lever_arm": "auvnn.effects.velocity_lever_arm:VelocityLeverArm",
    },
    "auvnn.effects",
)

# Known, so that a model that holds one can be saved and loaded, but not offered as a name for what is missing.
_UNOFFERED = {"inertia": "auvnn.effects.inertia_factors:InertiaFactors"}


def effect_class(name: str) -> type[Effect]:
    """Return the class of any effect that a model may hold, whether the catalogue offers it or not.

    Raises:
        ConfigError: there is no such effect.
    """
    if name in _UNOFFERED:
        return Catalogue("effect", _UNOFFERED, "auvnn.unoffered_effects").get(name)
    return EFFECTS.get(name)


__all__ = ["EFFECTS", "HOOKS", "Body", "Effect", "Moment", "Parameter", "Response", "Sensed", "effect_class"]


def __getattr__(name: str) -> Any:
    # The list of names must not cost the import of torch.
    if name in __all__ and name != "effect_class":
        from auvnn.effects import base

        return getattr(base, name)
    raise AttributeError(f"module 'auvnn.effects' has no attribute {name!r}")
