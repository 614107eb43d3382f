"""The error budget: every step judged once on data that chose nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from auvnn.comparison.compare import floor_of
from auvnn.comparison.predictions import BeforeAfterTraces, stitch
from auvnn.logs import Log
from auvnn.metrics.derivative import Derivative
from auvnn.metrics.noise_floor import noise_floor
from auvnn.metrics.regression import Regression, baseline, worse_than
from auvnn.metrics.rollouts import NAMES, Rolled, rollout_table, scale_of
from auvnn.models import GreyBox

# Horizons of free running that are shown, s.
SHOWN = ("0.5", "1", "2", "5", "10")


def budget(steps: Sequence[tuple[str, str, GreyBox]], log: Log, test: Log, how: Derivative) -> dict[str, Any]:
    """Return `waterfall`, `baseline`, `before`, `after`, `loses`, `horizon` and `series` of the answer.

    Args:
        steps: what each step is called, its kind, and the model after it; the model as given first.
        log: what was fitted to: the regression is fitted to it too.
        test: what is judged on.
        how: how accelerations are obtained.
    """
    scale = scale_of(test)
    first, last = steps[0][2], steps[-1][2]
    before, rolled = rollout_table(first, test, scale, SHOWN)
    key = next((h for h in ("5", "2", "1", "0.5") if h in rolled), "full")
    after, finally_ = (before, rolled) if last is first else rollout_table(last, test, scale, SHOWN)
    errors = [before[key]["total"]]
    for _, _, model in steps[1:-1]:
        errors.append(rollout_table(model, test, scale, (key,))[0][key]["total"])
    if len(steps) > 1:
        errors.append(after[key]["total"])
    waterfall = [
        {"step": name, "kind": kind, "error": error}
        for (name, kind, _), error in zip(steps, errors, strict=True)
    ]
    for horizon, free in finally_.items():
        after[horizon]["noise_floor"] = floor_of(last, free, test, scale)
    floor = noise_floor(last, finally_[key], test, scale)
    waterfall.append({"step": "noise floor", "kind": "left", "error": floor})
    plain = Regression.of(log, first.actuation, how)
    line = baseline(plain, finally_[key], scale, left_out=False)
    mine = {n: after[key][n]["nrmse"] for n in NAMES}
    return {
        "waterfall": waterfall,
        "baseline": line,
        "before": before,
        "after": after,
        "loses": worse_than(mine, line),
        "horizon": key,
        "series": _series(test, rolled[key], finally_[key]),
    }


def _series(test: Log, before: Rolled, after: Rolled) -> list[BeforeAfterTraces]:
    return [
        {
            "run": run.number,
            "t": run.t,
            "measured": run.nu,
            "before": stitch(before, run.number, run.nu),
            "after": stitch(after, run.number, run.nu),
        }
        for run in test.runs
    ]
