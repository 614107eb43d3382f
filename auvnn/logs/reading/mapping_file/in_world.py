"""What a mapping leaves to be done with whole runs: headings set right, velocities turned into the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from auvnn.errors import ConfigError
from auvnn.logs.channels import VELOCITY
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.run import Run
from auvnn.logs.signals import differences


def settle(run: Run, plan: Mapping, where: str) -> tuple[Run, list[Repair]]:
    """Return the run with its heading offset added and velocities that were given along north, east, down turned.

    Raises:
        ConfigError: some of u, v, w are given in the world and others in the body.
    """
    repairs: list[Repair] = []
    heading = 0.0 if plan.heading is None else plan.heading.of(run.number)
    if heading:
        run = replace(run, quaternion=differences.turned(run.quaternion, heading))
        words = f"headings increased by {np.degrees(heading):.4g} degrees"
        repairs.append(Repair(words, where, run.samples, "info"))
    told = [n for n in VELOCITY[:3] if n in plan.columns]
    world = [n for n in told if plan.columns[n].more.world]
    if world:
        if len(world) < 3:
            raise ConfigError(
                f"{plan.where}: columns: {', '.join(world)} in the world: turning them into the body takes all of u, v, w"
            )
        nu = run.nu.copy()
        # `frames` has taken FLU for FRD where the mapping says so: what was given in the world keeps its signs.
        signs = np.array([1.0, -1.0, -1.0]) if plan.body == "FLU" else np.ones(3)
        velocity = nu[:, :3] * signs
        if plan.world == "ENU":
            velocity = velocity[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0])
        nu[:, :3] = differences.into_body(run.quaternion, velocity)
        run = replace(run, nu=nu)
        words = "velocities along north, east, down turned into the body by the measured attitude"
        repairs.append(Repair(words, where, run.samples, "info"))
    return run, repairs
