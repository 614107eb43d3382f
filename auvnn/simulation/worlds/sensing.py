"""What a world's sensors record: noise with a memory, outliers, gaps, velocities that are held, a clock that is off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.channels import ACCELERATION, EULER, POSITION, VELOCITY
from auvnn.logs.signals.rotation import multiply
from auvnn.simulation.noise import CHANNELS, Draws, Noise
from auvnn.simulation.worlds.world import Sensors

Array = NDArray[np.float64]

# Sensors that lose samples together, by their channels.
SENSORS = {"velocity": VELOCITY[:3], "rate": VELOCITY[3:], "attitude": EULER, "position": POSITION}


class Sensing:
    """What R runs of T rows report to a controller, and what is recorded of them.

    A controller sees noise with a memory, held velocities and the tilt; outliers and gaps are in the record alone: a
    navigation filter rejects the ones and bridges the others.

    Args:
        sensors: of the world.
        noise: condition.
        step: between rows, s.
        rows: T.
        generators: of the noise, one per run.
        further: of outliers, gaps and the clock, one per run.
        common: of the tilt.
    """

    def __init__(
        self,
        sensors: Sensors,
        noise: Noise,
        step: float,
        rows: int,
        generators: Sequence[np.random.Generator],
        further: Sequence[np.random.Generator],
        common: np.random.Generator,
    ) -> None:
        """Draw everything."""
        self.sensors, self.step = sensors, step
        self.draws = Draws(noise, rows, generators)
        if sensors.correlation > 0.0:
            self.draws.blocks = {
                k: (_remembered(u, step, sensors.correlation), size, share)
                for k, (u, size, share) in self._blocks()
            }
        self.recorded = Draws(noise, 1, [np.random.default_rng(0)])
        self.recorded.blocks = {k: (u.copy(), size, share) for k, (u, size, share) in self._blocks()}
        self.hold = max(1, round(1.0 / (sensors.velocity_rate * step))) if sensors.velocity_rate > 0.0 else 1
        azimuth = common.uniform(0.0, 2.0 * np.pi)
        self.tilt = sensors.tilt * np.array([np.cos(azimuth), np.sin(azimuth)])
        half = 0.5 * sensors.tilt
        self._turn = np.array(
            [np.cos(half), *(np.sin(half) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))]
        )
        self.missing = {name: np.zeros((len(further), rows), dtype=bool) for name in SENSORS}
        self.late = np.zeros((len(further), rows))
        self._held: Array | None = None
        for i, generator in enumerate(further):
            self._spoil(i, rows, generator)

    def _blocks(self) -> list[tuple[str, tuple[Array, Array, Array]]]:
        return list(self.draws.blocks.items())

    def _spoil(self, run: int, rows: int, generator: np.random.Generator) -> None:
        """Draw one run's outliers, gaps and clock; all of them, whatever is asked for."""
        chance, sign = (
            generator.uniform(size=(rows, len(CHANNELS))),
            generator.choice([-1.0, 1.0], (rows, len(CHANNELS))),
        )
        size = generator.uniform(*self.sensors.outlier_size, (rows, len(CHANNELS)))
        kicks = np.where(chance < self.sensors.outliers, sign * size, 0.0)
        for names in (VELOCITY, ACCELERATION, EULER, POSITION):
            first = CHANNELS.index(names[0])
            self.recorded.blocks[names[0]][0][run] += kicks[:, first : first + len(names)]
        for name in SENSORS:
            lost = generator.uniform(size=rows) < self.sensors.dropouts
            self.missing[name][run] = self._since(lost[None])[0] if name == "velocity" else lost
        late = self.sensors.jitter * generator.standard_normal(rows)
        self.late[run] = np.clip(late, -0.45 * self.step, 0.45 * self.step)

    def _since(self, rows: Any) -> Any:
        """Return of each row what the last measurement of velocities had, (R, T, ...)."""
        return rows[:, (np.arange(rows.shape[1]) // self.hold) * self.hold]

    def turned(self, quaternion: Array) -> Array:
        """Return attitudes (..., 4) that refer to a vertical that is off."""
        if self.sensors.tilt == 0.0:
            return quaternion
        return multiply(np.broadcast_to(self._turn, quaternion.shape), quaternion)

    def look(self, k: int, position: Array, quaternion: Array, nu: Array) -> tuple[Array, Array, Array]:
        """Return what a controller sees at row k, from what sensors without noise report.

        Args:
            k: number of the row.
            position: NED, m, (R, 3).
            quaternion: attitude, (R, 4).
            nu: velocity, m/s and rad/s, (R, 6).
        """
        seen = self.draws.added("u", nu, k)
        if k % self.hold == 0 or self._held is None:
            self._held = seen[:, :3].copy()
        seen = np.concatenate([self._held, seen[:, 3:]], axis=-1)
        return self.draws.added("x", position, k), self.draws.turned(self.turned(quaternion), k), seen

    def record(self, position: Array, quaternion: Array, velocity: Array) -> tuple[Array, Array, Array]:
        """Return what is recorded of all rows: position (R, T, 3), quaternion (R, T, 4) and nu (R, T, 6).

        Args:
            position: NED, m, (R, T, 3).
            quaternion: attitude, (R, T, 4).
            velocity: m/s and rad/s, (R, T, 6).
        """
        place, nu = self.recorded.added("x", position), self.recorded.added("u", velocity)
        attitude = self.recorded.turned(self.turned(quaternion))
        nu = np.concatenate([self._since(nu[..., :3]), nu[..., 3:]], axis=-1)
        for name, part in (
            ("position", place),
            ("attitude", attitude),
            ("velocity", nu[..., :3]),
            ("rate", nu[..., 3:]),
        ):
            part[self.missing[name]] = np.nan
        return place, attitude, nu

    def stamps(self, t: Array) -> Array:
        """Return the recorded time of each row, s, (R, T): errors, but rising."""
        return t + self.late


def _remembered(unit: Array, step: float, correlation: float) -> Array:
    """Return white noise (R, T, c) of unit size with a correlation time, s, of the same size."""
    # A world's alone: whoever simulates none does not wait for it to be imported.
    from scipy.signal import lfilter

    a = float(np.exp(-step / correlation))
    scaled = unit * np.concatenate([[1.0], np.full(unit.shape[1] - 1, np.sqrt(1.0 - a * a))])[:, None]
    return np.asarray(lfilter([1.0], [1.0, -a], scaled, axis=1))
