"""Where a stochastic force stands among the columns of windows' answers: a unit wrench, cell by cell."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from auvnn.effects import Body, Effect, Moment, Parameter
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

PUSH = "unit_push"


class UnitPush(Effect):
    """tau <- tau + theta, a wrench in the body's axes at its origin, N and N m.

    What the acceleration owes to a wrench is found by its slope, so that whatever changes the inertia is in it.
    """

    name = PUSH
    cause = "a stochastic force"
    symbol = "f"
    reference = "Kristensen, Madsen and Joergensen (2004)"

    def __init__(self) -> None:
        """Make the wrench, at zero."""
        super().__init__(
            tuple(
                Parameter(axis, "N" if i < 3 else "N m", 0.0, 1.0, -1e12, 1e12)
                for i, axis in enumerate("XYZKMN")
            )
        )

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the wrench."""
        return self.theta.to(moment.nu).expand(*moment.nu.shape[:-1], 6)


def pushed(model: GreyBox, names: Sequence[str]) -> tuple[GreyBox, list[str]]:
    """Return a model with a unit wrench in it, and the names with its own as the last one."""
    whole = GreyBox(model.vehicle, [*model.members, UnitPush()], model.damping, model.actuation)
    whole.bottom = model.bottom
    return whole, [*names, PUSH]


class Cells:
    """Which cell of the force acts when.

    Args:
        windows: B windows of L samples.
        law: of the force.
    """

    def __init__(self, windows: Windows, law: ForceLaw) -> None:
        """Look up every sample's cell."""
        times = windows.times[:, windows.warmup :].numpy()
        since = times - times[:, :1]
        # Of an interval its middle decides; a sample that has none belongs to the interval before it.
        middle = 0.5 * (since[:, 1:] + since[:, :-1])
        index = torch.as_tensor(law.cell_of(middle))
        self.of_interval = torch.nn.functional.one_hot(index, law.cells).to(torch.float64)
        self.of_sample = torch.cat([self.of_interval, self.of_interval[:, -1:]], dim=1)
        self.axes, self.size = law.axes, law.cells * len(law.axes)
        # What each cell's force owes to the independent variables, (A, K, K).
        self.factors = torch.as_tensor(law.factors.copy())
        self.response = None if law.response is None else torch.as_tensor(law.response)
        self._scale: Tensor | None = None

    def spread(self, slopes: Tensor) -> Tensor:
        """Return columns (B, L - 1, 6, P + 6) with those of each cell in the place of the last six."""
        push = slopes[..., -6:]
        if self.response is not None:
            # What is reported of the wrench is scaled as what moves is.
            self._scale = torch.linalg.pinv(push[:, :1]) @ self.response
            push = self.response.expand(push.shape)
        return torch.cat([slopes[..., :-6], self._by_cell(push, self.of_interval)], dim=-1)

    def part(self, at: int, slope: Tensor, end: int) -> tuple[int, Tensor]:
        """Return a part of what is reported, (B, L, out, p), with cells where it is that of the wrench.

        Args:
            at: column of the report at which the part begins.
            slope: of the part in the parameters, (B, L, out, p).
            end: number of columns of the whole report.
        """
        if at != end - 6:
            return at, slope
        return at, self._by_cell(slope if self._scale is None else slope @ self._scale, self.of_sample)

    def separate(self, columns: Tensor) -> tuple[Tensor, Tensor]:
        """Return the columns of the parameters, and those of the force's independent variables."""
        return columns[..., : -self.size].contiguous(), columns[..., -self.size :].contiguous()

    def _by_cell(self, slope: Tensor, member: Tensor) -> Tensor:
        return torch.cat(
            [
                slope[..., axis, None] * (member @ self.factors[k])[:, :, None, :]
                for k, axis in enumerate(self.axes)
            ],
            dim=-1,
        )
