"""The model: known physics, six damping subnetworks, and a list of effects, as one `nn.Module`."""

from __future__ import annotations

import copy
import weakref
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn

from auvnn.effects import HOOKS, Effect, effect_class
from auvnn.effects.registering import values_of
from auvnn.errors import ConfigError
from auvnn.models.actuation.actuators import Actuators
from auvnn.models.actuation.command_path import CommandPath, carried_over
from auvnn.models.equations_of_motion import EquationsOfMotion
from auvnn.models.inputs import Inputs
from auvnn.models.joint_covariance import JointCovariance
from auvnn.models.notebook_view import ShownModel
from auvnn.models.saving import PASSIVE, REGION, SUBNETWORKS, save
from auvnn.models.stated_drag import StatedDrag
from auvnn.physics.drag import element_transform
from auvnn.physics.fins import fin_frame
from auvnn.vehicle import Vehicle

if TYPE_CHECKING:
    from auvnn.damping.bank import DampingBank
    from auvnn.models.free_running.trajectory import Trajectory
    from auvnn.models.linear.linearise import Linearisation


def _tensor(value: Any) -> Tensor:
    """Return numbers as a separate double tensor; a vehicle's arrays are read-only."""
    if isinstance(value, Tensor):
        return value.detach().clone()
    return torch.tensor(np.array(value, dtype=np.float64))


# A model's `without_absent`, as long as the same effects are there.
_WITHOUT: weakref.WeakKeyDictionary[nn.Module, GreyBox] = weakref.WeakKeyDictionary()


class GreyBox(ShownModel, EquationsOfMotion):
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

    Example:
        ```python
        import torch
        model = auvnn.load("rov95")
        nu_dot = model(torch.zeros(6).double(), torch.zeros(6).double(), torch.zeros(model.actuators.size).double())
        ```
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
        if damping is not None and self.passive:
            damping.stated = StatedDrag(vehicle).to(damping.output_scale)
        members = list(effects)
        names = [e.name for e in members]
        for effect in members:
            if names.count(effect.name) > 1:
                raise ConfigError(f"effect {effect.name} is given twice: give it once, with all parameters")
            clash = [n for n in effect.excludes if n in names]
            if clash:
                raise ConfigError(f"effects {effect.name} and {clash[0]} exclude each other: keep one")
        self.effects = nn.ModuleList(members)
        self._by_hook = {h: [e for e in members if h in e.hooks()] for h in HOOKS}
        self._by_hook["wrench"].sort(key=lambda e: not e.is_drag)
        self._by_hook["body"].sort(key=lambda e: not e.scales)
        self.bottom: float | None = None  # its depth, m, for the altitude of simulated vehicles
        self.joint: JointCovariance | None = None  # of the effects' parameters, where a fit has said it
        self.commands: CommandPath | None = None  # between a log's samples, where they are not held
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

    @property
    def before_thrust(self) -> list[Effect]:
        """The effects that decide how thrust and fins follow their commands over time, in order of action."""
        return [e for hook in ("command", "delay", "respond", "steer") for e in self.using(hook)]

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
        """Return the model with further effects (names, classes, instances), at the given values or at their nulls.

        The new model has separate parameters; damping subnetworks and present effects are copied.
        """
        values = values_of(wanted)
        new = [effect_class(n).build(self.vehicle, self.actuation, v) for n, v in values.items()]
        return self.rebuilt([*self.copied_effects(), *new])

    def copied_effects(self) -> list[Effect]:
        """Return copies of the effects, with separate parameters."""
        return [copy.deepcopy(e) for e in self.effects if isinstance(e, Effect)]

    def rebuilt(
        self, effects: Iterable[Effect], vehicle: Vehicle | None = None, actuation: str | None = None
    ) -> GreyBox:
        """Return a model with the same learned parts (copied) but other effects, other numbers, or driven otherwise.

        Args:
            effects: of the new model, in order of action; not copied.
            vehicle: other numbers, or None for the same.
            actuation: "thrusters" or "wrench", or None for the same.
        """
        made = self._like(effects, vehicle or self.vehicle, actuation or self.actuation, shared=False)
        return carried_over(made, self)

    def sharing(self, effects: Iterable[Effect]) -> GreyBox:
        """Return a model with other effects that shares its learned parts with this one: nothing is copied."""
        return carried_over(self._like(effects, self.vehicle, self.actuation, shared=True), self)

    def extended_by(self, *effects: Effect) -> GreyBox:
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

    def rollout(
        self, eta0: Tensor, nu0: Tensor, commands: Tensor | Inputs, times: Tensor, **options: Any
    ) -> Trajectory:
        """Run free from a state: see `auvnn.models.free_running.rollout.rollout`.

        Args:
            eta0: first position and quaternion (..., 7), or with Euler angles (..., 6); m and rad.
            nu0: first velocity, (..., 6), m/s and rad/s.
            commands: (..., T, n), each held until the next row, or `Inputs` with fins, voltage and altitude too.
            times: s, increasing, (T,) or (..., T).
            **options: method, `max_step`, `engine` and others of `rollout`.

        Example:
            ```python
            import torch
            model = auvnn.load("rov95")
            times = torch.arange(0.0, 5.0, 0.05).double()
            still = torch.zeros(6).double()
            ahead = 0.3 * torch.ones(len(times), model.actuators.size).double()
            trajectory = model.rollout(still, still, ahead, times)  # trajectory.nu: (100, 6)
            ```
        """
        from auvnn.models.free_running.rollout import rollout

        return rollout(self, eta0, nu0, commands, times, **options)

    def linearise(
        self, state: Tensor, command: Tensor, dt: float | None = None, **given: Any
    ) -> Linearisation:
        """Return A and B at a state, with the actuators' states: see `auvnn.models.linear.linearise.linearise`.

        Args:
            state: (..., n): position, quaternion or Euler angles, velocity, and the actuators' states if there are
                any.
            command: (..., k), held.
            dt: s, for discrete time; continuous time where None.
            **given: `time`, `fins`, `voltage`, `altitude` and `max_step`.
        """
        from auvnn.models.linear.linearise import linearise

        return linearise(self, state, command, dt, **given)

    def discrete_step(self, state: Tensor, command: Tensor, dt: float, **given: Any) -> Tensor:
        """Return the state after one step: see `auvnn.models.linear.linearise.discrete_step`.

        Args:
            state: (..., n) as in `linearise`.
            command: (..., k), held over the step.
            dt: length of the step, s.
            **given: `time`, `fins`, `voltage`, `altitude` and `max_step`.
        """
        from auvnn.models.linear.linearise import discrete_step

        return discrete_step(self, state, command, dt, **given)

    def learned_parts(self) -> tuple[dict[str, Any], dict[str, Tensor] | None]:
        """Return how what was learned is built again, as entries of a model file, and its weights; None without any."""
        if self.damping is None:
            return {}, None
        described: dict[str, Any] = {SUBNETWORKS: self.damping.describe()}
        if self.damping.region is not None:
            described[REGION] = self.damping.region.to_dict()
        if self.passive:
            described[PASSIVE] = True
        return described, self.damping.state_dict()

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Write the model as a folder: see `auvnn.models.saving.save`."""
        return save(self, folder, overwrite=overwrite)
