"""An effect at its null in several shapes at once: to first order, what all of them do is added up."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import torch
from torch import Tensor, nn
from torch.func import functional_call

from auvnn.effects import Body, Effect, Moment, Sensed
from auvnn.estimation.linear_effects import LinearEffect
from auvnn.models import GreyBox


class _One(nn.Module):
    """An effect as a function of its parameters."""

    def __init__(self, effect: Effect) -> None:
        super().__init__()
        self.effect = effect

    def forward(self, hook: str, *args: Any) -> Any:
        return getattr(self.effect, hook)(*args)


class StandIns(LinearEffect):
    """An effect at its null in several shapes at once, each with free parameters of its own.

    What the shapes do is added up, which is exact to first order at the null, and all that is asked for there.

    Args:
        kind: the effect's class.
        model: for which.
        shapes: values of the shape parameters, one mapping per stand-in.
        name: under which the model holds them.
        only: parameters that are free; all but the shapes by default.
    """

    HOOKS = ("thrust", "water", "body", "wrench", "sense")

    def __init__(
        self,
        kind: type[Effect],
        model: GreyBox,
        shapes: Sequence[Mapping[str, float]],
        name: str,
        only: Sequence[str] | None = None,
    ) -> None:
        """Make the starting parameters, (S, live)."""
        nn.Module.__init__(self)
        every = [kind.build(model.vehicle, model.actuation, s) for s in shapes]
        self.one, described = _One(every[0]), every[0].parameters_of
        live = [i for i, p in enumerate(described) if not p.shape and (only is None or p.name in only)]
        self.name = name  # pyright: ignore[reportAttributeAccessIssue]
        self.excludes, self.time_varying = (), kind.time_varying  # pyright: ignore[reportAttributeAccessIssue]
        self.parameters_of = tuple(
            replace(described[i], name=f"{described[i].name}_{k}") for k in range(len(shapes)) for i in live
        )
        self._index = {p.name: i for i, p in enumerate(self.parameters_of)}
        start = torch.stack([e.theta.detach() for e in every])
        held = start.clone()
        held[:, live] = 0.0
        self.register_buffer("held", held, persistent=False)
        self.register_buffer("place", torch.eye(len(described), dtype=torch.float64)[live], persistent=False)
        self.register_buffer("start", start[:, live], persistent=False)
        self.theta = nn.Parameter(start[:, live].flatten())
        # The hooks that are not touched must cost nothing here either.
        self._touched = tuple(h for h in kind.hooks() if h in self.HOOKS)
        hooks = {h: getattr(StandIns, f"_{h}") for h in self._touched}
        made = type(f"{kind.__name__}StandIns", (StandIns,), hooks)
        self.__class__ = made  # pyright: ignore[reportAttributeAccessIssue]

    def _change(self, hook: str, args: Sequence[Any], pick: Callable[[Any], list[Tensor]]) -> list[Tensor]:
        """Return what all shapes together change of a hook's answer, to first order in the parameters.

        At the null an effect does nothing whatever the state, so that the state needs no derivative here; and
        the slopes by the few live parameters cost far less than those of all of an answer backwards.
        """
        start, place, args = self.get_buffer("start"), self.get_buffer("place"), list(map(_held, args))

        def one(values: Tensor, shape: Tensor) -> list[Tensor]:
            theta = shape + values @ place
            return pick(functional_call(self.one, {"effect.theta": theta}, (hook, *args)))

        return self.added(one, start, self.get_buffer("held"))

    def _thrust(self, thrust: Tensor, moment: Moment) -> Tensor:
        return thrust + self._change("thrust", (thrust, moment), lambda new: [new])[0]

    def _water(self, moment: Moment) -> tuple[Tensor, Tensor]:
        velocity, acceleration = self._change("water", (moment,), list)
        return velocity, acceleration

    def _wrench(self, moment: Moment, body: Body) -> Tensor:
        return self._change("wrench", (moment, body), lambda new: [new])[0]

    def _body(self, body: Body, moment: Moment | None) -> Body:
        # Where the weight acts must be said, for a change of it to be added.
        body = replace(body, weight_centre=body.hangs)
        # What the effect hands on untouched has no slope, and need not be asked for it.
        new = self.one("body", body, moment)
        names = [f.name for f in fields(body) if getattr(new, f.name) is not getattr(body, f.name)]
        more = self._change("body", (body, moment), lambda new: [getattr(new, n) for n in names])
        return replace(body, **{n: getattr(body, n) + m for n, m in zip(names, more, strict=True)})

    def _sense(self, sensed: Sensed) -> Sensed:
        names = [n for n in ("position", "quaternion", "nu", "nu_dot") if getattr(sensed, n) is not None]
        more = self._change("sense", (sensed,), lambda new: [getattr(new, n) for n in names])
        return replace(sensed, **{n: getattr(sensed, n) + m for n, m in zip(names, more, strict=True)})


def _held(value: Any) -> Any:
    """Return an argument of a hook through which nothing is differentiated."""
    if isinstance(value, Tensor):
        return value.detach()
    if is_dataclass(value) and not isinstance(value, type):
        held = {f.name: _held(getattr(value, f.name)) for f in fields(value) if f.init}
        return replace(value, **held)
    return value
