"""The compiled code of models: made once for each model and situation, compared with torch, remembered."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor, nn

from auvnn.compiled import toolchain
from auvnn.compiled.check import disagreement
from auvnn.compiled.kernel import Kernel
from auvnn.compiled.known_code import KnownCode, Made
from auvnn.compiled.program import Layout, Numbers, Program, trace, trace_plain
from auvnn.compiled.recorder import CannotCompile
from auvnn.compiled.source import write
from auvnn.models.actuation.acting import speeds_follow
from auvnn.models.free_running.rate import SIZE, state_rate, unit_attitude
from auvnn.models.identity import Identity, has_hooks
from auvnn.models.inputs import Inputs

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox


class _RightHandSide(nn.Module):
    """The rate of the state as a module over a model."""

    def __init__(self, model: GreyBox) -> None:
        super().__init__()
        self.model = model

    def forward(
        self,
        y: Tensor,
        thrust: Tensor,
        command: Tensor,
        fins: Tensor | None,
        voltage: Tensor | None,
        altitude: Tensor | None,
        time: Tensor,
    ) -> Tensor:
        prepared = None if self.model.time_varying else self.model.prepare()
        row = Inputs(command, fins, voltage, altitude)
        return state_rate(self.model, y, thrust, row, time, prepared)


_MOST = 128
"""Kernels and situations that are remembered; the oldest are forgotten."""
_MADE: KnownCode[Kernel] = KnownCode(_MOST)
_KERNELS: dict[str, Kernel] = {}


def require_plain(tensors: list[Tensor]) -> None:
    """Refuse tensors that are more than numbers in memory, and calls that somebody watches."""
    transforms: Any = torch._C._functorch  # type: ignore[attr-defined]
    tracing: Any = torch.jit
    for x in tensors:
        if type(x) not in (Tensor, nn.Parameter):
            raise CannotCompile(f"a tensor of type {type(x).__name__}")
        if x.dtype != torch.float64 or x.device.type != "cpu":
            kind = str(x.dtype).removeprefix("torch.")
            raise CannotCompile(f"{kind} on {x.device}: only double precision on the CPU")
        if transforms.is_functorch_wrapped_tensor(x):
            raise CannotCompile("a function transform (torch.func) is at work")
    if transforms.peek_interpreter_stack() is not None:
        raise CannotCompile("a function transform (torch.func) is at work")
    if torch._C._len_torch_dispatch_stack() or torch.compiler.is_compiling() or tracing.is_tracing():
        raise CannotCompile("torch itself is being traced")
    if torch.autograd.forward_ad._current_level >= 0:
        raise CannotCompile("forward-mode differentiation is at work")


def _layout(model: GreyBox, inputs: Inputs) -> Layout:
    size = model.actuators.size
    fins = 0 if inputs.fins is None else inputs.fins.shape[-1]
    # Fins that follow their commands, or change within an interval, come after the thrust, as lines over each step; then
    # the propellers' speed, where something goes by it.
    moving = fins if inputs.fins_move(bool(model.using("steer"))) else 0
    moving += size if speeds_follow(model) else 0
    there = (("voltage", inputs.voltage), ("altitude", inputs.altitude))
    plain = tuple((name, None if x is not None else 0) for name, x in there)
    return Layout(
        SIZE, (("thrust", size + moving), ("command", size), ("fins", fins), *plain, ("time", None))
    )


def _made(model: GreyBox, inputs: Inputs, gradient: bool, tableau: tuple) -> Made[Kernel]:
    """Return the kernel of a model, traced if need be but not compiled, or why there is none."""
    if has_hooks(model):
        raise CannotCompile("a hook is registered on a part of the model")
    side = _RightHandSide(model)
    numbers = Numbers.of(side)
    require_plain(list(numbers.tensors))
    identity = Identity(model)
    layout = _layout(model, inputs)
    key = (identity.key, layout, gradient, tableau)
    row = numbers.row().detach()

    def make() -> Made[Kernel]:
        try:
            # In inference mode some operations would show as wholes and not as what they are made of.
            with torch.inference_mode(False):
                kernel, fixed = _traced(side, layout, numbers, gradient, tableau)
        except CannotCompile as no:
            return Made(identity.held, None, str(no))
        places = torch.nonzero(fixed).squeeze(-1)
        return Made(identity.held, kernel, "", places, row[places].clone())

    return _MADE.get(key, row, make)


def _traced(
    side: _RightHandSide, layout: Layout, numbers: Numbers, gradient: bool, tableau: tuple
) -> tuple[Kernel, Tensor]:
    toolchain.key("", 1)  # Without a compiler there is no need to trace.
    sample = _samples(layout, 1, seed=1)
    one = {name: x[0] for name, x in sample.items()}
    plain = trace(side, layout, numbers, one, False)
    joint = trace(side, layout, numbers, one, True) if gradient else None
    source = write(layout, (plain, joint), _attitude(), tableau)
    kernel = _KERNELS.get(source)
    if kernel is None:
        places = [place for place, _ in joint.parameter_gradient] if joint else []
        kernel = _KERNELS[source] = Kernel(source, layout, places, gradient)
        while len(_KERNELS) > _MOST:
            _KERNELS.pop(next(iter(_KERNELS)))
    return kernel, numbers.fixed()


@lru_cache(maxsize=1)
def _attitude() -> tuple[Program, Program]:
    """Return what makes an attitude's quaternion a unit one, the same for all models."""
    return trace_plain(unit_attitude, SIZE)


def _samples(layout: Layout, count: int, seed: int) -> dict[str, Tensor]:
    """Return states and inputs as they may occur, (count, size) or (count)."""
    generator = torch.Generator().manual_seed(seed)

    def draw(*shape: int) -> Tensor:
        return torch.randn(count, *shape, generator=generator, dtype=torch.float64)

    y = draw(layout.state)
    y[:, 2] = y[:, 2].abs() + 2.0
    found = {"y": unit_attitude(y)}
    scales = {"thrust": 10.0, "command": 0.4, "fins": 0.2, "voltage": 1.0, "altitude": 1.0, "time": 5.0}
    middle = {"voltage": 15.0, "altitude": 5.0, "time": 30.0}
    for name, size in layout.inputs:
        if size != 0:
            found[name] = middle.get(name, 0.0) + scales[name] * draw(*(() if size is None else (size,)))
    return found


def _ready(made: Made[Kernel], model: GreyBox, inputs: Inputs, batch: int) -> None:
    """Compile, and compare with torch at other states and parameters than those that were traced.

    Raises:
        CannotCompile: it cannot be compiled, or says something else than torch.
    """
    kernel = made.code
    assert kernel is not None
    code = id(kernel.load(batch))
    if code in made.checked:
        return
    side = _RightHandSide(model)
    numbers = Numbers.of(side)
    different = disagreement(kernel, side, numbers, _samples(kernel.layout, 5, seed=2), made.fixed, batch)
    if different:
        made.code, made.reason = None, different
        raise CannotCompile(different)
    made.checked.add(code)
