"""The plant `mujoco`: a rigid body in MuJoCo, with its fluid forces, and by hand what it does not compute.

What the engine computes, checked on MuJoCo 4.0 (tests/plants/test_mujoco_engine.py):

* its ellipsoid fluid model gives the added mass's Coriolis and centripetal forces, -w x P and -w x L - v_r x P with
  P = m_A v_r and L = I_A w, in the velocity relative to `opt.wind`; virtual masses and inertias stand in `geom_fluid`
  and may be any (three and three, so diagonal);
* it gives no force in proportion to the acceleration: a body at rest in water answers a push with F/m, not with
  F/(m + m_A). A model with added mass would find a wrong one in such a log;
* its drag (blunt, slender, angular, Kutta, Magnus) follows five coefficients and vanishes where they are zero;
* gravity, inertia about a displaced centre of mass, gyroscopic terms and the quaternion are its own;
* of its integrators Euler, implicit and implicitfast are of first order (the implicit ones take the velocity
  slopes of the fluid forces into the step): at 0.01 s they are off by more than 1e-3 m/s after a second.
  RK4 is of fourth order and evaluates every force four times a step.

So here the engine does the rigid body, gravity, the diagonal added mass's Coriolis forces in a steady current, and
the integration (RK4); the rest comes by `mjcb_control`, which is called at every stage once the engine knows its own
inertia, bias and fluid forces: thrust, fins, stated drag, buoyancy, wrench effects and strangers from the plant
`numpy`, off-diagonal added mass, and the force -M_A (nu_dot - nu_c_dot) for the acceleration that solves

    (M + T' M_A T) q_ddot = Q_hand + Q_fluid - bias + T' M_A ([w x v; 0] + nu_c_dot),    T = blkdiag(R', I)

with the engine's own M and bias. All runs of a log are bodies of one scene that do not touch.
"""

from __future__ import annotations

import importlib
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import ConfigError, MissingExtra, one_line
from auvnn.plants.base import (
    LIMIT,
    Look,
    Motion,
    Plant,
    PlantTask,
    drive,
    refuse,
    refuse_laws,
    refuse_learned,
)
from auvnn.plants.independent.equations import Held
from auvnn.plants.independent.plant import SUPPORTED
from auvnn.plants.independent.stretch import Beyond, Stretch
from auvnn.plants.independent.thrust import Signal
from auvnn.plants.independent.vectors import cross, matrix_of, times

Array = NDArray[np.float64]

REFUSED = {
    "current_shear": "the engine's water moves as one",
    "waves": "the engine's water moves as one",
    "payload": "the engine's bodies keep their mass",
    "flooding": "the engine's bodies keep their mass",
    "bottom_proximity": "the engine's virtual mass stays the same",
    "surface_proximity": "the engine's virtual mass stays the same",
}
# Longest step of its RK4, s, whatever `max_step` allows.
STEP = 0.01


class MujocoPlant(Plant):
    """Rigid body, Coriolis forces of the added mass and integration by MuJoCo; see the module."""

    name = "mujoco"

    def refuses(self, effect: str) -> str:
        """Return why it cannot hold an effect."""
        if effect in REFUSED:
            return f"{REFUSED[effect]}; use plant=numpy"
        if effect in SUPPORTED or effect.startswith("stranger_"):
            return ""
        return "it has no equations for it; use plant=own"

    def move(self, task: PlantTask, look: Look) -> Motion:
        """Run the engine."""
        refuse(self, (*task.effects, *task.strangers))
        refuse_learned(self, task)
        refuse_laws(self, task)
        return drive(_Scene(task, engine()), task, look)


def engine() -> Any:
    """Return the module `mujoco`.

    Raises:
        MissingExtra: it is not installed.
    """
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        raise MissingExtra("mujoco-core", "mujoco", "the plant mujoco") from None


