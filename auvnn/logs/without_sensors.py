"""A log as a vehicle with fewer sensors would have recorded it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError
from auvnn.logs.channels import EULER, POSITION, SCALARS, VELOCITY
from auvnn.logs.log import Log
from auvnn.logs.run import Run

ATTITUDE = "attitude"
CAN_LACK = (*VELOCITY, *POSITION, ATTITUDE, *SCALARS)


def without(log: Log, channels: Sequence[str]) -> Log:
    """Return a log without some channels: u, v, w for a vehicle without a DVL, x and y for one without a position.

    Args:
        log: the log.
        channels: velocities, coordinates of the position, `attitude`, `altitude`, `voltage`. Measured accelerations go
            with any velocity: whoever has no velocity has no derivative of it.

    Raises:
        ConfigError: a name is no channel that a log can lack.
    """
    for name in channels:
        if name not in CAN_LACK:
            raise ConfigError(unknown_name("channel that a log can lack", str(name), CAN_LACK))
    if not channels:
        return log
    return replace(log, runs=tuple(_without(run, set(channels)) for run in log.runs), sha256="")


def _without(run: Run, gone: set[str]) -> Run:
    changes: dict[str, Any] = {name: None for name in SCALARS if name in gone}
    if gone & {*VELOCITY}:
        changes["nu"] = np.where([n in gone for n in VELOCITY], np.nan, run.nu)
        changes["nu_dot"] = None
    if gone & {*POSITION} and run.position is not None:
        changes["position"] = np.where([n in gone for n in POSITION], np.nan, run.position)
        if gone >= {*POSITION}:
            changes["position"] = None
    if gone & {ATTITUDE, *EULER}:
        changes["quaternion"] = np.full_like(run.quaternion, np.nan)
    return replace(run, **changes)
