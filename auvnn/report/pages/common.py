"""What several pages say in the same words: channels, rollouts, one-step errors, excerpts of runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auvnn.report.decimate import telling_window
from auvnn.report.html import HtmlTable
from auvnn.report.panels import NoData
from auvnn.report.plots.measured_against_model import rms
from auvnn.report.style import MOTIONS, VELOCITY, WRENCH
from auvnn.report.view import View
from auvnn.report.words import count, finite, interval, listing, number, percent

CHANNELS = tuple(symbol for symbol, _ in VELOCITY)
AXES = tuple(symbol for symbol, _ in WRENCH)
PARAMETER_HEAD = ["effect", "parameter", "value ± one standard deviation", "95 % interval"]
EXCERPT = 40.0  # s
THINNED = "Long records are thinned so that the extremes of every short stretch remain."
INTERVALS = "Values with 95 % intervals; the dashed stroke marks the value at which the effect vanishes."
_MOTION = {
    **dict(zip(CHANNELS, MOTIONS, strict=True)),
    **dict(zip(AXES, MOTIONS, strict=True)),
    **{f"d{c}": motion for c, motion in zip(CHANNELS, MOTIONS, strict=True)},
}


def metric(value: Any) -> str:
    """Return one of an answer's metrics: a whole number in full, any other with four digits."""
    known = finite(value)
    return (
        count(known)
        if known is not None and known == round(known) and abs(known) < 1e15
        else number(value, 4)
    )


def channel_words(channel: Any) -> str:
    """Return `sway (v)` for a channel whose motion has a name."""
    return f"{_MOTION[channel]} ({channel})" if channel in _MOTION else str(channel)


def main_horizon(rollout: Mapping[str, Any]) -> str | None:
    """Return the horizon that a verdict is about: 5 s where it was scored, else the longest that was."""
    scored = {h: s for h in rollout if (s := _seconds(h)) is not None and total(rollout, h) is not None}
    return "5" if "5" in scored else max(scored, key=lambda h: scored[h], default=None)


def total(rollout: Mapping[str, Any], horizon: str | None, key: str = "total") -> float | None:
    """Return one number of one horizon, None where it is unknown.

    Args:
        rollout: by horizon, as the answer holds it.
        horizon: "5", "full", ..., or None.
        key: which number.
    """
    return finite((rollout.get(horizon) or {}).get(key)) if horizon is not None else None


def over_horizons(rollout: Mapping[str, Any], key: str = "total") -> dict[str, float | None]:
    """Return one number of every horizon."""
    return {horizon: total(rollout, horizon, key) for horizon in rollout}


def _seconds(horizon: str) -> float | None:
    try:
        return float(horizon)
    except ValueError:
        return None


def horizon_words(horizon: str) -> str:
    """Return `5 s`, or `whole run` for "full"."""
    return "whole run" if horizon == "full" else f"{horizon} s"


def rollout_table(rollout: Mapping[str, Any]) -> HtmlTable:
    """Return the normalised free-running error by horizon and channel."""
    rows = [
        [
            horizon_words(horizon),
            *(number(_nested(entry, channel, "nrmse")) for channel in CHANNELS),
            *(number(entry.get(key)) for key in ("total", "persistence", "noise_floor")),
            count(entry.get("diverged", 0)),
        ]
        for horizon, entry in rollout.items()
    ]
    head = ["free running", *CHANNELS, "total", "velocity held", "noise alone", "diverged windows"]
    caption = (
        "Root mean square error divided by the standard deviation of the measured channel. 1 is as bad as "
        "knowing only the mean; – marks a channel that does not move enough to be judged. Velocity held: "
        "the total if the initial velocity simply stayed. Noise alone: what a perfect model would show."
    )
    return HtmlTable("Free-running error by horizon", head, rows, caption)


def baseline_words(view: View) -> list[str]:
    """Return how the model compares with a plain regression and persistence, in one or two sentences."""
    line = view.mapping("baseline")
    loses = line.get("loses") or {}
    if finite(line.get("total")) is None:
        return []
    out = [
        "A plain regression of the acceleration, run freely over the same windows, errs by "
        f"{percent(line['total'])} of the spread."
    ]
    return out + losing_words(loses, "The model")


def losing_words(loses: Mapping[str, Any], who: str) -> list[str]:
    """Return in which channels a model predicts worse than what needs no model, a sentence for each of the two.

    Args:
        loses: channels by "baseline" and "persistence".
        who: the model, in words.
    """
    out: dict[str, list[str]] = {}
    for key, what in (("baseline", "a plain regression"), ("persistence", "holding the initial velocity")):
        channels = [str(c) for c in loses.get(key) or ()]
        if channels:
            where = (
                "all six velocities"
                if set(channels) >= {*CHANNELS}
                else listing(channel_words(c) for c in channels)
            )
            out.setdefault(where, []).append(what)
    return [f"{who} predicts worse than {listing(what)} in {where}." for where, what in out.items()]


def baseline_table(view: View) -> HtmlTable:
    """Return the errors of model, regression and persistence by channel."""
    line = view.mapping("baseline")
    rows = []
    for name, entry in (
        ("model", line.get("model")),
        ("plain regression", line),
        ("velocity held", line.get("persistence")),
    ):
        if isinstance(entry, Mapping) and finite(entry.get("total")) is not None:
            rows.append([name, *(number(entry.get(c)) for c in CHANNELS), number(entry.get("total"))])
    caption = (
        "Free-running error over the same windows. The regression has no physics: the acceleration by least squares on "
        f"velocities, their squares, commands, the direction of gravity and one ({line.get('how', 'fitted to the log')})."
    )
    return HtmlTable("Compared with what needs no model", ["", *CHANNELS, "total"], rows, caption)


