"""The actuators: thrust as a function of time, solved exactly between commands, and what flow and battery take."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.polynomial.legendre import legval
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from auvnn.plants.independent.sizes import full_effort
from auvnn.plants.laws import USUAL, Laws
from auvnn.vehicle import ThrustTable, Vehicle

Array = NDArray[np.float64]
Values = Mapping[str, float]
Signal = Callable[[float], Array]


class Actuators:
    """Thrusters, or the axes of a commanded wrench, with their history.

    The thrust is a function of continuous time: the overshoot's flow, the propellers' speed and the lag's gap fade by
    exponentials between commands, and a delay looks back into the pieces before. Nothing is averaged over a row.

    Args:
        vehicle: whose thrusters.
        actuation: "thrusters" or "wrench".
        effects: all of them, in order.
        laws: where the world departs from the stated curves.
    """

    def __init__(
        self, vehicle: Vehicle, actuation: str, effects: Mapping[str, Values], laws: Laws = USUAL
    ) -> None:
        """Collect geometry and curves."""
        self.laws = laws
        self.vehicle, self.wrench = vehicle, actuation == "wrench"
        if self.wrench:
            self.forces, self.turns = np.eye(6)[:3], np.eye(6)[3:]
            self.full: Array = full_effort(vehicle)
        else:
            self.forces = np.array([u.direction for u in vehicle.thrusters]).T
            self.turns = np.array([np.cross(u.position, u.direction) for u in vehicle.thrusters]).T
            self.full = np.ones(len(vehicle.thrusters))
        self.effects = effects
        self.lag = effects.get("thruster_lag", {}).get("time_constant", 0.0)
        self.late = effects.get("actuation_delay", {}).get("delay", 0.0)
        self.begins: list[float] = []
        self.pieces: list[Signal] = []
        self.flow: Array | None = None
        self.speed: Array | None = None
        self.last: Array | None = None

    def names(self) -> list[str]:
        """Return what the actuators are called in parameters."""
        if self.wrench:
            return list("XYZKMN")
        return [f"thruster_{i + 1}" for i in range(len(self.full))]

    def settled(self, command: Array) -> Array:
        """Return the thrust that commands (R, n) give in the end, N."""
        if self.wrench:
            return self.laws.curved(command, command / self.full)
        out = np.empty_like(command)
        for i, unit in enumerate(self.vehicle.thrusters):
            c = command[:, i]
            if isinstance(unit.curve, ThrustTable):
                out[:, i] = np.interp(c, unit.curve.command, unit.curve.thrust)
            else:
                out[:, i] = np.where(c > 0, unit.max_forward * c**2, -unit.max_reverse * c**2)
        return self.laws.curved(out, command)

    def hold(self, command: Array, begin: float, end: float) -> None:
        """Take new commands (R, n) at time `begin`, s, held up to `end`.

        Args:
            command: in [-1, 1], or a wrench, N and N m, (R, n).
            begin: s.
            end: s.
        """
        wanted: Signal = lambda t: command  # noqa: E731
        constant = True
        for name, values in self.effects.items():
            if name == "thruster_deadband":
                wanted = self._deadband(wanted, values["width"])
            elif name == "thrust_curve":
                wanted = self._powers(wanted, values)
            elif name == "thrust_polynomial":
                wanted = self._polynomial(wanted, values)
            elif name == "thrust_overshoot":
                wanted, constant = self._overshoot(wanted, values, begin, end, constant), False
            elif name == "propeller_lag" and values["time_constant"] > 0.0:
                speed = wanted(begin) if self.speed is None else self.speed
                wanted = _following(wanted, speed, begin, end, values["time_constant"], constant)
                self.speed, constant = wanted(end), False

        def demand(t: float) -> Array:
            return self.settled(wanted(t))

        piece = demand if not constant else _always(demand(begin))
        if self.lag > 0.0:
            first = piece(begin) if self.last is None else self.last
            piece = _following(piece, first, begin, end, self.lag, constant)
        self.begins.append(begin)
        self.pieces.append(piece)
        self.last = piece(end)

    def _deadband(self, wanted: Signal, width: float) -> Signal:
        def out(t: float) -> Array:
            share = wanted(t) / self.full
            size = np.abs(share)
            beyond = np.maximum(size - width, 0.0) / (1.0 - width)
            return np.where(size < 1.0, np.copysign(beyond, share), share) * self.full

        return out

    def _powers(self, wanted: Signal, values: Values) -> Signal:
        ahead, astern = ([values[f"{n}_{side}"] for n in self.names()] for side in ("positive", "negative"))

        def out(t: float) -> Array:
            share = wanted(t) / self.full
            return self.full * np.where(share > 0.0, np.abs(share) ** ahead, -(np.abs(share) ** astern))

        return out

    def _polynomial(self, wanted: Signal, values: Values) -> Signal:
        series = [[0.0, *(values[f"{n}_degree_{k}"] for k in range(1, 5))] for n in self.names()]

        def out(t: float) -> Array:
            command = wanted(t)
            share = np.clip(command / self.full, -1.0, 1.0)
            errors = [legval(share[:, i], series[i]) for i in range(len(series))]
            return command * (1.0 + np.stack(errors, axis=1))

        return out

    def _overshoot(self, wanted: Signal, values: Values, begin: float, end: float, constant: bool) -> Signal:
        first = wanted(begin) if self.flow is None else self.flow
        flow = _following(wanted, first, begin, end, values["time_constant"], constant)
        self.flow = flow(end)
        excess = np.array([values[n] for n in self.names()])
        return lambda t: wanted(t) + excess * (wanted(t) - flow(t))

    def breaks(self, begin: float, end: float) -> list[float]:
        """Return the moments between `begin` and `end` at which the thrust may jump."""
        if self.late == 0.0:
            return []
        jumps = np.array(self.begins[1:]) + self.late
        return [float(x) for x in jumps if begin + 1e-12 < x < end - 1e-12]

    def between(self, begin: float, end: float) -> Signal:
        """Return the thrust (R, n), N, as a function of time over a stretch without jumps."""
        middle = 0.5 * (begin + end) - self.late
        index = max(int(np.searchsorted(self.begins, middle, side="right")) - 1, 0)
        piece = self.pieces[index]
        start = self.begins[index]
        return lambda t: piece(max(t - self.late, start))

    def given(self, thrust: Array, turning: Array, voltage: Array | None, flow: Array, turn: Array) -> Array:
        """Return what is left of the thrust (R, n) in a flow (R, 3) with the battery as it is, in order of effects.

        Args:
            thrust: N.
            turning: speed of the propellers as the command that it settles at, (R, n).
            voltage: V, (R,), or None.
            flow: velocity through the water, (R, 3).
            turn: angular rate, (R, 3).
        """
        for name, values in self.effects.items():
            if name == "thruster_gain":
                thrust = thrust * np.array([values[n] for n in self.names()])
            elif name == "thrust_asymmetry":
                lean = np.array([values[n] for n in self.names()])
                thrust = np.where(thrust > 0.0, thrust + lean * thrust, thrust - lean * thrust)
            elif name == "thrust_inflow_loss":
                along = flow @ self.forces
                if not self.wrench:
                    along = along + turn @ self.turns
                thrust = thrust - values["coefficient"] * np.abs(turning / self.full) * along
            elif name == "thrust_advance":
                # The same as J / (1 + |J|) with J = V / (c V_1), and zero where neither turns nor flows anything.
                along = flow @ self.forces
                if not self.wrench:
                    along = along + turn @ self.turns
                share = turning / self.full
                whole = np.abs(share) * values["speed"] + np.abs(along)
                with np.errstate(invalid="ignore", divide="ignore"):
                    fallen = np.where(whole > 0.0, along * np.sign(share) / whole, 0.0)
                thrust = thrust * (1.0 - values["loss"] * fallen)
            elif name == "voltage_droop" and voltage is not None and self.vehicle.reference_voltage:
                share = np.maximum(voltage / self.vehicle.reference_voltage, 1e-3)
                thrust = thrust * np.power(share, values["exponent"])[:, None]
        return thrust

    def torque(self, thrust: Array) -> Array:
        """Return the propellers' reaction (R, 3), N m, if there is any."""
        coefficient = self.effects.get("propeller_torque", {}).get("coefficient", 0.0)
        sense = np.array([u.handedness for u in self.vehicle.thrusters], dtype=float)
        if self.wrench:
            along = thrust[:, :1] * (-1.0 if sense.sum() < 0 else 1.0)
            return coefficient * along * np.array([1.0, 0.0, 0.0])
        return coefficient * (thrust * sense) @ self.forces.T


def _always(value: Array) -> Signal:
    return lambda t: value


def _following(goal: Signal, first: Array, begin: float, end: float, tau: float, constant: bool) -> Signal:
    """Return what goes towards a goal with a first-order lag between two commands, from where it was.

    Args:
        goal: as a function of time.
        first: where it is at `begin`, (R, n).
        begin: s.
        end: s.
        tau: time constant, s.
        constant: whether the goal stays where it is; else the equation is solved by scipy.
    """
    if constant:
        aim = goal(begin)
        gap = first - aim
        return lambda t: aim + gap * np.exp(-(t - begin) / tau)
    if end <= begin:
        return _always(first)
    shape = first.shape

    def rate(t: float, y: Array) -> Array:
        return ((goal(t) - y.reshape(shape)) / tau).ravel()

    found = solve_ivp(rate, (begin, end), first.ravel(), "LSODA", rtol=1e-10, atol=1e-10, dense_output=True)
    return lambda t: found.sol(min(t, end)).reshape(shape)
