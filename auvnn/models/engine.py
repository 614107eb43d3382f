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
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

from auvnn.compiled.program import Numbers
from auvnn.compiled.recorder import CannotCompile
from auvnn.errors import ConfigError
from auvnn.models.free_running.rate import SIZE
from auvnn.models.free_running.tableaus import TABLEAUS
from auvnn.models.inputs import Inputs
from auvnn.models.model_kernels import _KERNELS, _made, _ready, _RightHandSide, require_plain

if TYPE_CHECKING:
    from auvnn.models.actuation.drive import Drive
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


_SPENT: weakref.WeakKeyDictionary[nn.Module, float] = weakref.WeakKeyDictionary()


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
    model: GreyBox,
    inputs: Inputs | None = None,
    *,
    gradient: bool = True,
    solver: str = "rk4",
    batch: int = 1,
) -> str:
    """Return why a model cannot run compiled, in words; empty where it can.

    Compiles and checks what is not there yet.

    Args:
        model: the model.
        inputs: inputs of a run, for which of them there are; without fins, voltage and altitude by default.
        gradient: with gradients in the parameters that ask for one.
        solver: one of the own solvers.
        batch: trajectories at a time; the code for many is another one than that for one.
    """
    inputs = inputs or Inputs(torch.zeros(1, model.actuators.size, dtype=torch.float64))
    try:
        made = _made(model, inputs, gradient, TABLEAUS[solver])
        if made.code is None:
            return made.reason
        _ready(made, model, inputs, batch)
    except CannotCompile as no:
        return str(no)
    return ""


def slower(model: GreyBox, inputs: Inputs, batch: int) -> list[str]:
    """Return in words that free running is by plain torch, and why; nothing where it is not, or was asked for.

    Args:
        model: the model.
        inputs: inputs of a run, for which of them there are.
        batch: trajectories at a time.
    """
    reason = "" if default_engine() == "torch" else why_not(model, inputs, gradient=False, batch=batch)
    return [f"free running is by plain torch and takes several times as long: {reason}"] if reason else []


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

    Args:
        model: that is run.
        state: position and quaternion (..., 7), velocity (..., 6).
        inputs: held per interval, T rows.
        times: s, (T,) or (..., T).
        drive: thrust over each step.
        substeps: steps per interval.
        tableau: of the Runge-Kutta scheme.
        engine: "auto", "torch", "compiled" or "firm".

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
    require_plain([*tensors, times])
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
    if made.code is None:
        raise CannotCompile(made.reason)
    if choosing and not made.code.is_ready(count) and spent < _compiling(gradient):
        return None
    _ready(made, model, inputs, count)
    numbers = Numbers.of(_RightHandSide(model)).row()
    y0 = torch.cat([x.reshape(count, x.shape[-1]) for x in state], dim=-1)
    slopes = None if drive.slopes is None else _flat(drive.slopes, 3, batch)
    means = _flat(drive.means if drive.slopes is None else drive.means.expand(drive.slopes.shape), 3, batch)
    run = made.code.run(y0, means, slopes, _held(inputs, batch), _flat(times, 1, batch), numbers, substeps)
    run = run.reshape(*batch, rows, SIZE)
    return run[..., :7], run[..., 7:]


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
