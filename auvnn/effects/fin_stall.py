"""Fins that stall at another angle, or in another way, than the model says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from auvnn.effects.base import Parameter
from auvnn.effects.fin_parts import LiftEffect
from auvnn.effects.hooks import FinLift


class FinStall(LiftEffect):
    """Another stall of all fins: its angle, how abruptly it comes, the lift up to it and the lift that is left beyond.

    C_L = (1 - s) (c_La alpha + c_c alpha |alpha|) + s c_s 2 sin(alpha) |sin(alpha)| cos(alpha)
    1 - s = (1 + exp(-f_k k)) / (1 + exp(f_k k (|alpha| / (f alpha_0) - 1)))

    The factors f, f_k and c_s are 1 in the model, and c_c is 0. Around the tips of a short fin the flow gives a lift that
    grows with the square of the angle: c_c is the coefficient of its cross-flow drag, 0.4 to 0.8, over the effective
    aspect ratio (Whicker and Fehlner 1958). The lift beyond the stall is that of a long flat plate, whose
    normal force is 2 sin(alpha)^2; a square one has 1.17 broadside instead of 2 (Hoerner 1965, chapter 3), which
    is c_s = 0.59. Thick profiles and fins of small aspect ratio stall gently, thin ones abruptly. The wrench is the
    difference that all this makes.
    Reference: Beard and McLain (2012), section 4.2, for the lift beyond the stall and the transition; Whicker and Fehlner
    (1958), Free-stream characteristics of a family of low-aspect-ratio, all-movable control surfaces, for that up to it.
    """

    name = "fin_stall"
    cause = "the fins stall at another angle or in another way"
    symbol = "alpha_0"
    reference = "Beard and McLain (2012), Small Unmanned Aircraft, section 4.2"
    confused_with = ("fin_gain",)
    manoeuvre = "survey"
    told_apart_by = "large fin angles at constant speed"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the factors on stall angle, lift of the separated flow and sharpness, and the lift of the tips."""
        return (
            Parameter("factor", "1", 1.0, 0.3, 0.2, 4.0),
            Parameter("separated", "1", 1.0, 0.4, 0.0, 3.0),
            Parameter("sharpness", "1", 1.0, 0.4, 0.1, 4.0),
            Parameter("crossflow", "1", 0.0, 0.5, -3.0, 6.0),
        )

    def changed(self, lift: FinLift) -> FinLift:
        """Return the lift with the other stall."""
        factor, separated, sharpness, crossflow = self.theta.to(lift.angles).unbind(-1)
        return replace(
            lift,
            stall=lift.stall * factor,
            sharpness=lift.sharpness * sharpness,
            separated=lift.separated * separated,
            crossflow=lift.crossflow + crossflow,
        )
