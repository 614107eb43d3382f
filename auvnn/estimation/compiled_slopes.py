"""Derivatives of the acceleration, and of what sensors report, by machine code where there are moments enough."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import torch
from torch import Tensor, nn
from torch.func import functional_call, jacrev

from auvnn.compiled import toolchain
from auvnn.compiled.check import difference
from auvnn.compiled.known_code import KnownCode, Made
from auvnn.compiled.point_jacobian import PointJacobian
from auvnn.compiled.program import Layout, Numbers, trace
from auvnn.compiled.recorder import CannotCompile
from auvnn.models.engine import default_engine
from auvnn.models.identity import Identity, has_hooks
from auvnn.models.inputs import Inputs
from auvnn.models.model_kernels import require_plain

WORTH = 200
"""Moments below which nothing is compiled: half a second of compiling are ten times 200 moments in torch, and fits take
more steps than that. It depends on nothing that happened before, so that an answer does not either."""
MOST_PARAMETERS = 80
"""Parameters beyond which nothing is compiled: score tests of all candidates ask once, and the code is long."""
PARTED = 5000
"""Moments from which threads share them, where torch has more than one."""
KEPT = 128
"""Codes that are remembered; the oldest are forgotten."""
CHECKED, DISAGREES = 3, 1e-9
"""Moments at which code is compared with torch, and the largest difference relative to the largest slope."""


_MADE: KnownCode[PointJacobian] = KnownCode(KEPT)


class _Side(nn.Module):
    """What is asked of an operating point as a function of one state [position, turn, velocity] and inputs."""

    def __init__(self, module: nn.Module, what: str) -> None:
        super().__init__()
        self.what = what
        self.model: nn.Module = module.get_submodule("model")
        # Not as a part: its own parameters are the model's, under the names that the caller knows.
        self.__dict__["point"] = module

    def forward(
        self,
        y: Tensor,
        thrust: Tensor,
        quaternion: Tensor,
        command: Tensor,
        fins: Tensor | None,
        voltage: Tensor | None,
        altitude: Tensor | None,
        time: Tensor,
    ) -> Tensor:
        position, turn, nu = y.split((3, 3, 6), dim=-1)
        inputs = Inputs(command, fins, voltage, altitude)
        return self.__dict__["point"](self.what, position, quaternion, turn, nu, thrust, time, inputs)


def compiled_slopes(
    module: nn.Module, what: str, points: tuple, thetas: Mapping[str, Tensor]
) -> Tensor | None:
    """Return derivatives of a function of a point, (N, out, 12 + n + P), or None where torch is to find them.

    The columns are those of position, turn and velocity, of the n thrusts, and of each theta in turn.

    Args:
        module: an `OperatingPoint`.
        what: which of its functions.
        points: position, quaternion, velocity, thrust, time and inputs of N moments, (B, L, ...) each.
        thetas: parameters by their names in the module.
    """
    size = sum(theta.numel() for theta in thetas.values())
    if points[4].numel() < WORTH or size > MOST_PARAMETERS or default_engine() == "torch":
        return None
    position, quaternion, nu, thrust, time = (x.flatten(0, 1) for x in points[:5])
    inputs = points[5]
    given = (inputs.command, inputs.fins, inputs.voltage, inputs.altitude)
    command, fins, voltage, altitude = (None if x is None else x.flatten(0, 1) for x in given)
    assert command is not None
    layout = Layout(
        12,
        (
            ("thrust", thrust.shape[-1]),
            ("quaternion", 4),
            ("command", command.shape[-1]),
            ("fins", 0 if fins is None else fins.shape[-1]),
            ("voltage", 0 if voltage is None else None),
            ("altitude", 0 if altitude is None else None),
            ("time", None),
        ),
    )
    y = torch.cat([position, torch.zeros_like(position), nu], dim=-1)
    parts = {
        "thrust": thrust, "quaternion": quaternion, "command": command, "fins": fins, "voltage": voltage,
        "altitude": altitude, "time": time,
    }  # fmt: skip
    there = {name: x for name, x in parts.items() if x is not None}
    u = torch.cat([x.reshape(len(y), -1) for x in there.values()], dim=-1)
    try:
        require_plain([y, u])
        side = _Side(module, what)
        numbers = _numbers(side, thetas)
        code = _code(side, numbers, layout, y, there, u)
    except CannotCompile:
        return None
    if code is None:
        return None
    return code.at(y, u, numbers.row(), _columns(numbers), 12 + thrust.shape[-1] + size, _threads(len(y)))


def _numbers(side: nn.Module, thetas: Mapping[str, Tensor]) -> Numbers:
    """Return all numbers of the model, with the thetas' values, and those as what is differentiated by."""
    numbers = replace(Numbers.of(side), wanted=tuple(thetas))
    require_plain(list(numbers.tensors))
    values = tuple(
        thetas[name].detach().reshape(tensor.shape) if name in thetas else tensor.detach()
        for name, tensor in zip(numbers.names, numbers.tensors, strict=True)
    )
    return replace(numbers, tensors=values)


