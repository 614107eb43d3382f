"""Six degrees of freedom of damping as one module: any mixture of forms, a kind evaluated at once."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from auvnn.catalogue import unknown_name
from auvnn.damping import DAMPING
from auvnn.damping.base import AXES, DampingForm
from auvnn.damping.passive import passive
from auvnn.damping.region import Region
from auvnn.errors import ConfigError

Description = str | Mapping[str, Any]


class DampingBank(nn.Module):
    """The damping of all six degrees of freedom.

    d_i(nu) = output_scale_i f_i(nu / input_scale), on the left-hand side: M nu_dot + ... + d(nu) = tau

    Forms of one kind with equal options are joined, so that the six default networks cost one product. The
    scales are buffers: they travel with the weights but are not trained. Being pure factors (no shift) they
    keep signs and zeros, so what a form promises of them holds in SI units too.

    Args:
        forms: forms whose axes together are 0 to 5, each once; usually six of one axis each.
        input_scale: (6,) positive, m/s and rad/s; default ones.
        output_scale: (6,) positive, N and N m; default ones.
    """

    input_scale: Tensor
    output_scale: Tensor

    def __init__(
        self,
        forms: Sequence[DampingForm],
        input_scale: Tensor | None = None,
        output_scale: Tensor | None = None,
    ) -> None:
        """Join the forms of a kind and keep the order of the axes."""
        super().__init__()
        axes = [axis for form in forms for axis in form.axes]
        if sorted(axes) != list(range(6)):
            names = ", ".join(AXES[axis] for axis in axes)
            raise ConfigError(f"damping forms are given for the axes {names}: give each of X Y Z K M N once")
        groups: dict[Any, list[DampingForm]] = {}
        for form in sorted(forms, key=lambda form: form.axes[0]):
            groups.setdefault((type(form), tuple(sorted(form.options().items()))), []).append(form)
        self.forms = nn.ModuleList(
            group[0] if len(group) == 1 else type(group[0]).joined(group) for group in groups.values()
        )
        order = [axis for form in self.groups() for axis in form.axes]
        self._order = None if order == list(range(6)) else [order.index(axis) for axis in range(6)]
        # What the forms were trained on, where they were: plain numbers that travel with the model, not weights.
        self.region: Region | None = None
        # Whether the drag as a whole, with what the vehicle's file states, is kept from giving energy; a model sets
        # `stated` to that drag. Both travel with the model and are not weights.
        self.passive = False
        self.stated: nn.Module | None = None
        ones = torch.ones(6, dtype=torch.float64)
        self.register_buffer("input_scale", ones.clone() if input_scale is None else input_scale.clone())
        self.register_buffer("output_scale", ones.clone() if output_scale is None else output_scale.clone())

    def groups(self) -> list[DampingForm]:
        """Return the joined forms, each of which answers for its own `axes`."""
        return [form for form in self.forms if isinstance(form, DampingForm)]

    def forward(self, nu: Tensor, known: Tensor | None = None) -> Tensor:
        """Return the damping force and moment; with `passive` so that all drag together never gives energy.

        Args:
            nu: velocity relative to the water (..., 6), m/s and rad/s.
            known: the other drag at `nu` (..., 6), positive against the motion; by default what the vehicle's file
                states. Without `passive` it does not matter.

        Returns:
            d(nu) (..., 6), N and N m, positive where it brakes a positive velocity.
        """
        own = self.free(nu)
        if not self.passive:
            return own
        other = (
            known if known is not None else torch.zeros_like(own) if self.stated is None else self.stated(nu)
        )
        return passive(own, other, nu, self.output_scale / self.input_scale)

    def free(self, nu: Tensor) -> Tensor:
        """Return what the forms alone say at velocities (..., 6): d(nu) before `passive` limits it, (..., 6)."""
        scaled = nu / self.input_scale
        parts = [form(scaled) for form in self.forms]
        whole = parts[0] if len(parts) == 1 else torch.cat(parts, dim=-1)
        if self._order is not None:
            whole = whole[..., self._order]
        return whole * self.output_scale

    def set_scales(self, nu: Tensor, force: Tensor) -> None:
        """Set both scales to the root mean square of data, and to one where there is nothing to scale.

        Weights keep their values, so the law changes with the scales: call this before training, not after.

        Args:
            nu: velocities (N, 6).
            force: damping that is to be learned (N, 6).
        """
        means = (data.detach().to(torch.float64).square().mean(0) for data in (nu, force))
        self.scale_to(*means)

    def scale_to(self, nu: Tensor, force: Tensor) -> None:
        """Set both scales by the mean squares (6,) of velocities and of the damping that is to be learned."""
        for scale, square in ((self.input_scale, nu), (self.output_scale, force)):
            rms = square.sqrt()
            scale.copy_(torch.where(torch.isfinite(rms) & (rms > 1e-12), rms, torch.ones_like(rms)))

    def reset(self, seed: int = 0) -> None:
        """Draw fresh initial parameters of every form, the same for the same seed."""
        generator = torch.Generator().manual_seed(seed)
        for form in self.groups():
            form.reset(generator)

    def describe(self) -> dict[str, Any]:
        """Return plain data for `model.yaml`: the commonest form, and under `each` those that differ."""
        per_axis: list[dict[str, Any]] = [{}] * 6
        for form in self.groups():
            for axis in form.axes:
                per_axis[axis] = form.describe()
        common = max(per_axis, key=per_axis.count)
        each = {AXES[axis]: own for axis, own in enumerate(per_axis) if own != common}
        return {**common, "each": each} if each else dict(common)

    @classmethod
    def from_description(cls, description: Description = "mlp", seed: int = 0) -> DampingBank:
        """Build a bank from plain data.

        Args:
            description: a form's name; or `{form: name, <options>}` for all axes, where `each: {K: zero, N:
                {form: polynomial, coupled: false}}` says what single axes take instead (without a `form`:
                other options of the common one).
            seed: of the initial parameters.

        Raises:
            ConfigError: an unknown form, option or axis, or a value out of range.
        """
        if not isinstance(description, (str, Mapping)):
            raise ConfigError(f"damping is {description!r}: give a form's name, or {{form: name, ...}}")
        plain = {"form": description} if isinstance(description, str) else dict(description)
        each = plain.pop("each", None) or {}
        if not isinstance(each, Mapping):
            raise ConfigError(f"damping option 'each' is {each!r}: give axes and their forms, {{K: zero}}")
        for axis in each:
            if axis not in AXES:
                raise ConfigError(f"damping option 'each': {unknown_name('axis', str(axis), AXES)}")
        own = {axis: _own_description(plain, each[axis]) for axis in each}
        bank = cls([build_form(own.get(name, plain), axis) for axis, name in enumerate(AXES)])
        bank.reset(seed)
        return bank


def _own_description(common: Mapping[str, Any], own: Any) -> Description:
    if isinstance(own, Mapping) and "form" not in own:
        return {**common, **own}
    return own


def build_form(description: Description, axis: int) -> DampingForm:
    """Build the form of one axis from its name or from `{form: name, <options>}`.

    Raises:
        ConfigError: an unknown form or option, or a value out of range.
    """
    if not isinstance(description, (str, Mapping)):
        raise ConfigError(
            f"damping of axis {AXES[axis]} is {description!r}: give a form's name, or {{form: name}}"
        )
    options = {"form": description} if isinstance(description, str) else dict(description)
    name = options.pop("form", "mlp")
    if not isinstance(name, str):
        raise ConfigError(
            f"damping option 'form' is {name!r}: give a name, one of {', '.join(DAMPING.names())}"
        )
    kind = DAMPING.get(name)
    signature = inspect.signature(kind).parameters.values()
    known = [option.name for option in signature if option.kind is option.KEYWORD_ONLY]
    for option in options:
        if option not in known:
            if not known:
                raise ConfigError(
                    f"damping form '{name}' takes no options, but '{option}' was given: leave it out"
                )
            raise ConfigError(unknown_name(f"option of damping form '{name}'", str(option), known))
    return kind((axis,), **options)
