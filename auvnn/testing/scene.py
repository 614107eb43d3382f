"""What contract checks run on: a vehicle that has everything, and short runs in which everything moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.func import functional_call

from auvnn.effects import Effect, Sensed
from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import euler_to_quat
from auvnn.vehicle import Vehicle


def require(condition: bool, message: str) -> None:
    """Raise an `AssertionError`; unlike `assert`, also under `python -O`."""
    if not condition:
        raise AssertionError(message)


def require_close(a: Tensor, b: Tensor, tolerance: float, message: str) -> None:
    """Require that two tensors differ by less than `tolerance` times the largest value of the second.

    Args:
        a: found.
        b: expected.
        tolerance: relative to the largest value of `b`.
        message: what is compared.
    """
    error = float((a.detach().double() - b.detach().double()).abs().max())
    size = float(b.detach().abs().max())
    require(error <= tolerance * max(size, 1e-30), f"{message}: differs by {error:.3g} of {size:.3g}")


def example_vehicle() -> Vehicle:
    """Return a vehicle with full matrices, displaced elements, a thrust table, fins and a battery."""
    random = np.random.default_rng(3)

    def full(diagonal: list[float], share: float) -> list[list[float]]:
        root = np.sqrt(np.array(diagonal))
        mix = random.uniform(-share, share, (len(root), len(root)))
        return (np.outer(root, root) * (np.eye(len(root)) + (mix + mix.T) / 2)).tolist()

    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    curve = {"command": [-1.0, -0.2, 0.1, 0.6, 1.0], "thrust": [-30.0, -2.0, 0.0, 12.0, 38.0]}
    places = [
        ([0.3, 0.2, 0.05], [1, -0.5, 0.1]),
        ([0.3, -0.2, 0.05], [1, 0.5, 0]),
        ([-0.3, 0.2, 0], [0.9, 0.5, 0]),
        ([-0.3, -0.2, 0], [0.9, -0.6, 0]),
        ([0.2, 0.25, 0], [0, 0.1, 1]),
        ([-0.2, -0.25, 0.1], [0.1, 0, 1]),
    ]
    thrusters = [
        {"position": p, "direction": d, "curve": curve}
        if i == 1
        else {
            "position": p,
            "direction": d,
            "max_forward": 40.0,
            "max_reverse": 31.0,
            "handedness": 1 - 2 * (i % 2),
        }
        for i, (p, d) in enumerate(places)
    ]
    fin = {"axis": [0.1, 0.0, 1.0], "area": 0.02, "lift_slope": 3.0, "stall": 0.3}
    return Vehicle.from_dict(
        {
            "name": "example",
            "frame": "FRD",
            "gravity": 9.81,
            "water_density": 1025.0,
            "mass": 42.0,
            "buoyancy": 415.0,
            "length": 1.1,
            "center_of_gravity": [0.02, -0.01, 0.04],
            "center_of_buoyancy": [0.0, 0.01, -0.02],
            "inertia": full([1.6, 2.9, 3.3], 0.1),
            "added_mass": full([20, 35, 50, 0.9, 2.4, 1.8], 0.2),
            "linear_damping": full([15, 25, 30, 4, 6, 5], 0.2),
            "quadratic_damping": full([40, 70, 95, 6, 9, 8], 0.02),
            "damping_elements": [
                {
                    "position": [0.1, 0.05, -0.08],
                    "axes": turn.tolist(),
                    "linear": [5, 4, 6, 0.5, 0.6, 0.4],
                    "quadratic": [12, 15, 20, 1.5, 2.0, 1.0],
                },
                {
                    "position": [-0.4, 0.0, 0.02],
                    "axes": np.eye(3).tolist(),
                    "linear": [1, 3, 3, 0.1, 0.2, 0.2],
                    "quadratic": [2, 12, 11, 0.1, 0.4, 0.3],
                },
            ],
            "thrusters": thrusters,
            "fins": [{"position": [-0.5, 0.02, -0.1], **fin}, {"position": [-0.5, 0.0, 0.1], **fin}],
            "reference_voltage": 16.0,
            "source": "made up for tests",
            "uncertainty": {k: 0.1 for k in ("added_mass", "linear_damping", "quadratic_damping", "inertia")},
        }
    )


def plain_vehicle(**changes: Any) -> Vehicle:
    """Return a vehicle simple enough to write its answers down by hand.

    Neutrally buoyant, both centres at the origin, diagonal matrices, no damping and no thrusters, unless
    `changes` says otherwise by keys of a model file.
    """
    plain = {
        "name": "plain",
        "frame": "FRD",
        "gravity": 9.81,
        "water_density": 1000.0,
        "mass": 50.0,
        "buoyancy": 490.5,
        "length": 1.0,
        "center_of_gravity": [0.0, 0.0, 0.0],
        "center_of_buoyancy": [0.0, 0.0, 0.0],
        "inertia": [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]],
        "added_mass": [20.0, 30.0, 40.0, 1.0, 1.5, 2.5],
    }
    return Vehicle.from_dict({**plain, **changes})


@dataclass(frozen=True)
class Scene:
    """States and inputs of B short runs; SI, float64 unless converted.

    Attributes:
        eta: (B, 7).
        nu: (B, 6).
        inputs: (B, warmup + T, ...), with fins, voltage and altitude.
        times: (warmup + T,), s, not even.
        warmup: rows of history.
    """

    eta: Tensor
    nu: Tensor
    inputs: Inputs
    times: Tensor
    warmup: int

    def change(self, act: Callable[[Tensor], Tensor]) -> Scene:
        """Return the scene with something done to each tensor (another dtype or device)."""
        i = self.inputs
        inputs = Inputs(
            act(i.command), *(None if x is None else act(x) for x in (i.fins, i.voltage, i.altitude))
        )
        return Scene(act(self.eta), act(self.nu), inputs, act(self.times), self.warmup)

    def part(self, index: Any) -> Scene:
        """Return some of the runs, or one without its batch dimension."""
        i = self.inputs
        inputs = Inputs(
            i.command[index], *(None if x is None else x[index] for x in (i.fins, i.voltage, i.altitude))
        )
        return replace(self, eta=self.eta[index], nu=self.nu[index], inputs=inputs)


def make_scene(
    vehicle: Vehicle, actuation: str, runs: int = 4, rows: int = 4, warmup: int = 2, seed: int = 0
) -> Scene:
    """Return runs from random states at depth, with random commands within the vehicle's means.

    Args:
        vehicle: for its thrusters and fins.
        actuation: "thrusters" or "wrench".
        runs: how many.
        rows: of each, after the warm-up.
        warmup: rows before.
        seed: of the draws.
    """
    make = torch.Generator().manual_seed(seed)

    def draw(*shape: int, size: float | Tensor = 1.0) -> Tensor:
        return (2 * torch.rand(*shape, generator=make, dtype=torch.float64) - 1) * size

    angles = draw(runs, 3, size=torch.tensor([0.4, 0.3, 3.1], dtype=torch.float64))
    place = draw(runs, 3, size=3.0) + torch.tensor([0.0, 0.0, 10.0], dtype=torch.float64)
    eta = torch.cat([place, euler_to_quat(angles)], dim=-1)
    speeds = torch.tensor([0.8, 0.4, 0.4, 0.3, 0.3, 0.4], dtype=torch.float64)
    nu = draw(runs, 6, size=speeds) + torch.tensor([0.5, 0, 0, 0, 0, 0], dtype=torch.float64)
    count = rows + warmup
    if actuation == "thrusters":
        command = draw(runs, count, len(vehicle.thrusters), size=0.9)
    else:
        force = 0.05 * vehicle.weight
        sizes = torch.tensor([force] * 3 + [0.05 * force * vehicle.length] * 3, dtype=torch.float64)
        command = draw(runs, count, 6, size=sizes)
    fins = draw(runs, count, len(vehicle.fins), size=0.3) if vehicle.fins else None
    battery = (vehicle.reference_voltage or 16.0) * (0.93 + draw(runs, count, size=0.05))
    steps = 0.1 + draw(count, size=0.03)
    inputs = Inputs(command, fins, battery, 1.5 + draw(runs, count, size=0.7))
    return Scene(eta, nu, inputs, torch.cumsum(steps, 0), warmup)


THETA = "model.effects.0.theta"
"""Name of the parameters of the only effect in a `Predictor`."""


class Predictor(nn.Module):
    """Everything that a model predicts of a scene, as one function of its parameters."""

    def __init__(self, model: GreyBox) -> None:
        """Keep the model."""
        super().__init__()
        self.model = model

    def forward(self, scene: Scene) -> dict[str, Tensor]:
        """Return acceleration, free run (one step per interval) and the sensors' report, each (..., size)."""
        first, inputs = scene.warmup, scene.inputs
        row = inputs.each()[first]
        rate = self.model(
            scene.eta,
            scene.nu,
            row.command,
            time=scene.times[first],
            fins=row.fins,
            voltage=row.voltage,
            altitude=row.altitude,
        )
        run = self.model.rollout(
            scene.eta, scene.nu, inputs, scene.times, warmup=first, check=False, max_step=1e3
        )
        rates = rate.unsqueeze(-2).expand_as(run.nu)
        seen = self.model.sense(Sensed(run.eta[..., :3], run.eta[..., 3:], run.nu, rates))
        report = [seen.position, seen.quaternion, seen.nu, rates if seen.nu_dot is None else seen.nu_dot]
        return {
            "nu_dot": rate,
            "rollout": torch.cat([run.eta, run.nu], dim=-1).flatten(-2),
            "sense": torch.cat(report, dim=-1).flatten(-2),
        }


