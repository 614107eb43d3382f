"""The same information by finite differences of the plant itself: nothing of the package's own equations in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.effects import effect_class
from auvnn.estimation.sensitivity import Response
from auvnn.estimation.window_normal_equations import normal_equations
from auvnn.metrics.free_run import moved
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.physics.attitude import quat_conjugate, quat_multiply, quat_to_rotvec
from auvnn.studies.benchmark.identifiability.information import Information, TruthPoint

Array = NDArray[np.float64]
# Steps: of a parameter, as a share of its plausible scale; of an initial state, m, rad, m/s and rad/s.
SHARE, STATE = 1e-3, 1e-4
# Longest step of the plant, s: differences do not see what both runs err by alike.
STEP = 0.025
# Effects that count the time since the run began, which a window does not know.
BY_TIME = ("biofouling", "flooding", "payload", "waves")


class PlantOutputs:
    """What an independent plant's sensors report over windows, from given starts and under the log's commands.

    Args:
        plant: name.
        model: nominal, for the vehicle's numbers.
        windows: B windows of L rows.
        bottom: depth of a flat bottom, m, or None.
    """

    def __init__(self, plant: str, model: GreyBox, windows: Windows, bottom: float | None = None) -> None:
        """Take the commands out of the windows."""
        from auvnn.plants import PLANTS

        self.maker, self.model, self.windows, self.bottom = PLANTS.get(plant)(), model, windows, bottom
        longest = int(np.argmax(windows.length))
        times = windows.times[longest, windows.warmup :].numpy()
        self.t = times - times[0]
        inputs, w = windows.inputs, windows.warmup
        self.command = inputs.command[:, w:].numpy()
        self.fins = None if inputs.fins is None else inputs.fins[:, w:].numpy()
        self.voltage = None if inputs.voltage is None else inputs.voltage[:, w:].numpy()

    def __call__(
        self,
        states: Array,
        effects: Mapping[str, Mapping[str, float]],
        strangers: Mapping[str, Mapping[str, float]] | None = None,
    ) -> Array:
        """Return position, quaternion, velocity and its derivative, (R, L, 19), R being a multiple of B."""
        from auvnn.plants import PlantTask

        times = len(states) // len(self.command)

        def repeat(x: Array | None) -> Array | None:
            return None if x is None else np.tile(x, (times, *[1] * (x.ndim - 1)))

        task = PlantTask(
            vehicle=self.model.vehicle, actuation=self.model.actuation, effects=dict(effects),
            strangers=dict(strangers or {}), model=None, eta0=states[:, :7], nu0=states[:, 7:], t=self.t,
            command=repeat(self.command), fins=repeat(self.fins), voltage=repeat(self.voltage), bottom=self.bottom,
            max_step=STEP,
        )  # fmt: skip
        motion = self.maker.move(task, lambda k, position, quaternion, nu: (position, quaternion, nu))
        return np.concatenate([motion.position, motion.quaternion, motion.velocity, motion.rate], axis=-1)


def change(before: Array, after: Array) -> Array:
    """Return the change of the outputs (..., 19) in the channels of windows, (..., 18)."""
    turn = quat_multiply(quat_conjugate(torch.as_tensor(before[..., 3:7])), torch.as_tensor(after[..., 3:7]))
    angle = quat_to_rotvec(turn).numpy()
    return np.concatenate(
        [after[..., :3] - before[..., :3], angle, after[..., 7:] - before[..., 7:]], axis=-1
    )


def state_slopes(outputs: PlantOutputs, states: Array, now: Array, effects: Mapping[str, Any]) -> Array:
    """Return the change with the initial states, (B, L, 18, 12).

    Args:
        outputs: of the plant, from states and effects.
        states: initial, (B, 13).
        now: outputs from these states, (B, L, 18).
        effects: that act, name to parameters.
    """
    begin = torch.as_tensor(states)
    kicked = [moved(begin, torch.as_tensor(row).expand(len(begin), 12)) for row in STATE * np.eye(12)]
    after = outputs(torch.cat(kicked).numpy(), effects).reshape(12, *now.shape)
    return np.stack([change(now, one) / STATE for one in after], axis=-1)


def remembers_commands(name: str, hooks: Sequence[str] = ("delay", "respond")) -> bool:
    """Whether what an effect does depends on commands before.

    Args:
        name: the effect.
        hooks: by which an effect has thrust, or fins, follow commands with time.
    """
    kind = effect_class(name)
    return kind.remembers or bool({*hooks} & {*kind.hooks()})


def covers(plant: str, names: Sequence[str]) -> bool:
    """Whether windows of a plant say all of these effects.

    None may remember commands or count the time since the run began, and the plant must be able to hold each.
    """
    from auvnn.plants import PLANTS

    if any(n in BY_TIME or remembers_commands(n, ("delay", "respond", "steer")) for n in names):
        return False
    return not any(PLANTS.get(plant)().refuses(n) for n in names)


def plant_information(
    plant: str, model: GreyBox, point: TruthPoint, names: Sequence[str], bottom: float | None = None
) -> Information:
    """Return the information on some effects and the coefficients at a point, by differences of a plant.

    Args:
        plant: name.
        model: nominal.
        point: windows, states and truth; where a rival has a shape, its parameters at every one of its starts.
        names: hidden effects and rivals.
        bottom: depth of a flat bottom, m, or None.
    """
    outputs = PlantOutputs(plant, model, point.windows, bottom)
    layout = point.probed.layout
    truth: dict[str, dict[str, float]] = {
        n: dict(v) for n, v in {**point.truth.coefficients, **point.truth.hidden}.items()
    }
    states = point.states.numpy()
    now = outputs(states, truth)
    length = now.shape[1]
    columns: dict[str, NDArray[np.int64]] = {}
    slopes: list[Array] = []
    wanted = list(dict.fromkeys([*layout.nuisance, *names]))
    starts = {n: point.probed.starts[n] for n in wanted if n in point.probed.starts}
    for name in wanted:
        for label, shape in starts.get(name, {name: {}}).items():
            kind = effect_class(name)
            described = kind.describe(model.vehicle, model.actuation)
            live = [p for p in described if not (p.shape and label != name)]
            values = {p.name: p.null for p in described} | truth.get(name, {}) | dict(shape)
            base = now if name in truth else outputs(states, {**truth, name: values})
            columns[label] = np.arange(len(slopes), len(slopes) + len(live))
            for p in live:
                step = SHARE * p.scale * (1.0 if values[p.name] + SHARE * p.scale <= p.high else -1.0)
                there = outputs(states, {**truth, name: {**values, p.name: values[p.name] + step}})
                slopes.append(change(base, there) / step)
    means = {label: layout.means[label] for label in columns}
    response = Response(
        torch.zeros((len(states), length, 18), dtype=torch.float64),
        torch.as_tensor(state_slopes(outputs, states, now, truth)),
        torch.as_tensor(np.stack(slopes, axis=-1)),
    )
    seen = point.windows.mask.unsqueeze(-1)
    response = Response(response.error, response.state * seen, response.parameters * seen)
    sums, _, _ = normal_equations(point.windows, [response], point.sigma)
    part = replace(layout, names=tuple(columns), columns=columns, means=means)
    return Information(sums.hessian.sum(0), part, {n: list(s) for n, s in starts.items()}, point.truth)
