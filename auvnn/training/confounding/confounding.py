"""What subnetworks have learned that effects account for better than drag: the answer and its words."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import Parameters

Array = NDArray[np.float64]


AXES = ("X", "Y", "Z", "K", "M", "N")


UNITS = ("N", "N", "N", "N m", "N m", "N m")


# Standard errors beyond which something is taken for real, and the share of the learned wrench from which on it
# matters.
SURE, SIZE = 4.0, 0.05


# Negative power counts from this share of the largest on, in at least this share of the samples.
POWER, SAMPLES = 0.01, 0.005


# Share of what no drag gives that an effect must account for; and of the best effect's share that makes a rival.
SHARE, RIVAL, SAME = 0.4, 0.8, 0.9


# The same of a force at rest, whose standard error leaves out that the form cannot bend to everything.
REST_SURE, REST_SIZE = 5.0, 0.1


# Share of an effect's own trace that no drag could imitate, below which the log cannot tell.
TOLD = 0.01


@dataclass(frozen=True)
class ConfoundedEffect:
    """An effect that the subnetworks may have learned.

    Attributes:
        effect: name.
        share: of what no drag gives, by energy over the log, that it accounts for.
        size: of its wrench, relative to all that was learned.
        parameters: name to {value, std, unit}.
        found: whether it is beyond doubt and matters.
    """

    effect: str
    share: float
    size: float
    parameters: Parameters
    found: bool


@dataclass(frozen=True)
class Confounding:
    """What subnetworks have learned besides damping.

    Attributes:
        rest: (6,) d(0), N and N m.
        rest_std: (6,) its standard errors.
        rest_share: (6,) |d(0)| relative to the root mean square of each learned force.
        driving: share of the samples at which they add energy beyond doubt.
        worst: (power in W, velocity (6,)) where they add most.
        beyond: share of the learned wrench, by energy, that no drag gives.
        suspects: best first.
        surfaces: one curve per degree of freedom, with its band and the range that the log covered.
    """

    rest: Array
    rest_std: Array
    rest_share: Array
    driving: float
    worst: tuple[float, Array]
    beyond: float
    suspects: tuple[ConfoundedEffect, ...]
    surfaces: list[dict[str, Any]] = field(default_factory=list)

    @property
    def at_rest(self) -> list[int]:
        """Degrees of freedom in which there is a force at rest."""
        sure = np.abs(self.rest) > REST_SURE * self.rest_std
        return np.flatnonzero(sure & (self.rest_share > REST_SIZE)).tolist()

    @property
    def named(self) -> list[ConfoundedEffect]:
        """The effect that was learned in place of damping, and those that cannot be told from it; may be empty."""
        found = [s for s in self.suspects if s.found]
        near = [s for s in found if s.share >= RIVAL * found[0].share]
        # Of those that do equally well, the one with the fewest parameters claims least.
        return sorted(near, key=lambda s: (s.share < SAME * near[0].share, len(s.parameters)))

    def words(self) -> list[str]:
        """Return what there is to warn of, in plain sentences; nothing where the subnetworks are honest drag."""
        out = []
        named = self.named
        if named:
            first, *others = named
            out.append(
                f"the damping subnetworks have learned something that is not damping: {_described(first)} accounts "
                f"for {100 * first.share:.0f} % of what no drag gives"
                + (f"; so may {', '.join(_described(o) for o in others)}" if others else "")
                + f". Train again with effects: {first.effect} in the model"
            )
        if self.at_rest:
            forces = ", ".join(
                f"{AXES[k]} {self.rest[k]:.3g} +- {self.rest_std[k]:.1g} {UNITS[k]}" for k in self.at_rest
            )
            cause = (
                ""
                if named
                else ": a constant force, buoyancy, an offset centre of gravity or a current does so"
            )
            out.append(f"the damping subnetworks push at rest, which no damping does ({forces}){cause}")
        if self.driving >= SAMPLES:
            power, nu = self.worst
            velocity = ", ".join(f"{value:.2g}" for value in nu)
            out.append(
                f"the learned damping adds energy at {100 * self.driving:.1f} % of the samples, most at "
                f"nu = ({velocity}): {power:.3g} W; the form 'dissipative' cannot do so"
            )
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "at_rest": {
                a: {"value": v, "std": s, "share": r}
                for a, v, s, r in zip(AXES, self.rest, self.rest_std, self.rest_share, strict=True)
            },
            "adds_energy_share": self.driving,
            "beyond_drag_share": self.beyond,
            "suspects": [vars(s) for s in self.suspects],
            "named": [s.effect for s in self.named],
        }


def _described(suspect: ConfoundedEffect) -> str:
    """Return an effect with those of its parameters that are beyond doubt."""
    null = 1.0 if suspect.effect == "added_mass" else 0.0
    parts = [
        f"{n} {p['value']:.3g} +- {p['std']:.1g}{'' if p['unit'] == '1' else ' ' + p['unit']}"
        for n, p in suspect.parameters.items()
        if abs(p["value"] - null) > SURE * p["std"]
    ]
    return f"{suspect.effect} ({', '.join(parts)})" if parts else suspect.effect
