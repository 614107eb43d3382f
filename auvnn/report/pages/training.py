"""The page of `train`: how the fit went, and what damping it found."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.pages import common
from auvnn.report.panels import NoData
from auvnn.report.plots.damping_curves import damping_curves
from auvnn.report.plots.history import history
from auvnn.report.view import View, name_of
from auvnn.report.words import count, finite, number, percent, plural

_LEARNED = ("learned", "force", "damping", "d")
_VELOCITY = ("nu", "velocity", "x")
_R2 = re.compile(r"held_out_r2_(\w+)_before")


class TrainingPage(Page):
    """What a training says."""

    kind = "training"

    def title(self, view: View) -> str:
        """Return the heading."""
        return "Training of the damping"

    def about(self, view: View) -> str:
        """Return model, log and scheme."""
        scheme = f", scheme {view.text('scheme')}" if view.text("scheme") else ""
        return f"{view.text('model', 'a model')} on {view.text('log', 'a log')}{scheme}"

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words."""
        train, held = _errors(view, "train"), _errors(view, "held_out")
        judged, words = (held, "held-out data") if held.size else (train, "the fitted data")
        out = _course(judged, words, _step(view), _numbers(view, judged.size)) if judged.size else []
        if held.size and train.size and np.isfinite(train[-1]) and np.isfinite(held[-1]) and train[-1] > 0:
            ratio = held[-1] / train[-1]
            verdict = ": the damping generalises" if ratio < 1.3 else ", a sign of data learned by heart"
            out.append(
                f"Held out, the final error is {number(ratio, 2)} times that of the fitted data{verdict}."
            )
        gains = {k: after - before for k, (before, after) in _r2(view).items()}
        if gains:
            best = max(gains, key=lambda k: gains[k])
            before, after = _r2(view)[best]
            out.append(
                f"One step ahead on held-out data most is gained in {common.channel_words(best)}: R² from "
                f"{number(before, 2)} to {number(after, 2)}."
            )
        if view.text("stopped"):
            out.append(f"It stopped because: {view.text('stopped').rstrip('.')}.")
        return out or ["The training left no history of its error."]

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        found = view.mapping("history")
        error = str(found.get("error") or "error (dimensionless)").removesuffix(" (1)")

        def draw() -> Figure:
            train, held = _errors(view, "train"), _errors(view, "held_out")
            steps = _numbers(view, max(train.size, held.size))
            return history(train, held, steps=steps, step=_step(view), error=error)

        return [
            Plot(
                "history",
                "How the fit went",
                draw,
                "Error on the fitted and on the held-out data; the circle marks the best held-out step. "
                "Where the two part, the fit begins to learn the data by heart.",
            ),
            *_rollout_plots(view),
            *(
                learned_plots(view)
                or [Plot("damping_curves", "What damping was found", lambda: _damping(view), "")]
            ),
        ]

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        r2 = [[common.channel_words(k), number(a), number(b)] for k, (a, b) in _r2(view).items()]
        rows = [[str(k), _value(v)] for k, v in view.mapping("metrics").items()]
        return [
            HtmlTable("R² of the acceleration, one step ahead, held out", ["channel", "before", "after"], r2),
            HtmlTable("Metrics", ["name", "value"], rows),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        derivative = view.mapping("derivative")
        return [
            ("Model", view.text("model")),
            ("Log", view.text("log")),
            ("Held out", str(derivative.get("held_out") or view.text("test"))),
            ("Accelerations", common.derivative_words(derivative)),
            ("Scheme", _described(view.get("scheme"))),
            ("Damping", _described(view.get("damping"))),
            ("Seed", view.text("seed")),
        ]


def learned_plots(view: View) -> list[Plot]:
    """Return the figure of the learned damping, if the answer holds any."""
    if not len(view.get("surfaces") or ()):
        return []
    words = (
        "Force and moment opposing each velocity, the other five at zero. Only inside the shaded range has the "
        "log anything to say; outside, the curve is extrapolation."
    )
    if any(isinstance(c, Mapping) and c.get("band") is not None for c in view.get("surfaces")):
        words += (
            " The band is what the log leaves open, 95 %. True damping is zero at rest: a curve that is not stands in "
            "for another force."
        )
    return [Plot("damping_curves", "What damping was found", lambda: _damping(view), words)]


def _rollout_plots(view: View) -> list[Plot]:
    """Return the figure of the training on free running, if there was any."""
    found = view.mapping("history").get("rollout")
    if not isinstance(found, Mapping) or not found.get("held_out"):
        return []

    def draw() -> Figure:
        # The fitted windows' weights follow the errors, so only the error left out tells a course.
        held = np.asarray([np.nan if finite(v) is None else v for v in found["held_out"]], dtype=float)
        return history(np.zeros(0), held, step="look", error="error over that of the one-step fit")

    return [
        Plot(
            "rollout_history",
            "How free running went on from there",
            draw,
            f"Error of free runs over windows left out, from {found.get('start', 'the one-step fit')} on; the "
            "circle marks the weights that are kept.",
        )
    ]


def _course(errors: np.ndarray, words: str, step: str, numbers: np.ndarray) -> list[str]:
    best = int(np.nanargmin(errors))
    first, last = errors[np.isfinite(errors)][[0, -1]]
    if errors[best] < first:
        fall = percent(1 - errors[best] / first) if first > 0 else "–"
        out = [f"The error on {words} falls from {number(first)} to {number(errors[best])}, by {fall}."]
    else:
        out = [f"The training does not lower the error on {words} (it starts at {number(first)})."]
    out.append(
        f"The best of {plural(errors.size, step)} is {step} {numbers[best]:.0f}; the fit ends at "
        f"{number(last)}."
    )
    if last > 1.05 * errors[best]:
        out.append(f"After the best {step} the error on {words} rises again.")
    return out


def _step(view: View) -> str:
    return str(view.mapping("history").get("step") or "step")


def _numbers(view: View, size: int) -> np.ndarray:
    """Return the steps' own numbers, or count them from 0."""
    found = view.mapping("history").get("iteration")
    if isinstance(found, (list, tuple)) and len(found) >= size and all(finite(i) is not None for i in found):
        return np.asarray(found[:size], dtype=float)
    return np.arange(size, dtype=float)


def _value(value: Any) -> str:
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return count(value)
    return str(value) if isinstance(value, str) else number(value, 4)


def _described(value: Any) -> str:
    """Return a description in plain data as `mlp, hidden 5, ...`."""
    if not isinstance(value, Mapping):
        return name_of(value) if isinstance(value, str) else ""
    rest = [f"{k.replace('_', ' ')} {v}" for k, v in value.items() if v != name_of(value) and v is not None]
    text = ", ".join(part for part in (name_of(value), *rest) if part)
    return text if len(text) < 600 else name_of(value)


def _r2(view: View) -> dict[str, tuple[float, float]]:
    """Return R² of the held-out acceleration before and after, by channel."""
    metrics, out = view.mapping("metrics"), {}
    for key in metrics:
        match = _R2.fullmatch(str(key))
        if match:
            before, after = finite(metrics[key]), finite(metrics.get(f"held_out_r2_{match[1]}_after"))
            if before is not None and after is not None:
                out[match[1]] = (before, after)
    return out


def _errors(view: View, name: str) -> np.ndarray:
    values = view.mapping("history").get(name)
    values = [] if values is None else [np.nan if finite(v) is None else finite(v) for v in np.ravel(values)]
    array = np.asarray(values, dtype=float)
    return array if np.isfinite(array).any() else np.zeros(0)


def _damping(view: View) -> Figure:
    found = view.get("surfaces")
    if found is None or not len(found):
        raise NoData("the answer holds no damping curves")
    return damping_curves(curves(found))


def curves(surfaces: Any) -> list[dict[str, Any]]:
    """Return one curve per degree of freedom from any of the forms in which they come.

    Args:
        surfaces: a list of six mappings {nu, learned, nominal, covered: the range of nu in the data, or low
            and high}, a mapping from channel or axis to such mappings, or one mapping of tables (6, k).
    """
    if isinstance(surfaces, Mapping):
        keys = next((k for k in (common.CHANNELS, common.AXES) if any(c in surfaces for c in k)), None)
        if keys is not None:
            surfaces = [surfaces.get(key) or {} for key in keys]
        else:
            tables = {k: np.asarray(v, dtype=float) for k, v in surfaces.items() if v is not None}
            surfaces = [{k: v[i] for k, v in tables.items() if v.ndim and len(v) == 6} for i in range(6)]
    return [_curve(s) for s in surfaces]


def _curve(entry: Any) -> dict[str, Any]:
    if not isinstance(entry, Mapping):
        pair = np.asarray(entry, dtype=float)
        return {"nu": pair[0], "learned": pair[1]} if pair.ndim == 2 and len(pair) == 2 else {}
    out = {"nominal": entry.get("nominal"), "covered": entry.get("covered")}
    low, high = entry.get("low"), entry.get("high")
    if finite(low) is not None and finite(high) is not None:
        out["covered"] = (finite(low), finite(high))
    elif low is not None and high is not None:
        out |= {"low": low, "high": high}
    band = entry.get("band")
    if band is not None and len(band) == 2:
        out |= {"low": band[0], "high": band[1]}
    for key, names in (("nu", _VELOCITY), ("learned", _LEARNED)):
        value = next((entry[n] for n in names if entry.get(n) is not None), None)
        if value is not None:
            out[key] = value
    return out


PAGE = TrainingPage()