def together(outputs: dict[str, Tensor]) -> Tensor:
    """Return all outputs side by side, (..., size)."""
    return torch.cat(list(outputs.values()), dim=-1)


def typical_values(
    kind: type[Effect], vehicle: Vehicle, actuation: str, share: float = 0.4
) -> dict[str, float]:
    """Return parameters away from the null by some of their scale, within bounds, with either sign.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
        share: of each parameter's scale.
    """
    values = {}
    for i, p in enumerate(kind.describe(vehicle, actuation)):
        step = share * (1 + 0.15 * (i % 3)) * p.scale * (1 if i % 2 else -1)
        value = p.probes[len(p.probes) // 2] if p.probes else p.null + step
        if not p.low < value < p.high:
            value = p.null - step
        values[p.name] = min(max(value, p.low), p.high)
    return values


def as_function(model: Predictor, scene: Scene) -> tuple[Callable[[Tensor], Tensor], Tensor]:
    """Return all outputs as a function of the effect's parameters, and the parameters."""

    def outputs(theta: Tensor) -> Tensor:
        return together(functional_call(model, {THETA: theta}, (scene,))).flatten()

    return outputs, model.get_parameter(THETA).detach().clone()


EXAMPLE = example_vehicle()
"""The vehicle on which checks are run where none is named."""