def one_step_table(one_step: Mapping[str, Any]) -> HtmlTable:
    """Return the one-step error of the acceleration by channel."""
    rows = [
        [
            channel_words(name),
            f"{'m' if i < 3 else 'rad'}/s²",
            number(_nested(one_step, name, "rmse")),
            number(_nested(one_step, name, "noise_floor")),
            number(_nested(one_step, name, "r2")),
        ]
        for i, name in enumerate(f"d{c}" for c in CHANNELS)
        if name in one_step
    ]
    caption = "The error cannot fall below its noise floor; R² is 1 for a perfect prediction, 0 for the mean."
    return HtmlTable(
        "Acceleration, one step ahead",
        ["channel", "unit", "rmse", "noise floor", "R²"],
        rows,
        caption,
        words=2,
    )


def derivative_words(derivative: Mapping[str, Any]) -> str:
    """Return how accelerations were obtained, in words."""
    method, band = str(derivative.get("method") or ""), finite(derivative.get("bandwidth_hz"))
    return method + (f", bandwidth {number(band)} Hz" if band is not None else "")


def parameter_rows(fitted: Mapping[str, Any]) -> list[list[str]]:
    """Return effect, parameter, value with one standard deviation, and the 95 % interval."""
    rows = []
    for effect, members in fitted.items():
        for name, entry in members.items():
            value, std, unit = (
                finite(entry.get("value")),
                finite(entry.get("std")),
                str(entry.get("unit") or ""),
            )
            ends = "–"
            if value is not None and std is not None:
                ends = f"{_like(value - 1.96 * std, std)} to {_like(value + 1.96 * std, std)}"
            rows.append([effect, name, interval(value, std, unit), ends])
    return rows


def _like(value: float, std: float) -> str:
    """Return the end of an interval to two digits of the standard deviation, as the value beside it stands."""
    return interval(value, std).partition(" ±")[0]


def parameter_table(fitted: Mapping[str, Any]) -> HtmlTable:
    """Return the fitted parameters."""
    return HtmlTable("Fitted parameters", PARAMETER_HEAD, parameter_rows(fitted), words=2)


def parameter_words(members: Mapping[str, Any]) -> str:
    """Return `v_north 0.203 ± 0.004 m/s, v_east ...`."""
    return ", ".join(
        f"{name} {interval(entry.get('value'), entry.get('std'), str(entry.get('unit') or ''))}"
        for name, entry in members.items()
    )


def relative_errors(measured: Any, model: Any) -> np.ndarray:
    """Return rms error over the spread of the measurement, (6,), NaN where either is missing."""
    measured, model = np.asarray(measured, dtype=float), np.asarray(model, dtype=float)
    with np.errstate(all="ignore"):
        good = np.isfinite(measured)
        mean = np.where(good, measured, 0).sum(axis=0) / good.sum(axis=0)
        spread = rms(measured - mean)
        return rms(model - measured) / np.where(spread > 0, spread, np.nan)


def worst_run(series: Sequence[Mapping[str, Any]], key: str) -> int:
    """Return the index of the run in which the model called `key` errs most."""
    if not series:
        raise NoData("the answer holds no time series")
    scores = []
    for entry in series:
        errors = relative_errors(entry["measured"], entry[key])
        errors = errors[np.isfinite(errors)]
        scores.append(float(np.minimum(errors, 10.0).mean()) if errors.size else -1.0)
    return int(np.argmax(scores))


def excerpt(entry: Mapping[str, Any], key: str, length: float = EXCERPT) -> dict[str, Any]:
    """Return the `length` seconds of a run in which the model called `key` errs most.

    Args:
        entry: a run: `t`, `measured` and what models predict, arrays by name.
        key: of the model.
        length: s.
    """
    part = telling_window(entry["t"], entry["measured"], entry[key], length)
    n = np.size(entry["t"])
    return {
        k: v[part] if isinstance(v, np.ndarray) and v.ndim and len(v) == n else v for k, v in entry.items()
    }


def arrays(series: Sequence[Any]) -> list[dict[str, Any]]:
    """Return the runs of a series with their tables as arrays, without those that have no samples."""
    out = []
    for entry in series:
        entry = dict(entry) if isinstance(entry, Mapping) else dict(vars(entry))
        made: dict[str, Any] = {
            k: np.asarray(v, dtype=float) if k != "run" and v is not None else v for k, v in entry.items()
        }
        if np.size(made.get("t", ())) > 1:
            out.append(made)
    return out


def run_words(entry: Mapping[str, Any], whole: bool) -> str:
    """Return what a picture of a run is called."""
    t = np.asarray(entry["t"], dtype=float)
    name = "run" if entry.get("run") is None else f"run {entry['run']}"
    return name if whole else f"{name}, {number(t[0], 4)} to {number(t[-1], 4)} s"


def run_file(entry: Mapping[str, Any]) -> str:
    """Return the name of a whole run's picture, fit for a file."""
    safe = "".join(c if c.isascii() and c.isalnum() else "_" for c in str(entry.get("run", "")))
    return f"whole_run_{safe[:40]}"


def _nested(table: Mapping[str, Any], *keys: str) -> Any:
    value: Any = table
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value
