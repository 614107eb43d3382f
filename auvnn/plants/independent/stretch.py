"""All runs of a log on their way: rotation matrices and vectors in one state, row by row."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from auvnn.errors import AuvnnError
from auvnn.plants.base import LIMIT, Motion, PlantTask, diverged
from auvnn.plants.independent.equations import Equations, Held
from auvnn.plants.independent.sensors import Reported, report
from auvnn.plants.independent.thrust import Actuators
from auvnn.plants.independent.vectors import matrix_of, orthonormal, quaternion_of, times
from auvnn.plants.independent.water import water

Array = NDArray[np.float64]

# Of the solver, per interval between commands: its scheme, relative and absolute tolerance. Who lets other integrators
# take longer steps than FINE, s, wants no more than what noise of millimetres per second cannot show.
FINE = 0.01
# In a world with a wandering force, or of commands that change that fast, one step of the classical method of order
# four passes intervals up to this, s: an adaptive method would begin again at each.
SHORT = 0.026
EXACT, FAST = ("DOP853", 1e-9, 1e-10), ("RK45", 1e-6, 1e-7)
# State of one vehicle: position, rotation by rows, velocity, angular rate.
SIZE = 18


def one_step(rate: Callable[[float, Array], Array], begin: float, end: float, y: Array) -> Array:
    """Return the state after one step of the classical Runge-Kutta method of order four.

    Args:
        rate: of the state at a time, s.
        begin: s.
        end: s.
        y: state at the beginning, of any shape.
    """
    h = end - begin
    a = rate(begin, y)
    b = rate(begin + 0.5 * h, y + 0.5 * h * a)
    c = rate(begin + 0.5 * h, y + 0.5 * h * b)
    d = rate(end, y + h * c)
    return y + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)


class Beyond(Exception):
    """A vehicle is faster than anything under water."""

    def __init__(self, run: int, time: float) -> None:
        """Say which and when."""
        self.run, self.time = run, time


class Stretch:
    """All runs in one state vector, from row to row.

    Args:
        task: what to do.
    """

    def __init__(self, task: PlantTask) -> None:
        """Begin at the first row."""
        self.task = task
        self.actuators = Actuators(task.vehicle, task.actuation, task.effects, task.laws)
        self.equations = Equations(
            task.vehicle, task.effects, task.strangers, self.actuators, task.bottom, task.laws
        )
        self.place, self.quaternion = np.array(task.eta0[:, :3]), np.array(task.eta0[:, 3:])
        self.rotation = matrix_of(self.quaternion)
        self.v, self.turn = np.array(task.nu0[:, :3]), np.array(task.nu0[:, 3:])
        if task.under_way:
            zero = np.zeros_like(self.place)
            stream, _ = water(task.effects, task.vehicle, float(task.t[0]), self.place, zero)
            self.v = self.v + times(self.rotation.transpose(0, 2, 1), stream)
        fast = task.laws.wander is not None or len(task.t) < 2 or float(task.t[1] - task.t[0]) <= SHORT
        self.quick = task.max_step > FINE and fast
        self.rows: list[tuple[Array, ...]] = []
        self.commands: list[Array] = []
        self.fins: list[Array | None] = []

    def report(self) -> tuple[Array, Array, Array]:
        """Return what is reported of the state, accelerations aside."""
        zero = np.zeros_like(self.v)
        seen = self._seen(zero, zero)
        return seen.position, seen.quaternion, np.concatenate([seen.v, seen.turn], axis=-1)

    def _seen(self, v_dot: Array, turn_dot: Array) -> Reported:
        truth = Reported(self.place, self.quaternion, self.v, self.turn, v_dot, turn_dot)
        return report(self.task.effects, truth, self.task.vehicle.gravity)

    def hold(self, command: Array, fins: Array | None, voltage: Array | None) -> None:
        """Note the row, and integrate to the next.

        Args:
            command: (R, n).
            fins: fin angles, rad, (R, m), or None.
            voltage: V, (R,), or None.
        """
        task, k = self.task, len(self.rows)
        last = k == len(task.t) - 1
        begin = float(task.t[k])
        end = begin if last else float(task.t[k + 1])
        self.actuators.hold(command, begin, end)
        self.equations.servos.hold(fins, begin)
        self.equations.speeds.hold(command, begin)
        self.commands.append(command)
        self.fins.append(fins)
        held = (command, fins, voltage)
        thrust = self._acting(begin)
        rate = self.rate(begin, thrust, held)
        seen = self._seen(rate[:, :3], rate[:, 3:])
        self.rows.append((
            np.concatenate([self.place, self.quaternion], -1), np.concatenate([self.v, self.turn], -1), rate,
            seen.position, seen.quaternion, np.concatenate([seen.v, seen.turn], -1),
            np.concatenate([seen.v_dot, seen.turn_dot], -1),
        ))  # fmt: skip
        if last:
            return
        knots = [] if task.laws.wander is None else task.laws.wander.knots(begin, end)
        moments = [begin, *sorted({*self.actuators.breaks(begin, end), *knots}), end]
        try:
            for a, b in pairwise(moments):
                self.integrate(a, b, held)
        except Beyond as far:
            raise self._lost(far.run, begin, held) from None

    def rate(self, t: float, thrust: Array, held: Held) -> Array:
        """Return the acceleration of the present state, (R, 6).

        Args:
            t: s.
            thrust: of the actuators, N, (R, n).
            held: command, fin angles and voltage.
        """
        return self.equations.rate(t, self.place, self.rotation, self.v, self.turn, thrust, held)

    def _acting(self, t: float) -> Array:
        """Return the thrust just after a moment."""
        return self.actuators.between(t, t + 2e-9)(t)

    def integrate(self, begin: float, end: float, held: Held) -> None:
        """Move the state over a stretch in which the thrust does not jump.

        Args:
            begin: s.
            end: s.
            held: command, fin angles and voltage.

        Raises:
            Beyond: a vehicle is faster than anything under water.
        """
        count = len(self.place)
        thrust = self.actuators.between(begin, end)
        state = np.concatenate([self.place, self.rotation.reshape(count, 9), self.v, self.turn], axis=-1)

        def rate(t: float, flat: Array) -> Array:
            y = flat.reshape(count, SIZE)
            place, rotation, v, turn = y[:, :3], y[:, 3:12].reshape(count, 3, 3), y[:, 12:15], y[:, 15:]
            speed = np.abs(y[:, 12:]).max(-1)
            if not (speed < LIMIT).all():
                raise Beyond(int(np.argmin(speed < LIMIT)), t)
            out = np.empty_like(y)
            out[:, :3] = times(rotation, v)
            # Each row of the rotation is a fixed world axis seen from the body, which turns: e_dot = e x w.
            p, q, r = turn[:, :1], turn[:, 1:2], turn[:, 2:]
            a, b, c = rotation[:, :, 0], rotation[:, :, 1], rotation[:, :, 2]
            out[:, 3:12].reshape(count, 3, 3)[...] = np.stack(
                [b * r - c * q, c * p - a * r, a * q - b * p], -1
            )
            out[:, 12:] = self.equations.rate(t, place, rotation, v, turn, thrust(t), held)
            return out.ravel()

        if self.quick and end - begin <= SHORT:
            y = one_step(rate, begin, end, state.ravel()).reshape(count, SIZE)
        else:
            scheme, relative, absolute = EXACT if self.task.max_step <= FINE else FAST
            found = solve_ivp(
                rate,
                (begin, end),
                state.ravel(),
                scheme,
                rtol=relative,
                atol=absolute,
                first_step=end - begin,
            )
            if not found.success:
                raise Beyond(0, begin)
            y = found.y[:, -1].reshape(count, SIZE)
        self.place, self.v, self.turn = y[:, :3], y[:, 12:15], y[:, 15:]
        self.rotation = orthonormal(y[:, 3:12].reshape(count, 3, 3))
        self.quaternion = quaternion_of(self.rotation, self.quaternion)

    def _lost(self, run: int, begin: float, held: Held) -> AuvnnError:
        terms = self.equations.terms(
            begin, self.place, self.rotation, self.v, self.turn, self._acting(begin), held
        )
        term = max(terms, key=lambda n: float(np.abs(terms[n][run]).max()))
        return diverged(self.task.vehicle.name, run, begin, term)

    def motion(self) -> Motion:
        """Return what has been."""
        eta, nu, rate, position, quaternion, velocity, reported = (
            np.stack(column, axis=1) for column in zip(*self.rows, strict=True)
        )
        angles = None if self.fins[0] is None else np.stack([f for f in self.fins if f is not None], axis=1)
        command = np.stack(self.commands, axis=1)
        return Motion(eta, nu, rate, position, quaternion, velocity, reported, command, angles)
