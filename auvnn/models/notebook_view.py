"""A model as a notebook shows it: one line, a card with its effects, and a figure of its damping."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from auvnn.answers import DRAWERS
from auvnn.cards import PARAMETER_HEAD, Card, Shown, parameter_rows

if TYPE_CHECKING:
    from auvnn.effects import Effect
    from auvnn.vehicle import Vehicle


class ShownModel(Shown):
    """What a model inherits of this."""

    vehicle: Vehicle
    actuation: str
    damping: Any

    @property
    def members(self) -> list[Effect]:
        """The effects, in order of action."""
        ...

    @property
    def effect_names(self) -> list[str]:
        """Names of the effects, in order of action."""
        ...

    def values(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Return the effects' values, standard deviations (None where none is known) and units, by parameter."""
        return {
            str(e.name): {
                p.name: {
                    "value": e.values()[p.name],
                    "std": e.uncertainty.get(p.name),
                    "unit": p.unit,
                    "null": p.null,
                }
                for p in e.parameters_of
            }
            for e in self.members
        }

    def card(self) -> Card:
        """Return the vehicle, what drives it, and the effects with their values."""
        names = ", ".join(self.effect_names)
        learned = "" if self.damping is None else "; learned damping"
        line = f"driven by {self.actuation}; {'effects: ' + names if names else 'no effects'}{learned}"
        doubts = [f"Assumed: {w}{'' if w.endswith('?') else '.'}" for w in self.vehicle.warnings[:3]]
        foot = ".vehicle.summary() lists its numbers, .plot() draws its damping, .save('folder') writes it"
        rows = parameter_rows(self.values())
        return Card(f"Model of {self.vehicle.name}", line, doubts, PARAMETER_HEAD, rows, foot)

    def plot(self) -> Any:
        """Return a matplotlib Figure: the values of the effects with their intervals, or else the damping forces."""
        return next(iter(DRAWERS.get("model").figures(self).values()))
