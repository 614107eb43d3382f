"""`adapt`: the adapter over a log, as if the samples came in while the vehicle moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from auvnn.answer_types import AdaptationHistory, ChangeEntry, FrozenErrors, SkippedSamples
from auvnn.answers import Answer, plain
from auvnn.damping.bank import Description
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Run
from auvnn.models import GreyBox
from auvnn.models.load_arguments import GivenLog, GivenModel, as_log, as_model
from auvnn.online.adapter import Adapter
from auvnn.online.frozen import frozen_errors
from auvnn.online.guards import REASONS, Guards
from auvnn.online.update import Update
from auvnn.progress import Progress
from auvnn.threads import on_one_thread

Array = NDArray[np.float64]

ACCELERATIONS = ("du", "dv", "dw", "dp", "dq", "dr")
UNITS = ("m_s2",) * 3 + ("rad_s2",) * 3
VELOCITIES = ("u", "v", "w", "p", "q", "r")
VELOCITY_UNITS = ("m_s",) * 3 + ("rad_s",) * 3
# Windows with frozen weights, s: how long, and how often one begins.
HORIZON, EVERY = 5.0, 1.0
# Rows of the time histories that the answer carries, over all runs.
ROWS = 400


@dataclass(repr=False)
class Adaptation(Answer):
    """How an adaptation went; `to_dict` is `adaptation.json` of the public contract."""

    kind = "adaptation"
    name: str
    log: str
    scheme: dict[str, Any]
    guards: dict[str, Any]
    metrics: dict[str, Any]
    skipped: dict[str, SkippedSamples]
    changes: list[ChangeEntry]
    history: list[AdaptationHistory]
    frozen: list[FrozenErrors]
    compared: str
    model: GreyBox
    adapter: Adapter
    assumed: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = (
            "log", "scheme", "guards", "compared", "metrics", "skipped", "changes", "history", "frozen",
            "assumed", "warnings",
        )  # fmt: skip
        return plain(
            {"schema": "auvnn/adaptation/1", "model": self.name, **{n: getattr(self, n) for n in names}}
        )


@on_one_thread
def adapt(
    model: GivenModel,
    log: GivenLog,
    scheme: str | Mapping[str, Any] = "rls",
    *,
    guards: Guards | str | Mapping[str, Any] | None = "full",
    damping: Description = "polynomial",
    state: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Adaptation:
    """Adapt the damping subnetworks of a model over a log, sample by sample.

    Args:
        model: not changed. One without damping subnetworks gets some.
        log: its runs are taken one after the other, the weights go on.
        scheme: of adaptation, or its options with `scheme`.
        guards: "full", "none", or numbers by name.
        damping: form of the subnetworks for a model that has none.
        state: folder for the adapter's state at the end, from which `Adapter.restore` goes on.
        progress: called with the state of the work, in words, after each run.

    Raises:
        ConfigError: an unknown scheme, guard or option.
        InputError: the log is driven otherwise than the model.

    Example:
        ```python
        model = auvnn.load("rov95")
        log = auvnn.simulate(model, noise="realistic", hidden={"payload": None}, runs=1).log
        found = auvnn.adapt(model, log, "rls")
        found.changes  # what kind of change was seen, and when
        ```
    """
    log = as_log(log)
    model = as_model(model, log)
    log.refuse_unmeasured()
    if model.vehicle.reduced or model.vehicle.glides:
        raise InputError(
            f"{model.vehicle.name} is a reduced model: adaptation takes all six degrees of freedom"
        )
    if log.kind != model.actuation:
        raise InputError(
            f"{log.name} is driven by {log.kind}, the model by {model.actuation}: load the model with "
            f"actuation='{log.kind}'"
        )
    adapter = Adapter(model, scheme, guards=guards, damping=damping)
    started = adapter.snapshot()
    changes: list[ChangeEntry] = []
    updates: list[list[Update]] = []
    history, frozen, warnings = [], [], []
    each = max(1, -(-log.samples // ROWS))
    for number, run in enumerate(log.runs):
        if number:
            adapter.new_run()
        seen = len(adapter.changes)
        own, rows, snapshots, moved = _through(adapter, run, started)
        updates.append(own)
        changes += [c.entry(run.number) for c in adapter.changes[seen:]]
        history.append(_history(run, own, moved, each))
        frozen.append(_frozen(adapter, run, rows, snapshots, started, warnings))
        if progress is not None:
            done = sum(u.adapted for u in own)
            words = f"run {run.number}: {run.samples} samples, {done} learned from"
            progress(Progress(words, sum(r.samples for r in log.runs[: number + 1]), log.samples))
    if state is not None:
        adapter.save(state)
    every = [u for own in updates for u in own]
    compared = "increments of velocity over each sample, measured and of the model alike"
    if all(run.nu_dot is not None for run in log.runs):
        compared = "measured accelerations"
    counts = adapter.counts
    skipped: dict[str, SkippedSamples] = {
        name: {"count": counts.skipped[name], "words": REASONS[name]}
        for name in REASONS
        if counts.skipped[name]
    }
    assumed = []
    if adapter.added is not None:
        form = adapter.added if isinstance(adapter.added, str) else adapter.added.get("form", "mlp")
        assumed.append(
            f"the model had no damping subnetworks: {form} ones were added, giving nothing at first"
        )
    if not counts.adapted:
        warnings.append("nothing was learned: no sample passed the guards; the model is unchanged")
    return Adaptation(
        model.vehicle.name,
        log.name,
        {"scheme": adapter.scheme.name, **adapter.scheme.options()},
        adapter.guards.to_dict(),
        _metrics(adapter, every, frozen),
        skipped,
        changes,
        history,
        frozen,
        compared,
        adapter.model,
        adapter,
        assumed,
        warnings,
    )


def _through(
    adapter: Adapter, run: Run, started: dict[str, Tensor]
) -> tuple[list[Update], list[int], list[dict[str, Tensor]], Array]:
    """Take a run's samples one by one; return updates, snapshots about once a second, and how far weights moved."""
    if run.command is None:
        raise InputError(f"run {run.number} has no command: an adapter needs one")
    own, rows, snapshots, next_one = [], [], [], -np.inf
    moved = np.zeros(run.samples)
    for k in range(run.samples):
        if run.t[k] >= next_one:
            # The weights with which the sample's own prediction is made: nothing of what follows is in them.
            rows.append(k)
            snapshots.append(adapter.snapshot())
            next_one = run.t[k] + EVERY
        channels = {n: getattr(run, n)[k] for n in ("fins", "voltage", "altitude") if _there(run, n, k)}
        rate = run.nu_dot[k] if run.nu_dot is not None else None
        update = adapter.step(run.t[k], run.eta[k], run.nu[k], run.command[k], rate, **channels)
        own.append(update)
        moved[k] = moved[k - 1] if k else _distance(adapter.snapshot(), started)
        if update.adapted or update.reverted:
            moved[k] = _distance(adapter.snapshot(), started)
    return own, rows, snapshots, moved


