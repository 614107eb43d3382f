"""What sensors add to the truth: named noise conditions, with their numbers as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.config import config_dir, read_yaml
from auvnn.errors import ConfigError
from auvnn.logs.channels import ACCELERATION, POSITION, VELOCITY
from auvnn.logs.channels import EULER as ATTITUDE
from auvnn.logs.signals.rotation import multiply

Array = NDArray[np.float64]

VOLTAGE = ("voltage",)
CHANNELS = (*VELOCITY, *ACCELERATION, *ATTITUDE, *POSITION, *VOLTAGE)
# Drawn on its own, so that a log with a bottom has the same noise elsewhere as one without.
ALTITUDE = "altitude"
SIZES = ("standard_deviation", "relative")
AMPLITUDES = ("std", "uniform")


@dataclass(frozen=True)
class Noise:
    """White noise on every channel, independent from sample to sample.

    Attributes:
        name: of the condition.
        accelerations: whether the log has measured accelerations.
        standard_deviation: by channel, SI; `phi`, `theta`, `psi` are small rotations about the body axes.
        relative: by channel, as a share of the channel's own magnitude, added to the above.
        amplitude: what the numbers are: `std`, standard deviations of normal noise, or `uniform`, the
            half-width of noise that is spread evenly.
    """

    name: str = "custom"
    accelerations: bool = False
    standard_deviation: Mapping[str, float] = field(default_factory=dict)
    relative: Mapping[str, float] = field(default_factory=dict)
    amplitude: str = "std"

    def sizes(self, channels: Sequence[str]) -> tuple[Array, Array]:
        """Return absolute and relative size by channel, (c,) each."""
        absolute = np.array([float(self.standard_deviation.get(c, 0.0)) for c in channels])
        return absolute, np.array([float(self.relative.get(c, 0.0)) for c in channels])

    def to_dict(self) -> dict[str, Any]:
        """Return the condition as plain data."""
        return {f: dict(v) if isinstance(v, Mapping) else v for f, v in vars(self).items()}

    def draw(self, rows: int, generator: np.random.Generator) -> Array:
        """Draw a run's noise of unit size, (rows, channels)."""
        if self.amplitude == "uniform":
            return generator.uniform(-1.0, 1.0, (rows, len(CHANNELS)))
        return generator.standard_normal((rows, len(CHANNELS)))


class Draws:
    """The noise of R runs of T rows, drawn beforehand so that one row or all can be asked for.

    Args:
        noise: the condition.
        rows: T.
        generators: one per run.
    """

    def __init__(self, noise: Noise, rows: int, generators: Sequence[np.random.Generator]) -> None:
        """Draw everything, whatever the log will hold: a run's noise must not depend on it."""
        unit = np.stack([noise.draw(rows, g) for g in generators])
        self.blocks: dict[str, tuple[Array, Array, Array]] = {}
        for names in (VELOCITY, ACCELERATION, ATTITUDE, POSITION, VOLTAGE):
            first = CHANNELS.index(names[0])
            self.blocks[names[0]] = (unit[..., first : first + len(names)], *noise.sizes(names))

    def added(self, first: str, truth: Array, rows: slice | int = slice(None)) -> Array:
        """Return truth (R, T, c) or (R, c) with the noise of the block that begins with channel `first`.

        Args:
            first: "x", "u", "du", ...: the block's first channel.
            truth: in the block's unit.
            rows: which of the T rows `truth` has.
        """
        unit, absolute, relative = self.blocks[first]
        return truth + (absolute + relative * np.abs(truth)) * unit[:, rows]

    def turned(self, quaternion: Array, rows: slice | int = slice(None)) -> Array:
        """Return attitudes (R, T, 4) or (R, 4) turned by small rotations about the body axes."""
        unit, absolute, _ = self.blocks["phi"]
        if not absolute.any():
            return quaternion
        half = 0.5 * absolute * unit[:, rows]
        angle = np.linalg.norm(half, axis=-1, keepdims=True)
        small = np.concatenate([np.cos(angle), half * np.sinc(angle / np.pi)], axis=-1)
        return multiply(quaternion, small)


def make_noise(given: str | Mapping[str, Any]) -> Noise:
    """Return the noise that a name, or a mapping of options, asks for.

    A mapping whose `name` is that of a shipped condition starts from its numbers, channel by channel.

    Raises:
        ConfigError: unknown name, option or channel, or a number that cannot be a size.
    """
    options: dict[str, Any] = {"name": given} if isinstance(given, str) else dict(given)
    folder = config_dir() / "noise"
    names = sorted(path.stem for path in folder.glob("*.yaml"))
    name = str(options.get("name", "custom"))
    if name in names:
        shipped = read_yaml(folder / f"{name}.yaml")
        for key in SIZES:
            if isinstance(options.get(key), Mapping):
                options[key] = {**shipped.get(key, {}), **options[key]}
        options = {**shipped, **options}
    elif isinstance(given, str):
        raise ConfigError(unknown_name("noise", given, names))
    known = Noise.__dataclass_fields__
    for key in options:
        if key not in known:
            raise ConfigError(unknown_name("option of noise", key, known))
    for key in SIZES:
        options[key] = _sizes(key, options.get(key))
    if not isinstance(options.get("accelerations", False), bool):
        raise ConfigError(f"noise.accelerations = {options['accelerations']!r}: true or false is needed")
    if options.get("amplitude", "std") not in AMPLITUDES:
        raise ConfigError(f"noise.amplitude = {options['amplitude']!r}: choose from {', '.join(AMPLITUDES)}")
    return Noise(**options)


def _sizes(key: str, given: Any) -> dict[str, float]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ConfigError(f"noise.{key} = {given!r}: numbers by channel are needed, such as {{u: 0.006}}")
    for channel, value in given.items():
        if channel not in (*CHANNELS, ALTITUDE):
            raise ConfigError(unknown_name("channel of noise", str(channel), (*CHANNELS, ALTITUDE)))
        good = isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 <= value < np.inf
        if not good:
            raise ConfigError(f"noise.{key}.{channel} = {value!r}: a number from 0 up is needed")
    if key == "relative" and any(c in given for c in (*ATTITUDE, *POSITION)):
        raise ConfigError("noise.relative: attitude and position have no magnitude; give standard deviations")
    return {str(c): float(v) for c, v in given.items()}
