"""Recorded quantities turned from FLU to FRD and from ENU to NED."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.signals.rotation import multiply

Array = NDArray[np.float64]

_BODY_SIGNS = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
# Half a turn about the x axis: FRD to FLU; it is its own inverse up to sign.
_BODY_TURN = np.array([0.0, 1.0, 0.0, 0.0])
# Half a turn about the line between east and north: ENU to NED.
_WORLD_TURN = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
_BLOCK = 65_536  # rows at a time: a product of quaternions needs several times their memory on the way


def six_to_frd(values: Array, body: str) -> Array:
    """Return velocities, accelerations or wrenches (N, 6) in FRD, given in `body` ("FRD" or "FLU")."""
    return values * _BODY_SIGNS if body == "FLU" else values


def position_to_ned(values: Array, world: str) -> Array:
    """Return positions (N, 3) in NED, given in `world` ("NED" or "ENU")."""
    return values[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0]) if world == "ENU" else values


def quaternion_to_ned_frd(q: Array, body: str, world: str, own: bool = False) -> Array:
    """Return attitudes body to world (N, 4) as FRD to NED, given in these frames.

    With R' = W R B, where B turns FRD into FLU and W turns ENU into NED.

    Args:
        q: quaternions (w, x, y, z), (N, 4).
        body: "FRD" or "FLU".
        world: "NED" or "ENU".
        own: whether the result may take the place of `q`.
    """
    if body != "FLU" and world != "ENU":
        return q
    out = q if own else np.empty(q.shape)
    for at in range(0, len(q), _BLOCK):
        part = q[at : at + _BLOCK]
        if body == "FLU":
            part = multiply(part, _BODY_TURN)
        out[at : at + _BLOCK] = multiply(_WORLD_TURN, part) if world == "ENU" else part
    return out
