"""Which engine runs a model free: plain torch, or machine code made from the same torch functions.

`engine="auto"` compiles where it pays: when torch would take, by estimate and together with what the same model has
taken before, longer than compiling does; code that was compiled before, in whatever process, is used at once. Where
compiling is impossible torch runs, and `why_not` says why. Compiled results differ from torch's by rounding: who needs
the same bits whatever was compiled before asks for one engine by name, or for "firm": compiled wherever that is
possible, whatever it costs, so that the answer depends on the model and the machine alone.
"""

from __future__ import annotations

import os
import weakref
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor, nn

from auvnn.compiled import toolchain
from auvnn.compiled.check import disagreement
from auvnn.compiled.kernel import Kernel
from auvnn.compiled.program import Layout, Numbers, Program, trace, trace_plain
from auvnn.compiled.recorder import CannotCompile
from auvnn.compiled.source import write
from auvnn.errors import ConfigError
from auvnn.models.identity import Identity, has_hooks
from auvnn.models.inputs import Inputs
from auvnn.models.rate import SIZE, state_rate, unit_attitude
from auvnn.models.tableaus import TABLEAUS

if TYPE_CHECKING:
    from auvnn.models.actuators import Drive
    from auvnn.models.grey_box import GreyBox

ENGINES = ("auto", "torch", "compiled", "firm")

PER_RATE, GRADIENT_FACTOR = 6e-5, 8.0
"""Seconds that torch takes per evaluation of the right-hand side, and how much more with a gradient."""
FREE_BATCH = 100
"""Trajectories that cost torch about as much as one."""
WORTH_TRACING = 0.1
"""Seconds of torch, all runs of a model together, below which not even tracing (0.05 s) is thought about."""
QUICK = 0.005
"""Seconds of torch below which one run is not worth looking the code up (0.001 s)."""
COMPILING = {False: 1.0, True: 4.0}
"""Seconds that compiling takes, without and with a gradient, until it has been measured."""


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


@dataclass
class _Made:
    """What came of one model in one situation."""

    held: list[Any]
    kernel: Kernel | None
    reason: str
    fixed: Tensor = field(default_factory=lambda: torch.zeros(0, dtype=torch.int64))
    values: Tensor = field(default_factory=lambda: torch.zeros(0, dtype=torch.float64))
    checked: set[int] = field(default_factory=set)

    def holds(self, row: Tensor) -> bool:
        """Return whether the numbers that went into the code are what they were."""
        return torch.equal(row[self.fixed], self.values)


_MADE: weakref.WeakKeyDictionary[nn.Module, dict[Any, _Made]] = weakref.WeakKeyDictionary()
_SPENT: weakref.WeakKeyDictionary[nn.Module, float] = weakref.WeakKeyDictionary()
_KERNELS: dict[str, Kernel] = {}
_MOST = 64
"""Kernels and situations that are remembered; the oldest are forgotten."""


def default_engine() -> str:
    """Return the engine that "auto" stands for: AUVNN_ENGINE, else "auto".

    Raises:
        ConfigError: the environment names no engine.
    """
    named = os.environ.get("AUVNN_ENGINE", "auto")
    if named not in ENGINES:
        raise ConfigError(f"AUVNN_ENGINE={named!r}: choose {', '.join(ENGINES)}")
    return named


def why_not(
    model: GreyBox, inputs: Inputs | None = None, *, gradient: bool = True, solver: str = "rk4"
) -> str:
    """Return why a model cannot run compiled, in words; empty where it can.

    Compiles and checks what is not there yet.

    Args:
        model: the model.
        inputs: inputs of a run, for which of them there are; without fins, voltage and altitude by default.
        gradient: with gradients in the parameters that ask for one.
        solver: one of the own solvers.
    """
    inputs = inputs or Inputs(torch.zeros(1, model.actuators.size, dtype=torch.float64))
    try:
        made = _made(model, inputs, gradient, TABLEAUS[solver])
        if made.kernel is None:
            return made.reason
        _ready(made, model, inputs, 1)
    except CannotCompile as no:
        return str(no)
    return ""


def compiled_run(
    model: GreyBox,
    state: tuple[Tensor, Tensor],
    inputs: Inputs,
    times: Tensor,
    drive: Drive,
    substeps: int,
    tableau: tuple,
    engine: str,
) -> tuple[Tensor, Tensor] | None:
    """Run by machine code; None where plain torch is to do it.

    Raises:
        ConfigError: no such engine; or "compiled" was asked for, and it cannot be done.
    """
    if engine not in ENGINES:
        raise ConfigError(f"no engine called {engine!r}: choose {', '.join(ENGINES)}")
    # Who asks for "firm" means the same engine each time, and that may be torch.
    named = default_engine()
    engine = named if engine == "auto" or (engine == "firm" and named == "torch") else engine
    if engine == "torch":
        return None
    try:
        return _compiled(model, state, inputs, times, drive, substeps, tableau, engine == "auto")
    except CannotCompile as no:
        if engine in ("auto", "firm"):
            return None
        raise ConfigError(f"engine=compiled is not possible here: {no}; choose engine=torch") from None


