"""The model: known physics, six damping subnetworks beside it, and a list of effects, as one `nn.Module`."""

from __future__ import annotations

import copy
import weakref
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn

from auvnn.effects import HOOKS, Body, Effect, Moment, Sensed, effect_class
from auvnn.errors import ConfigError
from auvnn.models.actuators import Actuators
from auvnn.models.inputs import Inputs
from auvnn.models.saving import REGION, SUBNETWORKS, save
from auvnn.physics.attitude import quat_to_matrix
from auvnn.physics.coriolis import coriolis_force
from auvnn.physics.current import water_velocity
from auvnn.physics.drag import element_transform
from auvnn.physics.fins import fin_frame, fin_wrench
from auvnn.physics.inertia import rigid_body_inertia
from auvnn.physics.kinematics import eta6_to_eta7
from auvnn.physics.products import matvec
from auvnn.physics.restoring import restoring_force
from auvnn.vehicle import Vehicle

if TYPE_CHECKING:
    from auvnn.damping.bank import DampingBank
    from auvnn.models.linearise import Linearisation
    from auvnn.models.trajectory import Trajectory


def _tensor(value: Any) -> Tensor:
    """Return numbers as a double tensor of their own; a vehicle's arrays are read-only."""
    if isinstance(value, Tensor):
        return value.detach().clone()
    return torch.tensor(np.array(value, dtype=np.float64))


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


# A model's `without_absent`, as long as the same effects are there.
_WITHOUT: weakref.WeakKeyDictionary[nn.Module, GreyBox] = weakref.WeakKeyDictionary()