class _Scene(Stretch):
    """All runs as free bodies of one scene; reporting, actuators and forces are those of the plant `numpy`."""

    def __init__(self, task: PlantTask, mujoco: Any) -> None:
        super().__init__(task)
        self.mujoco = mujoco
        count = len(self.place)
        mass, first, inertia = self.equations.fixed
        diagonal = np.diagonal(self.equations.hull.added)
        centre = first / mass
        about = inertia - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        try:
            self.model = mujoco.MjModel.from_xml_string(
                _world(count, float(task.vehicle.water_density), mass, centre, about)
            )
        except ValueError as problem:
            words = f"plant mujoco cannot hold {task.vehicle.name}: {one_line(problem)}"
            raise ConfigError(f"{words}; correct its mass and inertia, or use plant=numpy") from None
        model = self.model
        model.geom_fluid[:, 6:] = diagonal / task.vehicle.water_density
        model.opt.gravity[:] = [0.0, 0.0, task.vehicle.gravity]
        current = task.effects.get("ocean_current", {})
        model.opt.wind[:] = [
            self.equations.felt * current.get(n, 0.0) for n in ("v_north", "v_east", "v_down")
        ]
        self.data = mujoco.MjData(model)
        # The engine weighs what it moves; what is left of the stated weight comes by hand.
        self.equations.hull.weight -= mass * task.vehicle.gravity
        self.rest = self.equations.hull.added - np.diag(diagonal)
        self.full = np.zeros((6 * count, 6 * count))
        self.thrust: Signal = lambda t: np.zeros_like(self.place)
        self.now: Held = (np.zeros((count, 0)), None, None)
        self.begin = float(task.t[0])
        self.put()

    def put(self) -> None:
        """Give the engine the present state."""
        count = len(self.place)
        velocity = np.concatenate([times(self.rotation, self.v), self.turn], axis=-1)
        self.data.qpos[:] = np.concatenate([self.place, self.quaternion], axis=-1).ravel()
        self.data.qvel[:] = velocity.ravel()
        self.data.qfrc_applied[:] = np.zeros(6 * count)

    def push(self, model: Any, data: Any) -> None:
        """Set what the engine does not compute, at one stage of its integrator."""
        count = len(self.place)
        pose, speed = data.qpos.reshape(count, 7), data.qvel.reshape(count, 6)
        place, rotation = pose[:, :3].copy(), matrix_of(pose[:, 3:])
        turn = speed[:, 3:].copy()
        v = np.einsum("rij,ri->rj", rotation, speed[:, :3])
        if not (np.abs(speed).max(-1) < LIMIT).all():
            raise Beyond(int(np.argmin(np.abs(speed).max(-1) < LIMIT)), self.begin)
        t = self.begin + float(data.time)
        near = self.equations.around(t, place, rotation, v, turn)
        parts = self.equations.forces(t, place, rotation, v, turn, self.thrust(t), self.now, near)
        hand = sum(parts.values(), np.zeros((count, 6)))
        if np.any(self.rest):
            impulse = np.concatenate([near.flow, turn], axis=-1) @ self.rest.T
            p, m = impulse[:, :3], impulse[:, 3:]
            hand -= np.concatenate([cross(turn, p), cross(turn, m) + cross(near.flow, p)], axis=-1)
        # What M_A is to be multiplied with, beside T q_ddot.
        frame = np.zeros((count, 6))
        frame[:, :3] = -cross(turn, v)
        if near.gain is not None:
            frame[:, :3] -= near.gain
        added = self.equations.hull.added
        to_joint = np.zeros((count, 6, 6))
        to_joint[:, :3, :3], to_joint[:, 3:, 3:] = rotation, np.eye(3)
        outer = to_joint @ added @ to_joint.transpose(0, 2, 1)
        self.mujoco.mj_fullM(model, data, self.full)
        own = self.full.reshape(count, 6, count, 6)[np.arange(count), :, np.arange(count), :]
        free = data.qfrc_passive.reshape(count, 6) - data.qfrc_bias.reshape(count, 6)
        applied = times(to_joint, hand - frame @ added.T)
        change = np.linalg.solve(own + outer, (free + applied)[..., None])[..., 0]
        data.qfrc_applied[:] = (applied - times(outer, change)).ravel()

    def rate(self, t: float, thrust: Array, held: Held) -> Array:
        """Return the engine's acceleration of the present state, in body axes, (R, 6)."""
        self.thrust, self.now, self.begin = lambda _: thrust, held, t
        self.put()
        self.data.time = 0.0
        self._called(self.mujoco.mj_forward)
        change = self.data.qacc.reshape(len(self.place), 6)
        v_dot = np.einsum("rij,ri->rj", self.rotation, change[:, :3]) - cross(self.turn, self.v)
        return np.concatenate([v_dot, change[:, 3:]], axis=-1)

    def integrate(self, begin: float, end: float, held: Held) -> None:
        """Let the engine step."""
        steps = max(1, math.ceil((end - begin) / min(self.task.max_step, STEP) - 1e-9))
        self.model.opt.timestep = (end - begin) / steps
        self.thrust, self.now, self.begin = self.actuators.between(begin, end), held, begin
        self.put()
        self.data.time = 0.0
        self._called(lambda model, data: self.mujoco.mj_step(model, data, steps))
        pose, speed = self.data.qpos.reshape(-1, 7), self.data.qvel.reshape(-1, 6)
        self.place, self.quaternion, self.turn = pose[:, :3].copy(), pose[:, 3:].copy(), speed[:, 3:].copy()
        self.rotation = matrix_of(self.quaternion)
        self.v = np.einsum("rij,ri->rj", self.rotation, speed[:, :3])

    def _called(self, action: Any) -> None:
        """Do something with our forces in the engine's loop, and leave none of them behind."""
        self.mujoco.set_mjcb_control(self.push)
        try:
            action(self.model, self.data)
        finally:
            self.mujoco.set_mjcb_control(None)


def _world(count: int, density: float, mass: float, centre: Array, inertia: Array) -> str:
    """Return free bodies in still water, without drag or contact; their virtual mass is set afterwards."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    place, full = (" ".join(repr(float(x)) for x in values) for values in (centre, (xx, yy, zz, xy, xz, yz)))
    body = (
        f'<body><freejoint/><inertial pos="{place}" mass="{float(mass)!r}" fullinertia="{full}"/>'
        '<geom type="ellipsoid" size="0.1 0.1 0.1" mass="0" contype="0" conaffinity="0" '
        'fluidshape="ellipsoid" fluidcoef="0 0 0 0 0"/></body>'
    )
    return (
        f'<mujoco><option integrator="RK4" density="{density!r}" viscosity="0"/>'
        f"<worldbody>{count * body}</worldbody></mujoco>"
    )
