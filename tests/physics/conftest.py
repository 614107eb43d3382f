"""Random but fixed inputs for the tests of the physics, all float64."""

from collections.abc import Callable

import pytest
import torch
from torch import Tensor


class Draw:
    """Draws tensors from one seeded stream."""

    def __init__(self, seed: int = 0) -> None:
        self.generator = torch.Generator().manual_seed(seed)

    def __call__(self, *shape: int) -> Tensor:
        return torch.randn(shape, dtype=torch.float64, generator=self.generator)

    def quaternion(self, *lead: int) -> Tensor:
        q = self(*lead, 4)
        return q / q.norm(dim=-1, keepdim=True)

    def definite(self, size: int, *lead: int) -> Tensor:
        a = self(*lead, size, size)
        return a @ a.mT + torch.eye(size, dtype=torch.float64)


@pytest.fixture
def draw() -> Draw:
    return Draw()


@pytest.fixture(scope="session")
def make_draw() -> Callable[[int], Draw]:
    return Draw


@pytest.fixture(scope="session")
def rk4() -> Callable[..., Tensor]:
    """The classical fourth-order Runge-Kutta method, from t = 0, independent of the library's integrators."""

    def integrate(rate: Callable[[float, Tensor], Tensor], state: Tensor, end: float, steps: int) -> Tensor:
        h, t = end / steps, 0.0
        for _ in range(steps):
            k1 = rate(t, state)
            k2 = rate(t + h / 2, state + h / 2 * k1)
            k3 = rate(t + h / 2, state + h / 2 * k2)
            k4 = rate(t + h, state + h * k3)
            state, t = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), t + h
        return state

    return integrate
