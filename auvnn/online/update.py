"""What a step of the adapter did."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor


@dataclass(frozen=True)
class Update:
    """What a step did.

    Attributes:
        t: s.
        adapted: whether the weights moved.
        reason: in words, why or why not.
        cause: the reason's short name: "adapted", or a key of `guards.REASONS`.
        residual: (6,) wrench that the model lacked before the update, N and N m, or None.
        prediction_error: (6,) measured minus predicted acceleration before the update, or None.
        unadapted_error: (6,) the same of the model that the adapter began with, or None.
        change: length of the weights' step.
        force_change: (6,) change of the damping at this velocity, N and N m, or None.
        reverted: whether an update was taken back.
        validated: whether the weights became the validated ones.
        proven: degrees of freedom whose learned weights came into use (with `guards.proof`).
        believed: whether a sudden residual was accepted as a change of the vehicle.
    """

    t: float
    adapted: bool
    reason: str
    cause: str
    residual: Tensor | None = None
    prediction_error: Tensor | None = None
    unadapted_error: Tensor | None = None
    change: float = 0.0
    force_change: Tensor | None = None
    reverted: bool = False
    validated: bool = False
    proven: int = 0
    believed: bool = False
