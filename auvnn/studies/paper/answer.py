"""What a case study answers: `study.json`, and what its figures are drawn from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from auvnn.answers import Answer, plain
from auvnn.models import GreyBox


@dataclass
class Study(Answer):
    """A case study of the paper; `to_dict` is `study.json` of the public contract.

    Attributes:
        case: its name.
        name: of the vehicle.
        options: as composed.
        assumed: what was assumed, in words; "ours" where the paper leaves it open.
        metrics: flat numbers with units in their names.
        table: rows of the study's table, one per model compared.
        drawn: what each figure is drawn from: `{name, kind, title, caption, ...data}`, in the paper's order.
        model: the trained model.
        warnings: what a reader must keep in mind.
    """

    kind = "study"
    case: str
    name: str
    options: dict[str, Any]
    assumed: list[str]
    metrics: dict[str, Any]
    table: list[dict[str, Any]]
    drawn: list[dict[str, Any]]
    model: GreyBox
    warnings: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer; curves are in the figures' CSV files."""
        figures = [{k: d[k] for k in ("name", "title", "caption")} for d in self.drawn]
        return plain(
            {
                "schema": "auvnn/study/1",
                "case": self.case,
                "model": self.name,
                "options": self.options,
                "assumed": self.assumed,
                "metrics": self.metrics,
                "table": self.table,
                "figures": figures,
                "warnings": self.warnings,
            }
        )
