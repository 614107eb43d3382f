"""The equations of motion of one vehicle: every force by name, the acceleration, and what sensors report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from auvnn.effects import Body, Moment
from auvnn.errors import ConfigError
from auvnn.models.actuation.acting import apart, speeds_follow
from auvnn.models.actuation.actuators import Actuators
from auvnn.models.input_conversion import as_tensor, own
from auvnn.models.inputs import Inputs
from auvnn.models.moving_water import in_moving_water
from auvnn.models.sensors import Sensors
from auvnn.physics.attitude import quat_to_matrix
from auvnn.physics.coriolis import coriolis_force
from auvnn.physics.fins import fin_wrench
from auvnn.physics.inertia import rigid_body_inertia
from auvnn.physics.kinematics import eta6_to_eta7
from auvnn.physics.products import matvec, solved_to_first_order
from auvnn.physics.restoring import restoring_force
from auvnn.vehicle import Vehicle

if TYPE_CHECKING:
    from auvnn.damping.bank import DampingBank


# The terms of the equation of motion that resist motion through the water.
DRAG_TERMS = ("linear damping", "quadratic damping", "damping elements", "damping subnetworks")


@dataclass(frozen=True)
class Prepared:
    """What of the equations does not change with the state: body and inertia matrices, (..., 6, 6)."""

    body: Body
    rigid: Tensor
    added: Tensor
    total: Tensor
    inverse: Tensor


class EquationsOfMotion(Sensors):
    """What follows from a vehicle's numbers, its damping and its effects: forces, accelerations, what sensors report.

    Attributes:
        vehicle: the known numbers.
        actuation: "thrusters" or "wrench".
        actuators: what turns commands into thrust.
        damping: six damping subnetworks, or None.
        bottom: depth of a flat bottom, m, or None.
        time_varying: whether body and inertia matrices change with time.
    """

    vehicle: Vehicle
    actuation: str
    actuators: Actuators
    damping: DampingBank | None
    bottom: float | None
    time_varying: bool

    def _known(self, name: str) -> Any:
        return getattr(self, f"known_{name}")

    @property
    def passive(self) -> bool:
        """Whether the subnetworks are kept from making the drag as a whole give energy."""
        return bool(getattr(self.damping, "passive", False))

    def prepare(self, moment: Moment | None = None) -> Prepared:
        """Work out body and inertia matrices; `moment` is needed only where an effect varies in time."""
        body = Body(
            *(
                self._known(n)
                for n in (
                    "mass",
                    "weight",
                    "buoyancy",
                    "cg",
                    "cb",
                    "inertia",
                    "added_mass",
                    "linear",
                    "quadratic",
                    "element_linear",
                    "element_quadratic",
                )
            )
        )
        for effect in self.using("body"):
            body = effect.body(body, moment)
        rigid = rigid_body_inertia(body.mass, body.inertia, body.cg)
        total = rigid + body.added_mass
        return Prepared(body, rigid, body.added_mass, total, self._inverse(total))

    def _inverse(self, total: Tensor) -> Tensor:
        """Return the inverse of the inertia; of a reduced model, that of the part that forces and moments move."""
        if (kept := self._known("kept")) is None:
            return torch.linalg.inv(total)
        return kept @ torch.linalg.inv(kept.mT @ total @ kept) @ kept.mT

    def forward(
        self,
        eta: Tensor,
        nu: Tensor,
        command: Tensor,
        *,
        time: Tensor | float = 0.0,
        fins: Tensor | None = None,
        voltage: Tensor | None = None,
        altitude: Tensor | None = None,
    ) -> Tensor:
        """Return the acceleration, with the actuators settled at their commands.

        Numpy arrays and lists are taken too, and tensors that are less precise than the model.

        Args:
            eta: position and attitude (..., 7) with a quaternion (w, x, y, z), or (..., 6) with Euler angles.
            nu: velocity (..., 6), m/s and rad/s, over ground, of the body origin.
            command: thruster commands (..., n) in [-1, 1], or the wrench (..., 6), N and N m.
            time: s since the start of the run, (...).
            fins: fin angles (..., m), rad; zero where they are not given.
            voltage: V, (...).
            altitude: m, (...).

        Returns:
            nu_dot (..., 6), m/s2 and rad/s2.

        Raises:
            ConfigError: the last size of a tensor is not what the model takes.
        """
        like = own(self)
        eta, nu = as_tensor(eta, like, "eta"), as_tensor(nu, like, "nu")
        command, fins = as_tensor(command, like, "command"), as_tensor(fins, like, "fins")
        voltage, altitude = as_tensor(voltage, like, "voltage"), as_tensor(altitude, like, "altitude")
        sizes = (eta.shape[-1:], nu.shape[-1:], command.shape[-1:])
        if sizes[0] not in ((6,), (7,)) or sizes[1:] != ((6,), (self.actuators.size,)):
            raise ConfigError(
                f"eta {tuple(eta.shape)}, nu {tuple(nu.shape)}, command {tuple(command.shape)}: the last sizes "
                f"are 6 or 7, 6, and {self.actuators.size} ({self.actuation})"
            )
        if fins is not None and self.vehicle.fins and fins.shape[-1:] != (len(self.vehicle.fins),):
            raise ConfigError(f"fins {tuple(fins.shape)}: the vehicle has {len(self.vehicle.fins)} fins")
        if eta.shape[-1] == 6:
            eta = eta6_to_eta7(eta)
        inputs = Inputs(command, fins, voltage, altitude)
        moment_time = torch.as_tensor(time, dtype=nu.dtype, device=nu.device)
        lead = torch.broadcast_shapes(moment_time.shape, command.shape[:-1])
        drive = self.actuators.drive(
            command.expand(*lead, self.actuators.size).unsqueeze(-2),
            moment_time.expand(lead).unsqueeze(-1),
            self.using("command"),
            speeds=speeds_follow(self),
        )
        return self.nu_dot(
            eta[..., :3], quat_to_matrix(eta[..., 3:]), nu, drive.start[0], inputs, moment_time
        )

    def nu_dot(
        self,
        position: Tensor,
        rotation: Tensor,
        nu: Tensor,
        thrust: Tensor,
        inputs: Inputs,
        time: Tensor,
        prepared: Prepared | None = None,
        *,
        first_order: bool = False,
    ) -> Tensor:
        """Return the acceleration from the thrust that acts now; see `forward` for shapes and units.

        Args:
            position: NED, m, (..., 3).
            rotation: body to NED, (..., 3, 3).
            nu: velocity over ground, m/s and rad/s, (..., 6).
            thrust: of the actuators, N, (..., n); the fins' actual angles, rad, may follow it, and then the propellers'
                speed (`speeds_follow`), and count instead of what the inputs say.
            inputs: at this moment.
            time: s since the start of the run, (...).
            prepared: body and inertia matrices; worked out here where None.
            first_order: the same value and first derivatives at less cost; derivatives of these are wrong.
        """
        terms, prepared = self._terms(position, rotation, nu, thrust, inputs, time, prepared)
        first, *others = terms.values()
        first = sum(others, first)
        # The last three of the command may be the accelerations of the measured attitude, not moments.
        turning = None if self._known("turned") is None else self._known("turned") * inputs.command
        if turning is not None:
            first = first - matvec(prepared.total, turning)
        total, inverse = prepared.total, prepared.inverse
        found = solved_to_first_order(total, inverse, first) if first_order else matvec(inverse, first)
        return found if turning is None else found + turning

    def wrenches(
        self, position: Tensor, rotation: Tensor, nu: Tensor, thrust: Tensor, inputs: Inputs, time: Tensor
    ) -> dict[str, Tensor]:
        """Return the wrench of each term on the right-hand side of M nu_dot = ..., N and N m, (..., 6).

        Args:
            position: NED, m, (..., 3).
            rotation: body to NED, (..., 3, 3).
            nu: velocity over ground, m/s and rad/s, (..., 6).
            thrust: of the actuators, N, (..., n), with the fins' actual angles after it or not.
            inputs: at this moment.
            time: s since the start of the run, (...).
        """
        return self._terms(position, rotation, nu, thrust, inputs, time, None)[0]

    def _terms(
        self,
        position: Tensor,
        rotation: Tensor,
        nu: Tensor,
        thrust: Tensor,
        inputs: Inputs,
        time: Tensor,
        prepared: Prepared | None,
    ) -> tuple[dict[str, Tensor], Prepared]:
        thrust, fins, speed = apart(self, thrust, inputs, self.actuators.size)
        altitude = inputs.altitude
        if altitude is None and self.bottom is not None:
            altitude = self.bottom - position[..., 2]
        moment = Moment(
            time,
            position,
            rotation,
            nu,
            nu,
            torch.zeros_like(nu),
            inputs.command,
            fins,
            inputs.voltage,
            altitude,
            speed=speed,
        )
        moving = self.using("water")
        if moving:
            moment = in_moving_water(moment, moving, self.using("flow"))
        nu_r, through = moment.nu_r, moment.drag_flow
        if prepared is None or self.time_varying:
            prepared = self.prepare(moment)
        body, terms = prepared.body, {}
        for effect in self.using("thrust"):
            thrust = effect.thrust(thrust, moment)
        terms["thrust"] = thrust @ self.actuators.allocation.mT
        if moving:
            terms["Coriolis"] = -coriolis_force(prepared.rigid, nu) - coriolis_force(prepared.added, nu_r)
            terms["water acceleration"] = matvec(prepared.added, moment.nu_c_dot)
        else:
            terms["Coriolis"] = -coriolis_force(prepared.total, nu)
        if body.linear is not None:
            terms["linear damping"] = -matvec(body.linear, through)
        if body.quadratic is not None:
            terms["quadratic damping"] = -matvec(body.quadratic, through.abs() * through)
        if body.element_linear is not None and body.element_quadratic is not None:
            to_parts = self._known("element_transform").flatten(0, 1)
            own = matvec(to_parts, through)
            law = body.element_linear.flatten(-2) + body.element_quadratic.flatten(-2) * own.abs()
            terms["damping elements"] = -matvec(to_parts.mT, law * own)
        if self.damping is not None:
            if self.passive:
                stated = [terms[name] for name in DRAG_TERMS if name in terms]
                learned = self.damping(through, -sum(stated, torch.zeros_like(through)))
            else:
                learned = self.damping(through)
            terms["damping subnetworks"] = -learned
        terms["restoring"] = -restoring_force(rotation, body.weight, body.buoyancy, body.hangs, body.cb)
        if self._known("fin_area") is not None:
            # Fins whose angles are not known are still there: they are taken as held at zero.
            angles = nu_r.new_zeros(len(self.vehicle.fins)) if fins is None else fins
            terms["fins"] = fin_wrench(
                nu_r,
                angles,
                self._known("fin_frame"),
                self._known("fin_area"),
                self._known("fin_lift_slope"),
                self._known("fin_stall"),
                float(self.vehicle.water_density),
            )
        if self.using("wrench"):
            drag = [terms[name] for name in DRAG_TERMS if name in terms]
            moment = replace(moment, thrust=thrust, drag=sum(drag, torch.zeros_like(nu)))
        for effect in self.using("wrench"):
            more = terms[str(effect.name)] = effect.wrench(moment, body)
            moment = effect.onward(moment)
            if effect.is_drag and moment.drag is not None:
                # What lets the drag grow, near a wall or by fouling, lets all of it grow; it comes after.
                moment = replace(moment, drag=moment.drag + more)
        return self._with_learned(terms, prepared, nu, rotation), prepared

    def _with_learned(
        self, terms: dict[str, Tensor], prepared: Prepared, nu: Tensor, rotation: Tensor
    ) -> dict[str, Tensor]:
        """Return the terms as they are; structures with learned parts put these beside or in the place of known ones."""
        return terms
