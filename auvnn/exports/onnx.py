"""ONNX: the model for runtimes of networks, with a batch of any size, in double or single precision."""

from __future__ import annotations

import logging
import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from auvnn.errors import ConfigError, MissingExtra
from auvnn.exports.base import Target, Written
from auvnn.exports.check import relative
from auvnn.exports.system import System
from auvnn.exports.torch_program import programs

aten = torch.ops.aten


class OnnxTarget(Target):
    """Two .onnx files, each whole in itself."""

    name = "onnx"
    summary = "ONNX graphs: rate and step, batched"
    precisions = ("double", "float")

    def write(self, system: System, folder: Path, precision: str) -> Written:
        """Write NAME_rate.onnx and NAME_step.onnx."""
        import_onnx()
        written = Written(system.lost(), system.notes())
        for name, (program, module, given) in programs(system, precision).items():
            names = ["x", "u", "t"] if name == "rate" else ["s", "u", "t", "h"]
            path = folder / f"{system.name}_{name}.onnx"
            _write(decomposed(program), given, names, [name if name == "rate" else "next"], path)
            with torch.no_grad():
                expected = module.double()(*(g.double() for g in given))
            written.agreement[name] = relative(_run(path, names, given), expected)
        written.notes.append(
            f"onnxruntime.InferenceSession('{system.name}_rate.onnx').run(None, {{'x': (N, {system.flow.size}), "
            f"'u': (N, {system.flow.inputs}), 't': (N)}}); the step takes s, u, t and h"
        )
        return written


def import_onnx() -> None:
    """Look whether the packages are there.

    Raises:
        MissingExtra: one is not.
    """
    for package in ("onnx", "onnxscript", "onnxruntime"):
        try:
            __import__(package)
        except ImportError:
            raise MissingExtra(package, "onnx", "writing ONNX") from None


def _write(program: Any, given: tuple[Tensor, ...], names: list[str], results: list[str], path: Path) -> None:
    """Write one program into one file."""
    quiet = logging.getLogger("torch.onnx")
    level = quiet.level
    quiet.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            torch.onnx.export(
                program, given, str(path), input_names=names, output_names=results, dynamo=True, verbose=False,
                external_data=False,
            )  # fmt: skip
    except Exception as error:  # the exporter raises its own kinds, which are not public
        cause = error.__cause__ or error
        words = " ".join(str(cause).split())[:200]
        raise ConfigError(f"the model cannot be written as ONNX: {words}; use to=torch or to=c") from None
    finally:
        quiet.setLevel(level)


