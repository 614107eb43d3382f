"""Several models on one log: the same windows, one figure, one table."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

from auvnn.answers import DRAWERS, PLOTTED, Answer, plain, write_text
from auvnn.cards import Card, figure
from auvnn.comparison.baseline import HORIZONS as MAIN
from auvnn.comparison.compare import Comparison
from auvnn.comparison.compare import compare as compare_one
from auvnn.comparison.predictions import write_predictions
from auvnn.errors import ConfigError, InputError
from auvnn.metrics.rollouts import HORIZONS
from auvnn.models import GreyBox
from auvnn.models.load_arguments import GivenLog, GivenModel, as_log, as_model
from auvnn.threads import on_one_thread

Models = Sequence[GivenModel] | Mapping[str, GivenModel]


@dataclass(repr=False)
class Comparisons(Answer):
    """How well several models explain one log; `to_dict` is `comparison.json` of several models of the public contract.

    Attributes:
        log: its name.
        comparisons: label of the model to its comparison, in the order given.
    """

    kind = "comparisons"
    log: str
    comparisons: dict[str, Comparison]

    def __getitem__(self, label: str) -> Comparison:
        """Return the comparison of one model."""
        return self.comparisons[label]

    @property
    def models(self) -> list[str]:
        """Labels of the models, in the order given."""
        return list(self.comparisons)

    @property
    def horizon(self) -> str | None:
        """Horizon by which they are ranked: 5 s, or the nearest to it that was scored."""
        scored = [c.rollout for c in self.comparisons.values()]
        return next(
            (h for h in MAIN if all(plain((r.get(h) or {}).get("total")) is not None for r in scored)), None
        )

    @property
    def ranking(self) -> list[str]:
        """Labels from the smallest error of free running to the largest; in the order given where none is known."""
        key = self.horizon
        if key is None:
            return self.models
        return sorted(self.models, key=lambda label: self.comparisons[label].rollout[key]["total"])

    @property
    def warnings(self) -> list[str]:
        """What to keep in mind, by model where the models differ in it."""
        every = [c.warnings for c in self.comparisons.values()]
        common = [w for w in every[0] if all(w in warnings for warnings in every)] if every else []
        own = [
            f"{label}: {w}" for label, c in self.comparisons.items() for w in c.warnings if w not in common
        ]
        return [*common, *own]

    def card(self) -> Card:
        """Return the models' errors, best first."""
        key, rows = self.horizon, []
        for label in self.ranking:
            c = self.comparisons[label]
            rows.append([label, *(figure((c.rollout.get(h) or {}).get("total")) for h in c.rollout)])
        first = next(iter(self.comparisons.values()))
        head = ("model", *("whole run" if h == "full" else f"{h} s" for h in first.rollout))
        line = "" if key is None else f"smallest error over {key} s of free running: {self.ranking[0]}"
        return Card(
            f"Comparison of {len(self.comparisons)} models with {self.log}", line, (), head, rows, PLOTTED
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        first = next(iter(self.comparisons.values()))
        return plain(
            {
                "schema": "auvnn/comparisons/1",
                "log": self.log,
                "samples": first.samples,
                "runs": first.runs,
                "models": self.models,
                "horizon": self.horizon,
                "ranking": self.ranking,
                "comparisons": {label: c.to_dict() for label, c in self.comparisons.items()},
                "warnings": self.warnings,
            }
        )

    def write(self, folder: str | Path, *, report: bool = True) -> Path:
        """Write `comparison.json`, the predictions as one table with the model's label, and the report."""
        path = write_text(
            Path(folder) / "comparison.json", json.dumps(self.to_dict(), indent=1, allow_nan=False)
        )
        if report:
            DRAWERS.get(self.kind).write(self, folder)
        tables = {label: c.series for label, c in self.comparisons.items()}
        write_predictions(tables, Path(folder) / "predictions.parquet")
        return path


@overload
def compare(
    model: GivenModel,
    log: GivenLog,
    *,
    horizons: Sequence[str | float] = HORIZONS,
    derivative: Mapping[str, Any] | None = None,
) -> Comparison: ...
@overload
def compare(
    model: Models,
    log: GivenLog,
    *,
    horizons: Sequence[str | float] = HORIZONS,
    derivative: Mapping[str, Any] | None = None,
) -> Comparisons: ...
@on_one_thread
def compare(
    model: Any,
    log: GivenLog,
    *,
    horizons: Sequence[str | float] = HORIZONS,
    derivative: Mapping[str, Any] | None = None,
) -> Comparison | Comparisons:
    """Compare a model, or several, with a log.

    Args:
        model: a model, the name of a built-in vehicle, a model's file or folder; of several models a list of these, or
            a mapping from labels to them.
        log: measurements, or the path of their file; nothing is fitted to them here.
        horizons: seconds of free running from measured states, and "full".
        derivative: how accelerations are obtained where they were not measured: `method`, `half_width`, `order`.

    Returns:
        A `Comparison`; of several models `Comparisons`, which holds one for each by its label.

    Raises:
        InputError: the log lacks the commands that drive a model.
        ConfigError: a horizon that is no positive number, or no model.

    Example:
        ```python
        log = auvnn.simulate("rov95", runs=1, duration=10.0, noise="none").log
        found = auvnn.compare("rov95", log, horizons=("1",))
        found.rollout["1"]["total"]
        ```
    """
    log = as_log(log)
    if not isinstance(model, (list, tuple, Mapping)):
        return compare_one(model, log, horizons=horizons, derivative=derivative)
    if not model:
        raise ConfigError("no model to compare: give a model, or a list of them")
    given = list(model.values()) if isinstance(model, Mapping) else list(model)
    loaded = [as_model(m, log) for m in given]
    labels = list(map(str, model)) if isinstance(model, Mapping) else labelled(given, loaded)
    found = {}
    for label, each in zip(labels, loaded, strict=True):
        try:
            found[label] = compare_one(each, log, horizons=horizons, derivative=derivative)
        except InputError as problem:
            raise InputError(f"model {label}: {problem}") from None
    return Comparisons(log.name, found)


def labelled(given: Sequence[Any], loaded: Sequence[GreyBox]) -> list[str]:
    """Return a label for each model, all different: its file or name, else its vehicle's name and its effects.

    Of a path stands its end, as much of it as tells the models apart.
    """
    out: list[str] = []
    paths = {str(s): Path(s).parts for s in given if isinstance(s, (str, Path))}
    for source, model in zip(given, loaded, strict=True):
        label = " + ".join([model.vehicle.name, *model.effect_names])
        if str(source) in paths:
            label = _end(paths[str(source)], [p for s, p in paths.items() if s != str(source)])
        if label in out:
            number = 2
            while f"{label} ({number})" in out:
                number += 1
            label = f"{label} ({number})"
        out.append(label)
    return out


def _end(path: tuple[str, ...], others: Sequence[tuple[str, ...]]) -> str:
    """Return the last parts of a path, as many as no other path ends with."""
    for count in range(1, len(path)):
        if all(other[-count:] != path[-count:] for other in others):
            return str(Path(*path[-count:]))
    return str(Path(*path))
