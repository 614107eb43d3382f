"""Checks of a model against a log that need no fit of effects.

`actuators` asks whether thrusters are where the model file puts them, `unseen_current` whether the water moves,
both by a linear `regression` of accelerations; `doubts` collects what they and the vehicle's numbers give reason
to doubt.
"""

from auvnn.checks.actuators import ActuatorCheck, check_actuators

__all__ = ["ActuatorCheck", "check_actuators"]
