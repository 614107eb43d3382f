"""Effects switched on and off and moved by hand: the free run follows at once, by the compiled engine."""

from __future__ import annotations

import inspect
import threading
from typing import Any

import numpy as np
import torch

from auvnn.app.logview import run_of
from auvnn.app.traces import POINTS, part, thin
from auvnn.comparison.predictions import stitch
from auvnn.effects import EFFECTS, effect_class
from auvnn.effects.acting_beside import in_words, needed_beside
from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.metrics.commands.stated import as_stated
from auvnn.metrics.rollouts import NAMES, Rolled, Scale, horizon_windows, roll_windows, scale_of
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

HORIZONS = ("5", "30", "full")
# Errors are stated at the horizon at which `add` measures its gain.
JUDGED = "5"
Effects = dict[str, dict[str, float]]


class Trial:
    """Free runs of one model over one log with effects at values of one's choice.

    Windows, and a model for each set of effects, are kept: a slider changes numbers in a model that is compiled.

    Args:
        model: as it stands.
        log: on which it runs.
    """

    def __init__(self, model: GreyBox, log: Log) -> None:
        self.model = model
        self.log = log
        self.scale: Scale = scale_of(log)
        self._lock = threading.Lock()
        self._windows: dict[str, Windows | None] = {}
        self._models: dict[tuple[str, ...], GreyBox] = {}
        self._given: dict[str, Rolled] = {}

    def run(
        self,
        effects: Effects,
        horizon: str,
        number: int | None = None,
        low: float | None = None,
        high: float | None = None,
        points: int = POINTS,
        whole: bool = True,
        judge: bool = True,
    ) -> dict[str, Any]:
        """Run the model free with these effects and no others.

        Args:
            effects: name to values by parameter; what is not stated is at its null.
            horizon: of `HORIZONS`: how long it runs before it starts again from a measured state.
            number: of the run whose traces are returned.
            low: s, begin of the traces.
            high: s, end of the traces.
            points: about how many samples to return.
            whole: also return what was measured and what the model as it stands gives, which no slider moves.
            judge: also work out the error; without it, while a slider moves, there are traces alone.

        Returns:
            `traces` of the run: `NAMES` with a trailing 1 as tried, with a trailing 0 as the model stands, and as
            measured; `error` and `given`: totals and each velocity's error at the horizon of 5 s, with persistence;
            `horizon` of these errors, and how many windows diverged.

        Raises:
            InputError: no stretch of the log is that long.
            ConfigError: an unknown effect, or a value out of bounds.
        """
        with self._lock, torch.no_grad():
            model = self._tried(effects)
            shown, given = self._rolled(model, horizon), self._as_given(horizon)
            if shown is None or given is None:
                raise InputError(
                    f"no stretch of {self.log.name} is {horizon} s long without a gap: choose a shorter one"
                )
            judged = before = None
            if judge:
                judged = shown if horizon == JUDGED else self._rolled(model, JUDGED)
                before = self._as_given(JUDGED)
        run = run_of(self.log, number)
        piece = part(run.t, low, high)
        kinds = {"1": stitch(shown, run.number, run.nu)}
        if whole:
            kinds |= {"0": stitch(given, run.number, run.nu), "": run.nu}
        series = {
            f"{name}{kind}": trace[piece, k] for kind, trace in kinds.items() for k, name in enumerate(NAMES)
        }
        traces = thin(run.t[piece], series, points)
        if not judge:
            return {"traces": traces}
        return {
            "traces": traces,
            "error": self._errors(judged or shown),
            "given": self._errors(before or given),
            "horizon": JUDGED if judged is not None else horizon,
            "diverged": int(shown.diverged.sum()),
        }

    def _errors(self, rolled: Rolled) -> dict[str, float | None]:
        each = rolled.nrmse(self.scale)
        found = {name: float(each[k]) for k, name in enumerate(NAMES)}
        found["total"] = rolled.total(self.scale)
        found["persistence"] = rolled.total(self.scale, held=True)
        return {k: v if np.isfinite(v) else None for k, v in found.items()}

    def _tried(self, effects: Effects) -> GreyBox:
        # Built again to be checked: names, bounds, and effects that exclude one another.
        vehicle, how = self.model.vehicle, self.model.actuation
        wanted = [effect_class(name).build(vehicle, how, values) for name, values in effects.items()]
        key = tuple(str(e.name) for e in wanted)
        model = self._models.get(key)
        if model is None:
            if len(self._models) >= 16:
                self._models.pop(next(iter(self._models)))
            self._models[key] = self.model.rebuilt(wanted)
            return self._models[key]
        for mine, new in zip(model.members, wanted, strict=True):
            mine.theta.data.copy_(new.theta.data)
        return model

    def _as_given(self, horizon: str) -> Rolled | None:
        if horizon not in self._given:
            rolled = self._rolled(self.model, horizon)
            if rolled is None:
                return None
            self._given[horizon] = rolled
        return self._given[horizon]

    def _rolled(self, model: GreyBox, horizon: str) -> Rolled | None:
        if horizon not in self._windows:
            windows = horizon_windows(self.log, horizon, model.actuation)
            self._windows[horizon] = None if windows is None else as_stated(self.model, windows)
        windows = self._windows[horizon]
        return None if windows is None else roll_windows(model, windows, self.scale, engine="firm")


def catalogue(model: GreyBox, log: Log) -> list[dict[str, Any]]:
    """Return every effect of the catalogue as a card shows it: cause, equation, parameters with units and bounds."""
    found = []
    there = set(log.columns) | {"phi", "theta", "psi"}
    for name in EFFECTS.names():
        kind = effect_class(name)
        sentence, equation, reference = _told(kind)
        parameters = kind.describe(model.vehicle, model.actuation)
        needed = needed_beside(name, model.effect_names)
        present = name in model.effect_names
        values = model.effect(name).values() if present else {}
        found.append(
            {
                "name": name,
                "cause": kind.cause,
                "symbol": kind.symbol,
                "sentence": sentence,
                "equation": equation,
                "reference": reference or kind.reference,
                "present": present,
                "lacks": [
                    *kind.lacks(model.vehicle, model.actuation), *(c for c in kind.channels if c not in there),
                    *([in_words(needed)] if needed else []),
                ],
                "parameters": [
                    {
                        "name": p.name, "unit": p.unit, "null": p.null, "scale": p.scale, "low": p.low, "high": p.high,
                        "shape": p.shape, "value": values.get(p.name, p.null),
                    }
                    for p in parameters
                ],
            }
        )  # fmt: skip
    return found


def _told(kind: type) -> tuple[str, str, str]:
    """Return the first sentence of an effect's docstring, the equations and what belongs to them, the reference."""
    text = inspect.getdoc(kind) or ""
    head, _, rest = text.partition("\n\n")
    body, _, reference = rest.partition("Reference:")
    return " ".join(head.split()), inspect.cleandoc(body) if body.strip() else "", " ".join(reference.split())