def _there(run: Run, name: str, k: int) -> bool:
    """Say whether an optional channel was measured at a row: where it was not, the model does without it."""
    value = getattr(run, name)
    return value is not None and bool(np.isfinite(value[k]).all())


def _distance(now: dict[str, Tensor], started: dict[str, Tensor]) -> float:
    """Return how far the parameters have moved, relative to their size at the start."""
    size = sum(float(v.square().sum()) for v in started.values()) ** 0.5
    away = sum(float((now[n] - v).square().sum()) for n, v in started.items()) ** 0.5
    return away / size if size > 0.0 else away


def _history(run: Run, own: list[Update], moved: Array, each: int) -> AdaptationHistory:
    """Return a run's time histories: root mean squares over `each` samples, null where nothing was compared."""
    starts = range(0, run.samples, each)

    def errors(name: str) -> list[list[float | None]]:
        values = np.full((run.samples, 6), np.nan)
        for k, update in enumerate(own):
            found = getattr(update, name)
            if found is not None:
                values[k] = found.numpy()
        return [_rms(values[k : k + each]) for k in starts]

    return {
        "run": run.number,
        "t": [float(run.t[k]) for k in starts],
        "prediction_error": errors("prediction_error"),
        "unadapted_error": errors("unadapted_error"),
        "moved": [float(moved[k]) for k in starts],
        "cause": [_commonest([u.cause for u in own[k : k + each]]) for k in starts],
    }