def _columns(numbers: Numbers) -> list[int | None]:
    """Return the column of each number in the order of the thetas."""
    sizes = {name: t.numel() for name, t in zip(numbers.names, numbers.tensors, strict=True)}
    begins, at = {}, 0
    for name in numbers.wanted:
        begins[name] = at
        at += sizes[name]
    return [
        begins[name] + k if name in begins else None for name in numbers.names for k in range(sizes[name])
    ]


def _threads(count: int) -> int:
    return torch.get_num_threads() if count >= PARTED else 1


def _code(
    side: _Side, numbers: Numbers, layout: Layout, y: Tensor, parts: Mapping[str, Tensor], u: Tensor
) -> PointJacobian | None:
    """Return the code of a model: traced, compiled and compared with torch unless that was done before."""
    if has_hooks(side):
        return None
    identity = Identity(side.model)
    key = (side.what, identity.key, layout, numbers.wanted)
    row = numbers.row()
    fixed = torch.nonzero(numbers.fixed()).squeeze(-1)

    def make() -> Made[PointJacobian]:
        try:
            with torch.inference_mode(False):
                toolchain.key("", 1)  # Without a compiler there is no need to trace.
                sample = {"y": y[0], **{name: x[0] for name, x in parts.items()}}
                program = trace(side, layout, numbers, sample, True, _rows(side, sample))
                code = PointJacobian(program, layout)
                code.load()
                _check(code, side, numbers, layout, y, u, fixed)
        except CannotCompile as no:
            return Made(identity.held, None, str(no))
        return Made(identity.held, code, "", fixed, row[fixed].clone())

    return _MADE.get(key, row, make).code


def _rows(side: _Side, sample: Mapping[str, Tensor]) -> int:
    there = (
        sample.get(n) for n in ("thrust", "quaternion", "command", "fins", "voltage", "altitude", "time")
    )
    with torch.no_grad():
        return side(sample["y"], *there).numel()


def _check(
    code: PointJacobian,
    side: nn.Module,
    numbers: Numbers,
    layout: Layout,
    y: Tensor,
    u: Tensor,
    fixed: Tensor,
) -> None:
    """Compare with torch at a few moments and other parameters: what was taken for a constant and is none, shows.

    Raises:
        CannotCompile: they differ.
    """
    where = torch.linspace(0, len(y) - 1, CHECKED).long()
    y, u = y[where], u[where]
    row = numbers.row()
    noise = torch.randn(row.shape, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    noise[fixed] = 0.0
    # Where changed parameters leave what a function is defined on (a root), the true ones must do.
    for change in (1e-2, 0.0):
        moved = row * (1.0 + change * noise)
        theirs = _by_torch(side, numbers, layout, y, u, moved)
        if bool(torch.isfinite(theirs).all()):
            break
    mine = code.at(y, u, moved, _columns(numbers), theirs.shape[-1])
    words = difference("slopes", mine, theirs, DISAGREES)
    if words:
        raise CannotCompile(words)


def _by_torch(side: nn.Module, numbers: Numbers, layout: Layout, y: Tensor, u: Tensor, row: Tensor) -> Tensor:
    sizes = [tensor.numel() for tensor in numbers.tensors]
    parts = zip(row.split(sizes), numbers.tensors, strict=True)
    values = dict(zip(numbers.names, (part.reshape(t.shape) for part, t in parts), strict=True))
    wanted = {name: values[name] for name in numbers.wanted}
    widths = [1 if size is None else size for _, size in layout.inputs]

    def rate(state: Tensor, thrust: Tensor, theta: dict[str, Tensor], others: list[Tensor | None]) -> Tensor:
        return functional_call(side, {**values, **theta}, (state, thrust, *others))

    found = []
    for state, row_of in zip(y, u, strict=True):
        thrust, *rest = row_of.split(widths)
        others = [
            None if size == 0 else x.reshape(()) if size is None else x
            for x, (_, size) in zip(rest, layout.inputs[1:], strict=True)
        ]
        by_state, by_thrust, by_theta = jacrev(rate, argnums=(0, 1, 2))(state, thrust, wanted, others)
        found.append(
            torch.cat([by_state, by_thrust, *(by_theta[n].flatten(1) for n in numbers.wanted)], dim=-1)
        )
    return torch.stack(found).detach()
