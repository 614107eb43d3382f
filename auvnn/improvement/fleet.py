"""The same effects over many dives: each dive is fitted separately, and the values are compared with one another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.answer_types import Dive, ParameterTrend
from auvnn.answers import Answer, plain
from auvnn.cards import measured
from auvnn.diagnosis.full_data.large_logs import SEARCH
from auvnn.diagnosis.hypotheses.candidates import (
    check_window_length,
)
from auvnn.effects import effect_class
from auvnn.effects.registering import names_of
from auvnn.errors import ConfigError, InputError
from auvnn.executors import Lost, executor_for
from auvnn.improvement.one_dive import _DAY, Question, dive
from auvnn.improvement.trend import Trend, trend
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.portions import kind_of, log_files
from auvnn.models import GreyBox
from auvnn.progress import Progress
from auvnn.threads import on_one_thread

# Level of the tests over dives, shared by all parameters (Bonferroni).
LEVEL = 0.05


@dataclass(repr=False)
class Fleet(Answer):
    """Values of effects over dives; `to_dict` is `fleet.json`.

    Attributes:
        model: its name.
        effects: that were fitted.
        dives: in order of their dates, or of their names: file, start, values, verdict of adequacy.
        failed: dives that could not be fitted, and why.
        trends: one for each parameter, as `trend` gives it.
        along: "date" (days since the first dive) or "dive" (their numbers): what the trends are over.
        warnings: what to keep in mind.
    """

    kind = "fleet"
    model: str
    effects: list[str]
    dives: list[Dive]
    failed: list[dict[str, str]]
    trends: list[ParameterTrend]
    along: str
    warnings: list[str] = field(default_factory=list)

    @property
    def metrics(self) -> dict[str, float]:
        """A few numbers by name."""
        adequate = sum(d["verdict"] == "adequate" for d in self.dives)
        changing = sum(t["changes"] for t in self.trends)
        return {
            "dives_fitted": len(self.dives),
            "dives_failed": len(self.failed),
            "dives_adequate": adequate,
            "parameters_changing": changing,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = ("model", "effects", "along", "dives", "failed", "trends", "metrics", "warnings")
        return plain({"schema": "auvnn/fleet/1", **{n: getattr(self, n) for n in names}})


@on_one_thread
def fleet(
    model: GreyBox | str | Path,
    logs: str | Path | Sequence[str | Path],
    effects: str | Sequence[str],
    *,
    mapping: Any = None,
    window: float | None = None,
    windows: int = SEARCH,
    workers: int = 1,
    executor: str | None = None,
    address: str | None = None,
    force: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Fleet:
    """Fit the same effects to every dive separately, and say whether their values change from dive to dive.

    Each file is a dive, with all its runs. The effects are fitted jointly with the coefficients that are uncertain, as
    `diagnose` does; a dive that cannot be fitted fails alone.

    Args:
        model: the model as known, or its name or path.
        logs: a folder, a pattern, a file or a list of these.
        effects: names; those that the model has already are fitted again on each dive.
        mapping: how the files' columns are named.
        window: length of the windows of free running, s.
        windows: at most so many of each dive, evenly spread: bounds time and memory.
        workers: processes.
        executor: who computes: `serial`, `processes`, `ray` or `dask`.
        address: of a Ray or Dask cluster that is running.
        force: fit dives that contradict themselves, or in which nothing moves or is driven, too.
        progress: called with what is being done, in words.

    Raises:
        ConfigError: an unknown effect, or none.
        InputError: there is no log, or no dive could be fitted.

    Example:
        ```python
        found = auvnn.fleet("rov95", "dives/*.parquet", ["biofouling", "ballast_error"], workers=4)
        found.trends  # of each parameter: constant or changing over the dives
        ```
    """
    from auvnn.models import load

    say = progress or (lambda words: None)
    check_window_length(window)
    effects = names_of(effects)
    names = [effects] if isinstance(effects, str) else list(effects)
    if not names:
        raise ConfigError("effects=[]: name at least one effect to follow over the dives")
    for name in names:
        effect_class(name)
        if names.count(name) > 1:
            raise ConfigError(f"effect {name} is named twice: name it once")
    if isinstance(windows, bool) or not isinstance(windows, int) or windows < 4:
        raise ConfigError(f"windows={windows} must be a whole number, at least 4")
    paths = log_files([logs] if isinstance(logs, (str, Path)) else logs)
    if not isinstance(model, GreyBox):
        model = load(str(model), actuation=kind_of(paths, mapping))
    question = Question(model, tuple(names), Mapping.read(mapping), window, windows, force)
    dives, failed = [], []
    with executor_for(executor, workers, address) as pool:
        say(Progress(f"fitting {len(paths)} dives", 0, len(paths)))
        for path, found in zip(paths, pool.run(dive, question, paths, losses=True), strict=True):
            say(Progress(f"fitted {path}", len(dives) + len(failed) + 1, len(paths)))
            if isinstance(found, Lost):
                found = str(found)
            if isinstance(found, str):
                failed.append({"file": str(path), "words": found})
            else:
                dives.append(found)
    if not dives:
        raise InputError(f"none of {len(paths)} dives could be fitted; the first: {failed[0]['words']}")
    return _together(model, names, dives, failed)


def _together(model: GreyBox, names: list[str], dives: list[Dive], failed: list[dict[str, str]]) -> Fleet:
    dated = all(d["start"] is not None for d in dives) and len({d["start"] for d in dives}) == len(dives) > 1
    if dated:
        dives = sorted(dives, key=lambda d: str(d["start"]))
    begin = datetime.fromisoformat(str(dives[0]["start"])) if dated else None
    for number, each in enumerate(dives, 1):
        each["dive"] = number
        each["days"] = (
            None
            if begin is None
            else (datetime.fromisoformat(str(each["start"])) - begin).total_seconds() / _DAY
        )
    x = [d["dive"] if d["days"] is None else d["days"] for d in dives]
    rows = []
    for effect in names:
        for name, first in dives[0]["parameters"][effect].items():
            own = [d["parameters"][effect][name] for d in dives]
            found = trend(x, [p["value"] for p in own], [p["std"] for p in own])
            rows.append(_row(effect, name, first["unit"], found, dated))
    count = len([r for r in rows if r["dives"] > 1])
    for row in rows:
        row["changes"] = _below(row["constancy"]["p_value"], count) or _below(row["slope"]["p_value"], count)
        row["words"] = _words(row, dated)
    warnings = []
    if not dated:
        warnings.append("not every dive has a separate date: they are taken in the order of their names")
    poor = [d["file"] for d in dives if d["verdict"] != "adequate"]
    if poor:
        warnings.append(
            f"{len(poor)} of {len(dives)} dives leave something that these effects do not explain (first: {poor[0]}): "
            "their values may stand in for it; auvnn diagnose asks what it is"
        )
    driven = [d["file"] for d in dives if d["commands"] is not None]
    if driven:
        warnings.append(
            f"in {len(driven)} of {len(dives)} dives (first: {driven[0]}) commands change between samples: they are "
            "fitted with the mean thrust of each interval"
        )
    if failed:
        warnings.append(f"{len(failed)} dives could not be fitted; the first: {failed[0]['words']}")
    return Fleet(model.vehicle.name, names, dives, failed, rows, "date" if dated else "dive", warnings)


def _below(p: float, count: int) -> bool:
    return bool(np.isfinite(p) and p * count < LEVEL)


def _row(effect: str, name: str, unit: str, found: Trend, dated: bool) -> ParameterTrend:
    per = "d" if dated else "dive"
    return {
        "effect": effect,
        "parameter": name,
        "unit": unit,
        "dives": found.count,
        "mean": {"value": found.mean, "std": found.mean_std},
        "constancy": {"chi2": found.chi2, "degrees": max(found.count - 1, 0), "p_value": found.constant_p},
        "slope": {
            "value": found.slope,
            "std": found.slope_std,
            "unit": f"1/{per}" if unit in ("", "1") else f"{unit}/{per}",
            "p_value": found.slope_p,
        },
        "line": {"middle": found.middle, "level": found.level, "std": found.level_std},
        "scatter": found.scatter,
        # What is said of it depends on how many parameters there are.
        "changes": False,
        "words": "",
    }


def _words(row: ParameterTrend, dated: bool) -> str:
    label = f"{row['effect']}.{row['parameter']}"
    if row["dives"] < 2:
        return f"{label}: {row['dives']} dives say something of it, too few to compare"
    mean, slope, unit = row["mean"], row["slope"], "" if row["unit"] in ("", "1") else row["unit"]
    constant = row["constancy"]["p_value"]
    told = f"{label}: mean {measured(mean['value'], mean['std'], unit)[0]} over {row['dives']} dives"
    if not row["changes"]:
        return f"{told}, the same on all ({_p(constant)})"
    line = ""
    if np.isfinite(slope["value"]):
        rises = "+" if slope["value"] > 0 else ""
        per = f"{unit} per {'day' if dated else 'dive'}".strip()
        line = f"; {rises}{measured(slope['value'], slope['std'], per)[0]} ({_p(slope['p_value'])})"
    return f"{told}, not the same on all ({_p(constant)}){line}"


def _p(value: float) -> str:
    # Below the smallest normal number the distribution's tail is lost: "p = 0" would claim more than is known.
    return f"p = {value:.2g}" if value > 1e-300 else "p < 1e-300"
