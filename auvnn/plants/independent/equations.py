"""The equations of motion in vectors: a rigid body by Newton and Euler, the fluid by its impulse (Kirchhoff)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.plants.independent.around import Around
from auvnn.plants.independent.fins import Fins
from auvnn.plants.independent.forces import Forces
from auvnn.plants.independent.hull import build, curved, grasp
from auvnn.plants.independent.loads import LOADS, Instant
from auvnn.plants.independent.servos import Servos
from auvnn.plants.independent.sizes import sphere_radius
from auvnn.plants.independent.thrust import Actuators
from auvnn.plants.independent.vectors import cross, cross_matrix, times
from auvnn.plants.independent.water import water
from auvnn.plants.laws import USUAL, Laws
from auvnn.plants.strangers import STRANGERS
from auvnn.plants.strangers.base import Seen
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]
Values = Mapping[str, float]
# Command (R, n), fin angles (R, m) or None, voltage (R,) or None.
Held = tuple[Array, Array | None, Array | None]


class Equations(Forces):
    """Accelerations of R vehicles.

    With total mass m, first moment s = sum m_i r_i and inertia J about the origin of all rigid parts:

        F = m (v_dot + w x v) + w_dot x s + w x (w x s)
        N = J w_dot + w x (J w) + s x (v_dot + w x v)

    The water around has the impulse (P, L) = M_A (v_r, w); what it does to the body is

        F = -(P_dot + w x P),    N = -(L_dot + w x L + v_r x P)

    with P_dot taken in the body: v_r changes by v_dot - R'a + w x R'v_c. Parts whose mass grows take up water
    at rest: -m_dot (v_r + w x r). Near bottom or surface M_A is (1 + f) times itself, so that the impulse changes
    with the distance too, and the gradient of the fluid's energy pulls.
    Reference: Goldstein (1980), chapter 5; Lamb (1932), sections 119 to 124.

    Args:
        vehicle: plain numbers.
        effects: all that act, name to parameters, in order.
        strangers: effects outside the catalogue.
        actuators: of the vehicle.
        bottom: depth, m, or None.
        laws: where the world departs from these equations.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        effects: Mapping[str, Values],
        strangers: Mapping[str, Values],
        actuators: Actuators,
        bottom: float | None,
        laws: Laws = USUAL,
    ) -> None:
        """Work out what does not change."""
        self.laws, self.curve = laws, curved(laws, vehicle, effects)
        self.vehicle, self.effects, self.actuators, self.bottom = vehicle, effects, actuators, bottom
        self.hull = build(vehicle, effects)
        self.loads = [(name, LOADS[name], values) for name, values in effects.items() if name in LOADS]
        self.strangers = [(n, STRANGERS.get(n), values) for n, values in strangers.items()]
        self.fins = None
        self.servos = Servos(effects.get("fin_lag", {}).get("time_constant", 0.0))
        # The propellers' speed as the command that it settles at: losses by inflow go by it.
        self.speeds = Servos(effects.get("propeller_lag", {}).get("time_constant", 0.0))
        if vehicle.fins:
            self.fins = Fins(vehicle, laws.separation, effects)
        self.moves = any(n in effects for n in ("ocean_current", "current_shear", "waves"))
        # Share of the hull's lift that is lost across the flow.
        self.fading = laws.separation + effects.get("body_lift_stall", {}).get("share", 0.0)
        # Share of the water's motion that anything but the drag feels.
        self.felt = laws.relative * (1.0 - effects.get("drag_only_current", {}).get("share", 0.0))
        # Share of the ideal forces of the water's inertia that acts on a body that moves steadily.
        self.gyration = laws.added_coriolis * effects.get("added_mass_coriolis", {}).get("factor", 1.0)
        self.held = grasp(effects["payload"]["time"], vehicle) if "payload" in effects else None
        self.radius = sphere_radius(vehicle)
        self.walls = [n for n in ("bottom_proximity", "surface_proximity") if n in effects]
        fixed = [lump for lump in self.hull.lumps if lump.share is None]
        self.growing = [lump for lump in self.hull.lumps if lump.share is not None]
        # Mass, first moment and inertia are sums over the parts, and so is the matrix that they make.
        self.parts = [(lump, lump.moments(), self._rigid_matrix(*lump.moments())) for lump in self.growing]
        self.fixed: list[Any] = [sum(part) for part in zip(*(lump.moments() for lump in fixed), strict=True)]
        mass, moment, inertia = self.fixed
        self.start = self._rigid_matrix(mass, moment, inertia)
        changing = self.growing or self.walls
        self.inverse = None if changing else np.linalg.inv(self.start + self.hull.added)
        self.drags = [bool(np.any(self.hull.linear)), bool(np.any(self.hull.quadratic))]

    @staticmethod
    def _rigid_matrix(mass: float, first: Array, inertia: Array) -> Array:
        """Return what stands in front of (v_dot, w_dot) for rigid parts, (6, 6)."""
        x = cross_matrix(first)
        return np.block([[mass * np.eye(3), -x], [x, inertia]])

    def matrix(self, t: float, grown: Array) -> Array:
        """Return it for body and water at a time, (6, 6) or (R, 6, 6)."""
        rigid = self.start
        for lump, _, matrix in self.parts:
            assert lump.share is not None
            rigid = rigid + lump.share(t)[0] * matrix
        return rigid + (grown[:, :, None] if self.walls else 1.0) * self.hull.added

    def _rigid(self, t: float) -> list[Any]:
        """Return mass, first moment and inertia of all that is there at a time."""
        total = list(self.fixed)
        for lump, moments, _ in self.parts:
            assert lump.share is not None
            share = lump.share(t)[0]
            total = [a + share * b for a, b in zip(total, moments, strict=True)]
        return total

    def around(self, t: float, place: Array, rotation: Array, v: Array, turn: Array) -> Around:
        """Return what the water does where the vehicles are.

        Args:
            t: s.
            place: NED, m, (R, 3).
            rotation: body to NED, (R, 3, 3).
            v: over ground, m/s, (R, 3).
            turn: angular rate, rad/s, (R, 3).
        """
        depth = place[:, 2:]
        flow, dragged, gain = v, v, None
        if self.moves:
            stream, change = water(self.effects, self.vehicle, t, place, times(rotation, v))
            to_body = rotation.transpose(0, 2, 1)
            along = times(to_body, stream)
            felt, dragged = self.felt * along, v - along
            flow, gain = v - felt, self.felt * times(to_body, change) - cross(turn, felt)
        walls = [self._wall(n, depth) for n in self.walls]
        grown = np.ones_like(depth)
        for f, _ in walls:
            grown = grown * (1.0 + f)
        return Around(flow, dragged, gain, walls, grown)

    def inertial(self, t: float, v: Array, turn: Array, near: Around) -> dict[str, Array]:
        """Return what motion itself asks for, of the body and of the water, (R, 6) each.

        Args:
            t: s.
            v: over ground, m/s, (R, 3).
            turn: angular rate, rad/s, (R, 3).
            near: the water around.
        """
        mass, first, inertia = self._rigid(t)
        s = np.broadcast_to(first, v.shape)
        swing = cross(turn, v)
        force = -(mass * swing + cross(turn, cross(turn, s)))
        moment = -(cross(turn, turn @ inertia.T) + cross(s, swing))
        impulse = near.grown * (np.concatenate([near.flow, turn], axis=-1) @ self.hull.added.T)
        p, m = impulse[:, :3], impulse[:, 3:]
        out = {
            "inertia of the body": np.concatenate([force, moment], axis=-1),
            "inertia of the water": -self.gyration
            * np.concatenate([cross(turn, p), cross(turn, m) + cross(near.flow, p)], axis=-1),
        }
        if near.gain is not None:
            out["water acceleration"] = near.grown * (near.gain @ self.hull.added[:, :3].T)
        return out

    def forces(
        self,
        t: float,
        place: Array,
        rotation: Array,
        v: Array,
        turn: Array,
        thrust: Array,
        held: Held,
        near: Around,
    ) -> dict[str, Array]:
        """Return every other force and moment by name, (R, 6) each; shapes as in `terms`.

        Args:
            t: s.
            place: NED, m, (R, 3).
            rotation: body to NED, (R, 3, 3).
            v: over ground, m/s, (R, 3).
            turn: angular rate, rad/s, (R, 3).
            thrust: of the actuators, N, (R, n).
            held: command, fin angles and voltage.
            near: the water around.
        """
        command, angles, voltage = held
        down, flow = rotation[:, 2, :], near.flow
        drag = self.drag(near.dragged, turn)
        out = {"drag": drag}
        share = self._more_drag(t, near)
        if share is not None:
            out["added drag"] = share * drag
        if near.walls:
            out["walls"] = self._walls(v, turn, down, near)
        turning = self.speeds.now(t, command)
        assert turning is not None
        left = self.actuators.given(thrust, turning, voltage, flow, turn)
        moment = left @ self.actuators.turns.T
        if "propeller_torque" in self.effects:
            moment = moment + self.actuators.torque(left)
        out["thrust"] = np.concatenate([left @ self.actuators.forces.T, moment], axis=-1)
        if self.fins is not None:
            turned = self.servos.now(t, angles)
            out["fins"] = np.concatenate(self.fins.wrench(flow, turn, turned), axis=-1)
        out["weight"] = self._weight(t, down, flow, turn)
        if self.loads:
            a = (near.grown * np.diagonal(self.hull.added)[:3]).T
            instant = Instant(
                self.vehicle, t, place, rotation, down, v, turn, flow, near.dragged, command,
                self.hull.buoyancy, self.hull.cb, (a[2] - a[0], a[1] - a[0]), self.fading,
            )  # fmt: skip
            for name, load, values in self.loads:
                out[f"force of {name}"] = np.concatenate(load(values, instant), axis=-1)
        if self.laws.wander is not None:
            out["a wandering force"] = self.laws.wander.at(t)
        if self.strangers:
            seen = Seen(self.vehicle, t, place, rotation, flow, turn, out["thrust"])
            for name, member, values in self.strangers:
                out[name] = member.wrench(values, seen)
        return out

    def terms(
        self, t: float, place: Array, rotation: Array, v: Array, turn: Array, thrust: Array, held: Held
    ) -> dict[str, Array]:
        """Return every force and moment (R, 6) by name.

        Args:
            t: s.
            place: NED, m, (R, 3).
            rotation: body to NED, (R, 3, 3).
            v: over ground, (R, 3).
            turn: angular rate, (R, 3).
            thrust: of the actuators, before what flow and battery take, N, (R, n).
            held: command, fin angles and voltage.
        """
        near = self.around(t, place, rotation, v, turn)
        return self.inertial(t, v, turn, near) | self.forces(t, place, rotation, v, turn, thrust, held, near)

    def rate(
        self, t: float, place: Array, rotation: Array, v: Array, turn: Array, thrust: Array, held: Held
    ) -> Array:
        """Return (v_dot, w_dot), (R, 6); arguments as in `terms`.

        Args:
            t: s.
            place: NED, m, (R, 3).
            rotation: body to NED, (R, 3, 3).
            v: over ground, m/s, (R, 3).
            turn: angular rate, rad/s, (R, 3).
            thrust: of the actuators, N, (R, n).
            held: command, fin angles and voltage.
        """
        near = self.around(t, place, rotation, v, turn)
        first, *others = self.inertial(t, v, turn, near).values()
        total = first.copy()
        for part in (*others, *self.forces(t, place, rotation, v, turn, thrust, held, near).values()):
            total += part
        if self.inverse is not None:
            return total @ self.inverse.T
        matrix = self.matrix(t, near.grown)
        inverse: Array = np.linalg.inv(matrix).astype(np.float64)
        return times(inverse, total) if self.walls else total @ inverse.T