def _run(path: Path, names: list[str], given: tuple[Tensor, ...]) -> Any:
    """Return what onnxruntime makes of a file."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's own kinds
        words = " ".join(str(error).split())[:200]
        raise ConfigError(f"onnxruntime cannot run the model: {words}; use precision=float") from None
    # A size of zero and unused arguments are left out by the exporter.
    wanted = {i.name for i in session.get_inputs()}
    return session.run(None, {n: g.numpy() for n, g in zip(names, given, strict=True) if n in wanted})[0]


def _inverse(x: Tensor) -> Tensor:
    """Return the inverse of symmetric positive definite matrices (..., n, n), by elimination without exchanges."""
    size = x.shape[-1]
    eye = torch.eye(size, dtype=x.dtype)
    whole = torch.cat([x, eye.expand(x.shape)], dim=-1)
    rows = list(whole.unbind(-2))
    for c in range(size):
        rows[c] = rows[c] / rows[c][..., c : c + 1]
        rows = [r if k == c else r - r[..., c : c + 1] * rows[c] for k, r in enumerate(rows)]
    return torch.stack(rows, dim=-2)[..., size:]


def _atan(x: Tensor) -> Tensor:
    """Return the arctangent: three times atan(x) = 2 atan(x / (1 + sqrt(1 + x^2))), then its series.

    Abramowitz and Stegun (1964), 4.4.34 and 4.4.42; below tan(pi / 16) twelve terms are exact to rounding.
    """
    size = x.abs()
    large = size > 1.0
    y = torch.where(large, 1.0 / torch.clamp(size, min=1.0), size)
    for _ in range(2):
        y = y / (1.0 + torch.sqrt(1.0 + y * y))
    square, total = y * y, torch.zeros_like(y)
    for k in reversed(range(13)):
        total = total * square + (1.0 if k % 2 == 0 else -1.0) / (2 * k + 1)
    angle = 4.0 * y * total
    angle = torch.where(large, 0.5 * torch.pi - angle, angle)
    return torch.where(x < 0.0, -angle, angle)


def _atan2(y: Tensor, x: Tensor) -> Tensor:
    """Return the angle of the vector (x, y), rad."""
    steep = y.abs() > x.abs()
    above, below = torch.where(steep, x, y), torch.where(steep, y, x)
    ratio = above / torch.where(below == 0.0, torch.ones_like(below), below)
    # Plain numbers inside `where` would be in single precision.
    half_turn = torch.where(y < 0.0, -torch.ones_like(y), torch.ones_like(y)) * torch.pi
    angle = _atan(ratio)
    flat = angle + torch.where(x < 0.0, half_turn, torch.zeros_like(y))
    return torch.where(steep, 0.5 * half_turn - angle, flat)


OWN: dict[Any, Callable[..., Any]] = {
    aten.linalg_inv.default: _inverse,
    aten.linalg_inv_ex.default: lambda x, check_errors=False: (
        _inverse(x),
        torch.zeros(x.shape[:-2], dtype=torch.int32),
    ),
    aten.atan2.default: _atan2,
    aten.atan.default: _atan,
    aten.expm1.default: lambda x: torch.where(x.abs() < 1e-2, _expm1(x), torch.exp(x) - 1.0),
    aten.log1p.default: lambda x: torch.where(x.abs() < 1e-2, _log1p(x), torch.log(1.0 + x)),
}
"""Operations that ONNX or onnxruntime in double precision has not, by those that it has."""


def _expm1(x: Tensor) -> Tensor:
    total = torch.ones_like(x)
    for k in range(8, 1, -1):
        total = 1.0 + total * x / k
    return x * total


def _log1p(x: Tensor) -> Tensor:
    total = torch.zeros_like(x)
    for k in range(9, 0, -1):
        total = 1.0 / k - x * total
    return x * total


def decomposed(program: Any) -> Any:
    """Return a program of operations that ONNX has, in double precision too."""
    table = torch.export.default_decompositions()
    table.update(OWN)  # pyright: ignore[reportCallIssue, reportArgumentType]
    program = program.run_decompositions(table)
    _widen(program.graph_module)
    return program


ARITHMETIC = {
    **{op.Tensor: op.Tensor for op in (aten.add, aten.sub, aten.mul, aten.div)},
    aten.remainder.Scalar: aten.remainder.Tensor,
}
"""Operations in which a plain number matters to its last digit, and what takes a tensor in its place."""


def _widen(module: Any) -> None:
    """Write plain numbers as sums of such as single precision holds, which the exporter makes of each of them."""
    for node in list(module.graph.nodes):
        value = node.meta.get("val") if node.op == "call_function" else None
        if getattr(value, "dtype", None) != torch.float64:
            continue
        if node.target is aten.scalar_tensor.default and _wide(node.args[0]):
            node.replace_all_uses_with(_summed(module.graph, node, node.args[0]))
        elif node.target in ARITHMETIC and any(map(_wide, node.args[:2])):
            node.args = tuple(_summed(module.graph, node, a) if _wide(a) else a for a in node.args)
            node.target = ARITHMETIC[node.target]
    module.graph.eliminate_dead_code()
    module.recompile()


def _wide(value: Any) -> bool:
    return isinstance(value, float) and value != _single(value)


def _summed(graph: Any, before: Any, number: float) -> Any:
    """Return a node that is a number in double precision."""
    made, rest = None, number
    with graph.inserting_before(before), before.meta["val"].fake_mode:
        while made is None or rest != 0.0:
            share = _single(rest)
            part = graph.call_function(aten.full.default, ([], share), {"dtype": torch.float64})
            part.meta["val"] = torch.full((), share, dtype=torch.float64)
            if made is not None:
                total = graph.call_function(aten.add.Tensor, (made, part))
                total.meta["val"] = part.meta["val"]
                part = total
            made, rest = part, rest - share
    return made


def _single(value: float) -> float:
    """Return the nearest number of single precision."""
    return struct.unpack("f", struct.pack("f", value))[0]
