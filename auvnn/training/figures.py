"""The figures of a training's answer: errors before and after, and how they fell."""

from __future__ import annotations

from typing import Any

import numpy as np

from auvnn.training.fit_damping import Fit

AXES = ("X", "Y", "Z", "K", "M", "N")


def metrics_of(fit: Fit, before: dict, after: dict, samples: int, held: int) -> dict[str, Any]:
    """Return `metrics` of the answer.

    Args:
        fit: what came of it.
        before: comparison before training.
        after: comparison after training.
        samples: that were fitted.
        held: samples that decided when to stop.
    """
    units = ("N", "N", "N", "N_m", "N_m", "N_m")
    found: dict[str, Any] = {
        "samples_fitted": samples,
        "samples_for_stopping": held,
        "iterations": fit.iterations,
        "seconds": fit.seconds,
    }
    for k, (axis, unit) in enumerate(zip(AXES, units, strict=True)):
        found[f"rmse_{axis}_{unit}"] = fit.rmse[k]
        found[f"relative_rmse_{axis}"] = fit.relative_rmse[k]
        if fit.held_out_rmse is not None:
            found[f"stopping_rmse_{axis}_{unit}"] = fit.held_out_rmse[k]
    for name in after:
        found[f"held_out_r2_{name}_before"] = before[name]["r2"]
        found[f"held_out_r2_{name}_after"] = after[name]["r2"]
    return found


def history_of(fit: Fit) -> dict[str, Any]:
    """Return the root mean square over the learned degrees of freedom, one number an iteration."""

    def joined(rows: list) -> list[float]:
        return [float(np.sqrt(np.nanmean(np.square(row)))) for row in rows]

    data = fit.history.to_dict()
    return {
        "iteration": data["iteration"],
        "train": joined(data["train"]),
        "held_out": joined(data["held_out"]),
        "by_axis": data,
        "step": "iteration",
        "error": "error over the target's spread (1)",
    }