def _compiled(
    model: GreyBox,
    state: tuple[Tensor, Tensor],
    inputs: Inputs,
    times: Tensor,
    drive: Drive,
    substeps: int,
    tableau: tuple,
    choosing: bool,
) -> tuple[Tensor, Tensor] | None:
    batch = state[0].shape[:-1]
    rows, count = times.shape[-1], batch.numel()
    given = [*state, inputs.command, inputs.fins, inputs.voltage, inputs.altitude, drive.means, drive.slopes]
    tensors = [x for x in given if x is not None]
    _require_plain([*tensors, times])
    if rows < 2 or not count:
        raise CannotCompile("there is nothing to integrate")
    gradient = torch.is_grad_enabled() and (
        any(x.requires_grad for x in tensors) or any(p.requires_grad for p in model.parameters())
    )
    if gradient and times.requires_grad:
        raise CannotCompile("the times require a gradient")
    if choosing:
        cost = PER_RATE * (rows - 1) * substeps * len(tableau[0]) * max(1.0, count / FREE_BATCH)
        cost *= GRADIENT_FACTOR if gradient else 1.0
        spent = _SPENT[model] = _SPENT.get(model, 0.0) + cost
        if cost < QUICK or spent < WORTH_TRACING:
            return None
    made = _made(model, inputs, gradient, tableau)
    if made.kernel is None:
        raise CannotCompile(made.reason)
    if choosing and not made.kernel.is_ready(count) and spent < _compiling(gradient):
        return None
    _ready(made, model, inputs, count)
    numbers = Numbers.of(_RightHandSide(model)).row()
    y0 = torch.cat([x.reshape(count, x.shape[-1]) for x in state], dim=-1)
    slopes = None if drive.slopes is None else _flat(drive.slopes, 3, batch)
    means = _flat(drive.means if drive.slopes is None else drive.means.expand(drive.slopes.shape), 3, batch)
    run = made.kernel.run(y0, means, slopes, _held(inputs, batch), _flat(times, 1, batch), numbers, substeps)
    run = run.reshape(*batch, rows, SIZE)
    return run[..., :7], run[..., 7:]


def _require_plain(tensors: list[Tensor]) -> None:
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


def _flat(x: Tensor, kept: int, batch: torch.Size) -> Tensor:
    """Return (B, ...) or, where all trajectories share it, (1, ...)."""
    lead, own = x.shape[: x.dim() - kept], x.shape[x.dim() - kept :]
    if lead.numel() == 1:
        return x.reshape(1, *own)
    return x.expand(*batch, *own).reshape(-1, *own)


def _held(inputs: Inputs, batch: torch.Size) -> Tensor:
    """Return the inputs that are held over the interval side by side, (B or 1, T, width)."""
    parts = [_flat(inputs.command, 2, batch)]
    if inputs.fins is not None:
        parts.append(_flat(inputs.fins, 2, batch))
    parts += [_flat(x, 1, batch).unsqueeze(-1) for x in (inputs.voltage, inputs.altitude) if x is not None]
    lead = max(x.shape[0] for x in parts)
    return torch.cat([x.expand(lead, *x.shape[1:]) for x in parts], dim=-1)


def _compiling(gradient: bool) -> float:
    """Return the seconds that compiling takes, as measured last or assumed."""
    measured = [k.seconds for k in _KERNELS.values() if k.gradient == gradient and k.seconds]
    return measured[-1] if measured else COMPILING[gradient]


def _layout(model: GreyBox, inputs: Inputs) -> Layout:
    size = model.actuators.size
    fins = 0 if inputs.fins is None else inputs.fins.shape[-1]
    there = (("voltage", inputs.voltage), ("altitude", inputs.altitude))
    plain = tuple((name, None if x is not None else 0) for name, x in there)
    return Layout(SIZE, (("thrust", size), ("command", size), ("fins", fins), *plain, ("time", None)))


def _made(model: GreyBox, inputs: Inputs, gradient: bool, tableau: tuple) -> _Made:
    """Return the kernel of a model, traced if need be but not compiled, or why there is none."""
    if has_hooks(model):
        raise CannotCompile("a hook is registered on a part of the model")
    side = _RightHandSide(model)
    numbers = Numbers.of(side)
    _require_plain(list(numbers.tensors))
    identity = Identity(model)
    layout = _layout(model, inputs)
    key = (identity.key, layout, gradient, tableau)
    known = _MADE.setdefault(model, {})
    row = numbers.row().detach()
    made = known.get(key)
    if made is not None and made.holds(row):
        return made
    try:
        # In inference mode some operations would show as wholes and not as what they are made of.
        with torch.inference_mode(False):
            kernel, fixed = _traced(side, layout, numbers, gradient, tableau)
        places = torch.nonzero(fixed).squeeze(-1)
        made = _Made(identity.held, kernel, "", places, row[places].clone())
    except CannotCompile as no:
        made = _Made(identity.held, None, str(no))
    known.pop(key, None)
    known[key] = made
    while len(known) > _MOST:
        known.pop(next(iter(known)))
    return made


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


def _ready(made: _Made, model: GreyBox, inputs: Inputs, batch: int) -> None:
    """Compile, and compare with torch at other states and parameters than those that were traced.

    Raises:
        CannotCompile: it cannot be compiled, or says something else than torch.
    """
    kernel = made.kernel
    assert kernel is not None
    code = id(kernel.load(batch))
    if code in made.checked:
        return
    side = _RightHandSide(model)
    numbers = Numbers.of(side)
    different = disagreement(kernel, side, numbers, _samples(kernel.layout, 5, seed=2), made.fixed, batch)
    if different:
        made.kernel, made.reason = None, different
        raise CannotCompile(different)
    made.checked.add(code)
