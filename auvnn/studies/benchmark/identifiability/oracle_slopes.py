"""How a plant's acceleration and its sensors change with the state and with what an oracle does not know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from auvnn.plants import Motion, PlantTask
from auvnn.plants.independent.equations import Equations
from auvnn.plants.independent.sensors import Reported, report
from auvnn.plants.independent.servos import Servos
from auvnn.plants.independent.thrust import Actuators
from auvnn.plants.independent.vectors import cross_matrix, matrix_of, orthonormal
from auvnn.studies.benchmark.identifiability.plant_information import remembers_commands

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, float]]

# Steps of the differences: of position, attitude and velocity, m, rad, m/s and rad/s.
STEP = 1e-4
# The filter's own step, s: a log with rare rows is filtered in between.
FINE = 0.05


@dataclass(frozen=True)
class Course:
    """A true motion cut into steps of a filter.

    Attributes:
        task: what made it, without the force that wanders.
        motion: as it was, of the runs that count.
        rows: rows of the motion at which the steps begin, (K + 1,).
        step: s.
    """

    task: PlantTask
    motion: Motion
    rows: NDArray[np.int64]
    step: float

    @classmethod
    def of(cls, task: PlantTask, motion: Motion, runs: int) -> Course:
        """Return the course of the first runs of a motion.

        Args:
            task: of the plant.
            motion: that came of it.
            runs: how many.
        """
        dt = float(task.t[1] - task.t[0])
        each = max(1, round(FINE / dt))
        rows = np.arange(0, len(task.t), each)
        m = motion
        few = Motion(
            m.eta[:runs], m.nu[:runs], m.nu_dot[:runs], m.position[:runs], m.quaternion[:runs], m.velocity[:runs],
            m.rate[:runs], m.command[:runs], None if m.fins is None else m.fins[:runs],
        )  # fmt: skip
        task = replace(
            task,
            laws=replace(task.laws, wander=None),
            voltage=None if task.voltage is None else task.voltage[:runs],
        )
        return cls(task, few, rows, each * dt)

    @property
    def runs(self) -> int:
        """How many."""
        return len(self.motion.nu)

    def middle(self) -> tuple[Array, Array, Array]:
        """Return position (R, K, 3), rotation (R, K, 3, 3) and velocity (R, K, 6) half-way through each step."""
        eta, nu = self.motion.eta[:, self.rows], self.motion.nu[:, self.rows]
        place = 0.5 * (eta[:, 1:, :3] + eta[:, :-1, :3])
        turned = matrix_of(eta[..., 3:].reshape(-1, 4)).reshape(*eta.shape[:2], 3, 3)
        rotation = orthonormal(0.5 * (turned[:, 1:] + turned[:, :-1]))
        return place, rotation, 0.5 * (nu[:, 1:] + nu[:, :-1])


def accelerations(course: Course, effects: Values, kicks: Array | None = None) -> Array:
    """Return the plant's acceleration at the true states half-way through each step, under effects, (R, K, 6).

    Actuators remember what they were told before, with the effects as they are given; the states are the true ones
    whatever the effects: what differs is what one step would make of it.

    Args:
        course: the true motion.
        effects: that act.
        kicks: changes of the state (J, 12), position NED, attitude by a rotation in the body, velocity; with them the
            answer is (J, R, K, 6).
    """
    task, motion, count = course.task, course.motion, course.runs
    actuators = Actuators(task.vehicle, task.actuation, effects, task.laws)
    equations = Equations(task.vehicle, effects, task.strangers, actuators, task.bottom, task.laws)
    places, rotations, speeds = course.middle()
    changes = np.zeros((1, 12)) if kicks is None else kicks
    turns = Rotation.from_rotvec(changes[:, 3:6]).as_matrix()
    many = len(changes)
    memory = any(remembers_commands(name) for name in effects)
    # The mean over a step is what moves the vehicle, of fins that lag as of thrusters.
    servos = Servos(effects["fin_lag"]["time_constant"]) if "fin_lag" in effects else None
    propellers = Servos(effects["propeller_lag"]["time_constant"]) if "propeller_lag" in effects else None
    out = np.empty((many, *speeds.shape))
    done = -1

    def all_of(x: Array | None) -> Array | None:
        return None if x is None else np.concatenate([x] * many)

    for j in range(len(course.rows) - 1):
        moment = float(task.t[course.rows[j]]) + 0.5 * course.step
        row = int(np.searchsorted(task.t, moment + 1e-9, side="right")) - 1
        last = int(course.rows[j + 1]) - 1
        while done < last:
            done += 1
            actuators.hold(
                motion.command[:, done], float(task.t[done]), float(task.t[min(done + 1, len(task.t) - 1)])
            )
            if servos is not None and motion.fins is not None:
                servos.hold(motion.fins[:, done], float(task.t[done]))
            if propellers is not None:
                propellers.hold(motion.command[:, done], float(task.t[done]))
        thrust = _mean(actuators, moment - 0.5 * course.step, moment + 0.5 * course.step, memory)
        place = (places[None, :, j] + changes[:, None, :3]).reshape(-1, 3)
        rotation = (rotations[None, :, j] @ turns[:, None]).reshape(-1, 3, 3)
        nu = (speeds[None, :, j] + changes[:, None, 6:]).reshape(-1, 6)
        fins = None if motion.fins is None else motion.fins[:, row]
        if servos is not None and fins is not None:
            fins = servos.mean(moment - 0.5 * course.step, moment + 0.5 * course.step)
        command = motion.command[:, row]
        if propellers is not None:
            command = propellers.mean(moment - 0.5 * course.step, moment + 0.5 * course.step)
        voltage = None if task.voltage is None else task.voltage[:, row]
        held = (np.concatenate([command] * many), all_of(fins), all_of(voltage))
        rate = equations.rate(
            moment, place, rotation, nu[:, :3], nu[:, 3:], np.concatenate([thrust] * many), held
        )
        out[:, :, j] = rate.reshape(many, count, 6)
    return out[0] if kicks is None else out


def _mean(actuators: Actuators, begin: float, end: float, memory: bool) -> Array:
    """Return the mean thrust over a step, which is what moves the vehicle, (R, n).

    Between two commands the thrust is sampled more densely just after the first, where a short lag acts.
    """
    moments = [begin, *(b for b in actuators.begins[-32:] if begin + 1e-9 < b < end - 1e-9)]
    moments = [*sorted({*moments, *actuators.breaks(begin, end)}), end]
    total = np.zeros(())
    for a, b in pairwise(moments):
        signal = actuators.between(a, b)
        if memory:
            parts = [w * 2.0 * x * signal(a + (b - a) * x * x) for x, w in zip(*_POINTS, strict=True)]
            total = total + (b - a) * sum(parts, np.zeros(()))
        else:
            total = total + (b - a) * signal(0.5 * (a + b))
    return total / (end - begin)


_GAUSS = np.polynomial.legendre.leggauss(6)
_POINTS = (0.5 * (_GAUSS[0] + 1.0), 0.5 * _GAUSS[1])


def transitions(course: Course, effects: Values, correlation: Array) -> Array:
    """Return how a small change of (position, attitude, velocity, wandering force) goes over each step, (R, K, 18, 18).

    Position in NED, attitude by a rotation in the body; the force fades with its correlation times, s, (6,).

    Args:
        course: R runs of K steps.
        effects: that act, name to parameters.
        correlation: times of the wandering force, s, (6,).
    """
    kicks = STEP * np.concatenate([np.eye(12), -np.eye(12)])
    found = accelerations(course, effects, kicks)
    slope = np.moveaxis((found[:12] - found[12:]) / (2.0 * STEP), 0, -1)
    _, rotation, nu = course.middle()
    f = np.zeros((*nu.shape[:2], 18, 18))
    # p_dot = R v, and an attitude R exp(d): d_dot = dw - w x d.
    f[..., :3, 6:9] = rotation
    f[..., :3, 3:6] = -rotation @ cross_matrix(nu[..., :3])
    f[..., 3:6, 9:12] = np.eye(3)
    f[..., 3:6, 3:6] = -cross_matrix(nu[..., 3:])
    f[..., 6:12, :12] = slope
    f[..., 6:12, 12:] = lightness(course, effects)
    f[..., 12:, 12:] = -np.diag(1.0 / correlation)
    step = course.step * f
    out = np.eye(18) + step
    power = step
    for order in (2, 3, 4, 5):
        power = power @ step / order
        out = out + power
    return out


def lightness(course: Course, effects: Values) -> Array:
    """Return the acceleration by a unit wrench, (6, 6), of body and water at mid-time."""
    task = course.task
    actuators = Actuators(task.vehicle, task.actuation, effects, task.laws)
    equations = Equations(task.vehicle, effects, task.strangers, actuators, task.bottom, task.laws)
    matrix = equations.matrix(0.5 * float(task.t[-1]), np.ones((1, 1))).reshape(6, 6)
    return np.linalg.inv(matrix).astype(np.float64)


def reports(course: Course, effects: Values) -> tuple[Array, Array, Array]:
    """Return what sensors without noise report at the steps: position, rotation and velocity, (R, K + 1, ...)."""
    eta, nu, rate = (getattr(course.motion, n)[:, course.rows] for n in ("eta", "nu", "nu_dot"))
    shape = eta.shape[:2]
    flat = Reported(
        eta[..., :3].reshape(-1, 3), eta[..., 3:].reshape(-1, 4), nu[..., :3].reshape(-1, 3),
        nu[..., 3:].reshape(-1, 3), rate[..., :3].reshape(-1, 3), rate[..., 3:].reshape(-1, 3),
    )  # fmt: skip
    seen = report(effects, flat, course.task.vehicle.gravity)
    velocity = np.concatenate([seen.v, seen.turn], axis=-1)
    return (
        seen.position.reshape(*shape, 3),
        matrix_of(seen.quaternion).reshape(*shape, 3, 3),
        velocity.reshape(*shape, 6),
    )


def differences(one: Sequence[Array], other: Sequence[Array]) -> Array:
    """Return the change from one report to another: position, rotation in the body and velocity, (R, K + 1, 12)."""
    turn = np.swapaxes(one[1], -1, -2) @ other[1]
    angle = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec().reshape(*turn.shape[:2], 3)
    return np.concatenate([other[0] - one[0], angle, other[2] - one[2]], axis=-1)
