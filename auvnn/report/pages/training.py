"""The page of `train`: how the fit went, and what damping it found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report.html import Table
from auvnn.report.page import Page, Plot
from auvnn.report.pages import common
from auvnn.report.panels import NoData
from auvnn.report.plots.damping_curves import damping_curves
from auvnn.report.plots.history import history
from auvnn.report.view import View
from auvnn.report.words import count, finite, number, plural

_LEARNED = ("learned", "force", "damping", "d")
_VELOCITY = ("nu", "velocity", "x")


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
        out = []
        judged, words = (held, "held-out data") if held.size else (train, "the fitted data")
        if judged.size:
            best = int(np.nanargmin(judged))
            first, last = judged[np.isfinite(judged)][[0, -1]]
            if judged[best] < first:
                share = 100 * (1 - judged[best] / first) if first > 0 else 0.0
                out.append(
                    f"The error on {words} falls from {number(first)} to {number(judged[best])}, by "
                    f"{number(share, 2)} %."
                )
            else:
                out.append(
                    f"The training does not lower the error on {words} (it starts at {number(first)})."
                )
            out.append(
                f"The best of {plural(judged.size, 'step')} is step {best}; the fit ends at {number(last)}."
            )
            if last > 1.05 * judged[best]:
                out.append(
                    "After the best step the error on held-out data rises again; the best step's weights "
                    "are the ones to keep."
                )
        if held.size and train.size and np.isfinite(train[-1]) and np.isfinite(held[-1]) and train[-1] > 0:
            ratio = held[-1] / train[-1]
            verdict = ": the damping generalises" if ratio < 1.3 else ", a sign of data learned by heart"
            out.append(
                f"Held out, the final error is {number(ratio, 2)} times that of the fitted data{verdict}."
            )
        stopped = view.text("stopped") or view.text("status")
        if stopped:
            out.append(f"It stopped because: {stopped.rstrip('.')}.")
        return out or ["The training left no history of its error."]

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        found = view.mapping("history")
        step = str(found.get("step") or "step")
        error = str(found.get("error") or "error (dimensionless)")
        return [
            Plot(
                "history",
                "How the fit went",
                lambda: history(_errors(view, "train"), _errors(view, "held_out"), step=step, error=error),
                "Error on the fitted and on the held-out data; the circle marks the best held-out step. "
                "Where "
                "the two part, the fit begins to learn the data by heart.",
            ),
            Plot(
                "damping_curves",
                "What damping was found",
                lambda: _damping(view),
                "Force and moment opposing each velocity, the other five at zero. Only inside the shaded "
                "range "
                "has the log anything to say; outside, the curve is extrapolation.",
            ),
        ]

    def tables(self, view: View) -> list[Table]:
        """Return the tables."""
        rows = [[str(k), _value(v)] for k, v in view.mapping("metrics").items()]
        return [Table("Metrics", ["name", "value"], rows)]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        damping = view.get("damping")
        damping = (
            ", ".join(f"{k} {v}" for k, v in damping.items())
            if isinstance(damping, Mapping)
            else view.text("damping")
        )
        return [
            ("Model", view.text("model")),
            ("Log", view.text("log")),
            ("Held out", view.text("test")),
            ("Scheme", view.text("scheme")),
            ("Damping", damping if len(damping) < 200 else ""),
            ("Seed", view.text("seed")),
        ]


def _value(value: Any) -> str:
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return count(value)
    return str(value) if isinstance(value, str) else number(value, 4)


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
        surfaces: a list of six mappings, a mapping from channel or axis to such a mapping, or one mapping of
            tables (6, k): {nu, learned, nominal, covered (6, 2)}.
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
    out = {k: entry.get(k) for k in ("nominal", "low", "high", "covered")}
    for key, names in (("nu", _VELOCITY), ("learned", _LEARNED)):
        value = next((entry[n] for n in names if entry.get(n) is not None), None)
        if value is not None:
            out[key] = value
    return out


PAGE = TrainingPage()
