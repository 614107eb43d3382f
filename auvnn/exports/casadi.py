"""CasADi: the same operations as SX functions, for optimal control and estimation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.errors import MissingExtra
from auvnn.exports.base import Target, Written
from auvnn.exports.check import COUNT, agreement, relative
from auvnn.exports.graph import Graph
from auvnn.exports.system import System
from auvnn.models.free_running.rate import SIZE

ABSENT = "writing CasADi functions"
INFIX = {
    "add": "plus", "sub": "minus", "mul": "times", "div": "rdivide", "lt": "lt", "le": "le", "eq": "eq", "ne": "ne",
    "and": "logic_and", "or": "logic_or", "not": "logic_not", "max": "fmax", "min": "fmin", "pow": "power",
    "abs": "fabs", "where": "if_else",
}  # fmt: skip
"""Names of operations that CasADi calls otherwise."""


class CasadiTarget(Target):
    """Three files that `casadi.Function.load` reads in Python, MATLAB and C++."""

    name = "casadi"
    summary = "CasADi SX functions: rate, step, and the slopes of the rate"

    def write(self, system: System, folder: Path, precision: str) -> Written:
        """Write NAME_rate.casadi, NAME_step.casadi and NAME_jacobian.casadi."""
        import_casadi()
        made = functions(system)
        for function in made.values():
            function.save(str(folder / f"{function.name()}.casadi"))
        notes = [
            *system.notes(),
            f"casadi.Function.load('{system.name}_rate.casadi')(x, u, t) gives the rate of x; {system.name}_step takes "
            f"(s, u, t, h), {system.name}_jacobian gives A and B",
        ]
        return Written(system.lost(), notes, {**agreement(system), **_compared(system, made)})


def import_casadi() -> Any:
    """Return the package.

    Raises:
        MissingExtra: it is not installed.
    """
    try:
        import casadi
    except ImportError:
        raise MissingExtra("casadi", "casadi", ABSENT) from None
    return casadi


def functions(system: System) -> dict[str, Any]:
    """Return rate, step and jacobian as CasADi functions."""
    ca = import_casadi()
    flow, steps, name, n = system.flow, system.steps, system.name, system.flow.actuators.acting
    x, u, t, h = ca.SX.sym("x", flow.size), ca.SX.sym("u", flow.inputs), ca.SX.sym("t"), ca.SX.sym("h")
    s = x if steps.size == flow.size else ca.SX.sym("s", steps.size)
    rate = built(system.rate, {"x": x, "u": u, "t": t})
    slopes = built(system.jacobian, {"x": x, "u": u, "t": t})
    a = ca.reshape(slopes[: flow.size**2], flow.size, flow.size).T
    b = ca.reshape(slopes[flow.size**2 :], flow.inputs, flow.size).T

    def motion(y: Any, thrust: Any, time: Any) -> Any:
        return built(system.motion, {"y": y, "f": thrust, "u": u, "t": time})

    held = built(system.actuator_step, {"a": s[SIZE:], "u": u, "h": h})
    mean, rise = held[:n], held[n : 2 * n]
    k1 = motion(s[:SIZE], mean - rise / 2, t)
    k2 = motion(s[:SIZE] + h / 2 * k1, mean, t + h / 2)
    k3 = motion(s[:SIZE] + h / 2 * k2, mean, t + h / 2)
    k4 = motion(s[:SIZE] + h * k3, mean + rise / 2, t + h)
    after = built(system.unit, {"y": s[:SIZE] + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)})
    after = ca.vertcat(after, held[2 * n :])
    return {
        "rate": ca.Function(f"{name}_rate", [x, u, t], [rate], ["x", "u", "t"], ["rate"]),
        "step": ca.Function(f"{name}_step", [s, u, t, h], [after], ["s", "u", "t", "h"], ["next"]),
        "jacobian": ca.Function(f"{name}_jacobian", [x, u, t], [a, b], ["x", "u", "t"], ["A", "B"]),
    }


def built(graph: Graph, arguments: Mapping[str, Any]) -> Any:
    """Return a graph's results as an SX column, for SX arguments."""
    ca = import_casadi()
    s = graph.scalars
    values: dict[int, Any] = {}
    for node in s.needed(graph.results):
        name, operands = s.operation[node], s.operands[node]
        if s.is_constant(node):
            values[node] = ca.SX(float(s.value(node) or 0.0))
        elif name == "input":
            values[node] = arguments[operands[0]][operands[1]]
        elif name == "neg":
            values[node] = -values[operands[0]]
        else:
            values[node] = getattr(ca, INFIX.get(name, name))(*(values[n] for n in operands))
    return ca.vertcat(*(values[n] for n in graph.results)) if graph.results else ca.SX(0, 1)


def _compared(system: System, made: Mapping[str, Any]) -> dict[str, float]:
    """Return how far CasADi's own evaluation of a step is from the model."""
    import torch

    a = system.samples(COUNT, seed=9)
    with torch.no_grad():
        after = system.steps.step(a["s"], a["u"], a["t"], a["h"])
    found = made["step"](*(np.atleast_2d(a[n].numpy().T) for n in ("s", "u", "t", "h")))
    return {"step": relative(np.array(found).T, after)}
