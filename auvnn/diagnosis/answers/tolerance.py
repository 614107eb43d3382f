"""What does not matter: a cost in free running and a force, below which an effect or a remainder is only reported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from auvnn.errors import ConfigError

COST, FORCE = 0.10, 0.02


@dataclass(frozen=True)
class Tolerance:
    """What does not matter.

    Attributes:
        cost: (E without - E with) / E with, E the free-running error on what is left out.
        force: root mean square of the force as a share of the actuators'.
    """

    cost: float = COST
    force: float = FORCE

    @classmethod
    def of(cls, value: Any) -> Tolerance:
        """Read an option: nothing for the defaults, a number for the cost with a fifth of it for the force, or both.

        Raises:
            ConfigError: no number, or one below zero.
        """
        if value is None:
            return cls()
        if isinstance(value, Tolerance):
            return value
        if isinstance(value, Mapping):
            unknown = [str(k) for k in value if k not in ("cost", "force")]
            if unknown:
                raise ConfigError(f"tolerance has no part '{unknown[0]}': it has cost and force")
            return cls(_number(value.get("cost", COST)), _number(value.get("force", FORCE)))
        cost = _number(value)
        return cls(cost, cost * FORCE / COST)

    @property
    def strict(self) -> bool:
        """Whether everything matters that is there."""
        return self.cost == 0.0 and self.force == 0.0

    def to_dict(self) -> dict[str, float]:
        """Return plain data."""
        return {"cost": self.cost, "force": self.force}


def _number(value: Any) -> float:
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not good or not 0.0 <= value < np.inf:
        raise ConfigError(
            f"tolerance={value} must be a number, zero or above: 0.1 leaves out what costs under 10 %"
        )
    return float(value)