class GreyBox(nn.Module):
    """Fossen's equations of one vehicle, with damping subnetworks and effects.

    M_RB nu_dot + C_RB(nu) nu + M_A nu_r_dot + C_A(nu_r) nu_r + D(nu_r) nu_r + d(nu_r) + g(eta) = tau

    D is what the vehicle's file states, d what the subnetworks add to it; either may be absent.

    Args:
        vehicle: the known numbers.
        effects: effects in order of action; names may not repeat.
        damping: six damping subnetworks (a `DampingBank`), or None.
        actuation: "thrusters" or "wrench"; by default thrusters where the vehicle has them.

    Raises:
        ConfigError: effects repeat or exclude one another.

    Reference: Fossen (2011), equations 6.41 to 6.60 and 8.134; Van de Ven, Flanagan and Toal (2004), eq. 15.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        effects: Iterable[Effect] = (),
        damping: DampingBank | None = None,
        actuation: str | None = None,
    ) -> None:
        """Turn the vehicle's numbers into buffers."""
        super().__init__()
        self.vehicle = vehicle
        self.actuation = actuation or ("thrusters" if vehicle.thrusters else "wrench")
        self.actuators = Actuators(vehicle, self.actuation)
        self.damping = damping
        members = list(effects)
        names = [e.name for e in members]
        for effect in members:
            if names.count(effect.name) > 1:
                raise ConfigError(
                    f"effect {effect.name} is given twice: give it once, with all its parameters"
                )
            clash = [n for n in effect.excludes if n in names]
            if clash:
                raise ConfigError(f"effects {effect.name} and {clash[0]} exclude each other: keep one")
        self.effects = nn.ModuleList(members)
        self._by_hook = {h: [e for e in members if h in e.hooks()] for h in HOOKS}
        # Depth of a flat bottom, m: gives the altitude to a simulated vehicle that has no altimeter to go by.
        self.bottom: float | None = None
        self.time_varying = any(e.time_varying for e in self._by_hook["body"])
        self._constants(vehicle)

    def _constants(self, vehicle: Vehicle) -> None:
        def keep(name: str, value: Any) -> None:
            self.register_buffer(f"known_{name}", None if value is None else _tensor(value), persistent=False)

        keep("mass", float(vehicle.mass))
        keep("weight", float(vehicle.mass) * float(vehicle.gravity))
        keep("buoyancy", float(vehicle.buoyancy))
        keep("cg", vehicle.center_of_gravity)
        keep("cb", vehicle.center_of_buoyancy)
        keep("inertia", vehicle.inertia)
        keep("added_mass", vehicle.added_mass)
        keep("linear", vehicle.linear_damping)
        keep("quadratic", vehicle.quadratic_damping)
        elements = vehicle.damping_elements
        for name in ("linear", "quadratic"):
            keep(f"element_{name}", [list(getattr(e, name)) for e in elements] or None)
        # Geometry never changes: the way from the vehicle's velocity to each part's own is worked out once.
        keep(
            "element_transform",
            [element_transform(_tensor(e.position), _tensor(e.axes)).tolist() for e in elements] or None,
        )
        fins = vehicle.fins
        for name in ("area", "lift_slope", "stall"):
            keep(f"fin_{name}", [float(getattr(f, name)) for f in fins] or None)
        keep(
            "fin_frame",
            fin_frame(_tensor([f.position for f in fins]), _tensor([f.axis for f in fins])) if fins else None,
        )

        reduced = vehicle.reduced
        keep("kept", np.eye(6)[:, list(reduced.moved)] if reduced else None)
        keep("turned", np.isin(np.arange(6), reduced.turned).astype(float) if reduced.turned else None)

    def _known(self, name: str) -> Any:
        return getattr(self, f"known_{name}")

    def using(self, hook: str) -> list[Effect]:
        """Return the effects that override a hook, in order of action."""
        return self._by_hook[hook]

    @property
    def before_thrust(self) -> list[Effect]:
        """The effects that decide how thrust follows from commands over time, in order of action."""
        return [e for hook in ("command", "delay", "respond") for e in self.using(hook)]

    @property
    def members(self) -> list[Effect]:
        """The effects, in order of action."""
        return [e for e in self.effects if isinstance(e, Effect)]

    @property
    def effect_names(self) -> list[str]:
        """Names of the effects, in order of action."""
        return [str(e.name) for e in self.members]

    def effect(self, name: str) -> Effect:
        """Return an effect by name.

        Raises:
            ConfigError: the model has no such effect.
        """
        for effect in self.members:
            if effect.name == name:
                return effect
        raise ConfigError(
            f"the model has no effect {name!r}; it has: {', '.join(self.effect_names) or 'none'}"
        )

    def with_effects(self, wanted: Sequence[str] | Mapping[str, Mapping[str, float] | None]) -> GreyBox:
        """Return the model with further effects, at the given values or at their nulls.

        The new model has parameters of its own; damping subnetworks and present effects are copied.
        """
        values = wanted if isinstance(wanted, Mapping) else dict.fromkeys(wanted)
        new = [effect_class(n).build(self.vehicle, self.actuation, v) for n, v in values.items()]
        return self.rebuilt([*self.copied_effects(), *new])

    def copied_effects(self) -> list[Effect]:
        """Return copies of the effects, with parameters of their own."""
        return [copy.deepcopy(e) for e in self.effects if isinstance(e, Effect)]

    def rebuilt(
        self, effects: Iterable[Effect], vehicle: Vehicle | None = None, actuation: str | None = None
    ) -> GreyBox:
        """Return a model with the same learned parts (copied) but other effects, other numbers, or driven otherwise."""
        return self._like(effects, vehicle or self.vehicle, actuation or self.actuation, shared=False)

    def sharing(self, effects: Iterable[Effect]) -> GreyBox:
        """Return a model with other effects that shares its learned parts with this one: nothing is copied."""
        return self._like(effects, self.vehicle, self.actuation, shared=True)

    def beside(self, *effects: Effect) -> GreyBox:
        """Return the model with further effects, probes among them: its own are copied, learned parts shared."""
        return self.sharing([*self.copied_effects(), *effects])

    def _like(self, effects: Iterable[Effect], vehicle: Vehicle, actuation: str, *, shared: bool) -> GreyBox:
        """Return a model of the same kind: the one place where a model is built from another one."""
        damping = self.damping if shared else copy.deepcopy(self.damping)
        return GreyBox(vehicle, effects, damping, actuation).to(self._known("mass"))

    def without_absent(self, keep: Sequence[str] = ()) -> GreyBox:
        """Return the model without the effects that are at their nulls, but for those named in `keep`.

        It predicts the same at less cost. Effects and subnetworks are shared with this model, not copied. While the
        same effects are there it is the same model each time: what runs it compiled knows it again.
        """
        left = [e for e in self.members if e.name in keep or not e.absent()]
        if len(left) == len(self.members):
            return self
        known = _WITHOUT.get(self)
        if known is None or not known.shares(self, left):
            known = self.sharing(left)
            _WITHOUT[self] = known
        return known

    def shares(self, other: GreyBox, effects: Sequence[Effect]) -> bool:
        """Whether this model has these very effects, and all else in common with another one."""
        return (
            len(self.members) == len(effects)
            and all(mine is theirs for mine, theirs in zip(self.members, effects, strict=True))
            and self.damping is other.damping
            and self.vehicle is other.vehicle
            and self._known("mass").dtype == other._known("mass").dtype
            and self._known("mass").device == other._known("mass").device
        )

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
        kept = self._known("kept")
        if kept is None:
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
    ) -> Tensor:
        """Return the acceleration from the thrust that acts now; see `forward` for shapes and units."""
        terms, prepared = self._terms(position, rotation, nu, thrust, inputs, time, prepared)
        first, *others = terms.values()
        for term in others:
            first = first + term
        turned = self._known("turned")
        if turned is None:
            return matvec(prepared.inverse, first)
        # The last three of the command are then the accelerations of the measured attitude, not moments.
        turning = turned * inputs.command
        return matvec(prepared.inverse, first - matvec(prepared.total, turning)) + turning

    def wrenches(
        self, position: Tensor, rotation: Tensor, nu: Tensor, thrust: Tensor, inputs: Inputs, time: Tensor
    ) -> dict[str, Tensor]:
        """Return the wrench of each term on the right-hand side of M nu_dot = ..., N and N m, (..., 6)."""
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
            inputs.fins,
            inputs.voltage,
            altitude,
        )
        nu_r, moving = nu, self.using("water")
        if moving:
            velocity, acceleration = moving[0].water(moment)
            for effect in moving[1:]:
                more, faster = effect.water(moment)
                velocity, acceleration = velocity + more, acceleration + faster
            nu_c, nu_c_dot = water_velocity(rotation, nu[..., 3:], velocity, acceleration)
            nu_r = nu - nu_c
            moment = replace(moment, nu_r=nu_r, nu_c_dot=nu_c_dot)
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
            terms["linear damping"] = -matvec(body.linear, nu_r)
        if body.quadratic is not None:
            terms["quadratic damping"] = -matvec(body.quadratic, nu_r.abs() * nu_r)
        if body.element_linear is not None and body.element_quadratic is not None:
            to_parts = self._known("element_transform").flatten(0, 1)
            own = matvec(to_parts, nu_r)
            law = body.element_linear.flatten(-2) + body.element_quadratic.flatten(-2) * own.abs()
            terms["damping elements"] = -matvec(to_parts.mT, law * own)
        if self.damping is not None:
            terms["damping subnetworks"] = -self.damping(nu_r)
        terms["restoring"] = -restoring_force(rotation, body.weight, body.buoyancy, body.hangs, body.cb)
        if self._known("fin_area") is not None:
            # Fins whose angles are not known are still there: they are taken as held at zero.
            angles = nu_r.new_zeros(len(self.vehicle.fins)) if inputs.fins is None else inputs.fins
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
            terms[str(effect.name)] = effect.wrench(moment, body)
        return terms, prepared

    def sense(self, sensed: Sensed) -> Sensed:
        """Return what the sensors report of a state."""
        for effect in self.using("sense"):
            sensed = effect.sense(sensed)
        return sensed

    def unsense(self, sensed: Sensed, rounds: int = 4) -> Sensed:
        """Return the state that the sensors' report stands for, by fixed-point iteration.

        Sensor effects are small corrections, so each round gains about as many digits as they are small.
        """
        if not self.using("sense"):
            return sensed
        state = sensed
        for _ in range(rounds):
            seen = self.sense(state)
            rate = None
            if sensed.nu_dot is not None and state.nu_dot is not None and seen.nu_dot is not None:
                rate = state.nu_dot + sensed.nu_dot - seen.nu_dot
            quaternion = state.quaternion + sensed.quaternion - seen.quaternion
            quaternion = quaternion / torch.linalg.norm(quaternion, dim=-1, keepdim=True)
            state = Sensed(
                state.position + sensed.position - seen.position,
                quaternion,
                state.nu + sensed.nu - seen.nu,
                rate,
            )
        return state

    def rollout(
        self, eta0: Tensor, nu0: Tensor, commands: Tensor | Inputs, times: Tensor, **options: Any
    ) -> Trajectory:
        """Run free from a state: see `auvnn.models.rollout.rollout`."""
        from auvnn.models.rollout import rollout

        return rollout(self, eta0, nu0, commands, times, **options)

    def linearise(
        self, state: Tensor, command: Tensor, dt: float | None = None, **given: Any
    ) -> Linearisation:
        """Return A and B at a state, with the actuators' states: see `auvnn.models.linearise.linearise`."""
        from auvnn.models.linearise import linearise

        return linearise(self, state, command, dt, **given)

    def discrete_step(self, state: Tensor, command: Tensor, dt: float, **given: Any) -> Tensor:
        """Return the state after one step: see `auvnn.models.linearise.discrete_step`."""
        from auvnn.models.linearise import discrete_step

        return discrete_step(self, state, command, dt, **given)

    def learned_parts(self) -> tuple[dict[str, Any], dict[str, Tensor] | None]:
        """Return how what was learned is built again, as entries of a model file, and its weights; None without any."""
        if self.damping is None:
            return {}, None
        described: dict[str, Any] = {SUBNETWORKS: self.damping.describe()}
        if self.damping.region is not None:
            described[REGION] = self.damping.region.to_dict()
        return described, self.damping.state_dict()

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Write the model as a folder: see `auvnn.models.saving.save`."""
        return save(self, folder, overwrite=overwrite)
