"""torch.export: the model as programs of torch's own operations, which run without auvnn."""

from __future__ import annotations

import copy
import warnings
from pathlib import Path
from typing import Any

import torch

from auvnn.exports.base import Target, Written
from auvnn.exports.check import COUNT, relative
from auvnn.exports.system import RateModule, StepModule, System


class TorchTarget(Target):
    """Two .pt2 files for `torch.export.load`, with a batch of any size."""

    name = "torch"
    summary = "torch.export programs (.pt2): rate and step, batched and differentiable"
    precisions = ("double", "float")

    def write(self, system: System, folder: Path, precision: str) -> Written:
        """Write NAME_rate.pt2 and NAME_step.pt2."""
        written = Written(system.lost(), system.notes())
        for name, (program, module, given) in programs(system, precision).items():
            path = folder / f"{system.name}_{name}.pt2"
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # views that share memory are written out, and said to be
                torch.export.save(program, path)
            with torch.no_grad():
                found = torch.export.load(path).module()(*given)
                wide = [g.double() for g in given]
                written.agreement[name] = relative(found, module.double()(*wide))
        written.notes.append(
            f"torch.export.load('{system.name}_rate.pt2').module()(x, u, t) with x (N, {system.flow.size}), u (N, "
            f"{system.flow.inputs}), t (N); the step also takes h (N)"
        )
        return written


def programs(
    system: System, precision: str
) -> dict[str, tuple[Any, torch.nn.Module, tuple[torch.Tensor, ...]]]:
    """Return per function the exported program, its module, and arguments (N, ...) to compare them at."""
    a = system.samples(COUNT, seed=5)
    kind = torch.float32 if precision == "float" else torch.float64
    batch = torch.export.Dim("batch", min=1)
    found = {}
    for name, module, arguments in (
        ("rate", RateModule(system.flow), ("x", "u", "t")),
        ("step", StepModule(system.steps), ("s", "u", "t", "h")),
    ):
        given = tuple(a[n].to(kind) for n in arguments)
        with torch.no_grad():
            ready = _typed(module, kind)
            program = torch.export.export(
                ready, given, dynamic_shapes=tuple({0: batch} for _ in given), strict=False
            )
        found[name] = (program, module, given)
    return found


def _typed(module: torch.nn.Module, kind: torch.dtype) -> torch.nn.Module:
    """Return a copy of a module in a number type, what was worked out beforehand included."""
    other: Any = copy.deepcopy(module).to(kind)
    space = other.space
    if space.prepared is not None:
        space.prepared = space.model.prepare()
    return other