def _rms(values: Array) -> list[float | None]:
    there: list[bool] = np.isfinite(values).any(axis=0).tolist()  # type: ignore[union-attr]
    return [
        float(np.sqrt(np.nanmean(values[:, i] ** 2))) if there[i] else None for i in range(values.shape[1])
    ]


def _commonest(causes: list[str]) -> str:
    return max(dict.fromkeys(causes), key=causes.count)


def _frozen(
    adapter: Adapter, run: Run, rows: list[int], snapshots: list[dict[str, Tensor]],
    started: dict[str, Tensor], warnings: list[str],
) -> FrozenErrors:  # fmt: skip
    """Return errors of free runs with the weights of each moment, and with those at the start."""
    told: FrozenErrors = {"run": run.number, "horizon": HORIZON, "t": [], "adapted": [], "unadapted": []}
    try:
        adapted = frozen_errors(adapter.model, run, snapshots, rows, horizon=HORIZON)
        before = frozen_errors(adapter.model, run, started, rows, horizon=HORIZON)
    except ConfigError as error:
        warnings.append(f"run {run.number}: no free runs with frozen weights ({error})")
        return told
    return {
        **told,
        "t": adapted.starts.tolist(),
        "adapted": adapted.rmse.tolist(),
        "unadapted": before.rmse.tolist(),
        "diverged": [int(adapted.diverged.sum()), int(before.diverged.sum())],
    }


def _metrics(adapter: Adapter, updates: list[Update], frozen: list[FrozenErrors]) -> dict[str, Any]:
    counts = adapter.counts
    found: dict[str, Any] = {
        "samples": counts.samples,
        "samples_learned": counts.adapted,
        "samples_skipped": counts.samples - counts.adapted,
        "steps_shortened": counts.shortened,
        "updates_reverted": counts.reverted,
        "updates_validated": counts.validated,
        "sudden_changes_believed": counts.believed,
        "proven_on_trial": counts.proven,
        "changes_seen": len(adapter.changes),
    }
    compared = [u for u in updates if u.prediction_error is not None and u.unadapted_error is not None]
    for name, when in (("prediction_error", "adapted"), ("unadapted_error", "unadapted")):
        values = np.array([getattr(u, name).numpy() for u in compared]).reshape(-1, 6)
        rms = np.sqrt((values**2).mean(0)) if len(values) else np.full(6, np.nan)
        found |= {
            f"one_step_rmse_{c}_{unit}_{when}": rms[i]
            for i, (c, unit) in enumerate(zip(ACCELERATIONS, UNITS, strict=True))
        }
    ratios = []
    windows = {
        when: np.array([r for f in frozen for r in f[when]]).reshape(-1, 6)
        for when in ("adapted", "unadapted")
    }
    found["frozen_windows"] = len(windows["adapted"])
    for i, (c, unit) in enumerate(zip(VELOCITIES, VELOCITY_UNITS, strict=True)):
        both = {w: float(np.sqrt((v[:, i] ** 2).mean())) if len(v) else np.nan for w, v in windows.items()}
        for when, value in both.items():
            found[f"frozen_5_s_rmse_{c}_{unit}_{when}"] = value
        if both["unadapted"] > 0.0:
            ratios.append(both["adapted"] / both["unadapted"])
    found["frozen_5_s_error_ratio"] = float(np.mean(ratios)) if ratios else np.nan
    return found
