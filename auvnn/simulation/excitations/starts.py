"""How runs begin: at a depth, with a random heading and a small random attitude."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from auvnn.logs.signals.rotation import from_euler
from auvnn.simulation.cruise import Cruise
from auvnn.simulation.excitations.base import Array


def random_starts(
    generators: Sequence[np.random.Generator], depth: float, lean: float, steady: Cruise | None = None
) -> tuple[Array, Array]:
    """Return eta (R, 7) and nu (R, 6): at rest, with any heading, and roll and pitch within `lean`, rad.

    A vehicle that must move to be steered starts under way instead.

    Args:
        generators: one for each of the R runs.
        depth: m.
        lean: rad.
        steady: how the vehicle moves under way, or None for one that can hover.
    """
    angles = np.stack([np.array([*g.uniform(-lean, lean, 2), g.uniform(-np.pi, np.pi)]) for g in generators])
    nu = np.zeros((len(generators), 6))
    if steady is not None:
        angles[:, 1] += steady.pitch
        nu += steady.nu
    position = np.tile([0.0, 0.0, depth], (len(generators), 1))
    return np.concatenate([position, from_euler(angles)], axis=1), nu
