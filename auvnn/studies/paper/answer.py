"""What a case study answers: `study.json`, and what its figures are drawn from."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.answers import Answer, plain, write_text
from auvnn.models import GreyBox


@dataclass(repr=False)
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

    def write(self, folder: str | Path, *, report: bool = True) -> Path:
        """Write `study.json`, the report with its figures, and beside each figure of curves its numbers as CSV."""
        path = super().write(folder, report=report)
        for drawn in self.drawn if report else ():
            if drawn["kind"] == "velocity":
                write_text(Path(folder) / "figures" / f"{drawn['name']}.csv", _csv(drawn))
        return path


def _csv(drawn: Mapping[str, Any]) -> str:
    """Return the velocities of a figure: t, then the six components of each line."""
    names, columns = ["t"], [np.asarray(drawn["t"])[:, None]]
    for line, values in drawn["lines"].items():
        word = "_".join("".join(c if c.isalnum() else " " for c in line).split())
        names += [f"{word}_{axis}" for axis in "uvwpqr"]
        columns.append(np.asarray(values))
    stream = io.StringIO()
    np.savetxt(
        stream,
        np.concatenate(columns, axis=1),
        fmt="%.7g",
        delimiter=",",
        header=",".join(names),
        comments="",
    )
    return stream.getvalue()
