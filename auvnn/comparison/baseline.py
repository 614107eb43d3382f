"""A model compared with what needs no model: a plain regression, and holding the initial velocity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from auvnn.cards import ALIKE
from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.metrics.derivative import Derivative
from auvnn.metrics.regression import Regression, baseline, worse_than
from auvnn.metrics.rollouts import NAMES, Rolled, Scale, roll, scale_of
from auvnn.models import GreyBox

# Horizons by which a model is judged, s, best first.
HORIZONS = ("5", "2", "1", "0.5", "10")


def compare_with_baseline(
    rolled: Mapping[str, Rolled], kind: str, scale: Scale, log: Log, how: Derivative, *, left_out: bool = True
) -> dict[str, Any]:
    """Return `baseline` of the answers: what the regression and persistence reach over the windows of a free run.

    Args:
        rolled: the model's free runs by horizon; 5 s is taken, or what comes nearest.
        kind: which commands drive it.
        scale: what errors are measured by.
        log: what the regression is fitted to.
        how: how accelerations are obtained.
        left_out: the free runs are over `log` itself, and the regression is cross-validated there; else they are over
            another log that it has not seen.

    Returns:
        `total`, `u` ... `r`, `diverged`, `persistence` with the same, `horizon` in s, `model` with the model's own
        errors, and `loses`: velocities in which it is worse than `baseline` and than `persistence`. Empty where no
        window was run, or a velocity has no sensor.
    """
    key = next((h for h in HORIZONS if h in rolled), None)
    # A regression of accelerations has nothing to begin from where velocities have no sensor.
    if key is None or log.estimated or rolled[key].windows.estimated:
        return {}
    try:
        found = Regression.of(log, kind, how)
    except (InputError, np.linalg.LinAlgError):
        return {}
    line = baseline(found, rolled[key], scale, left_out=left_out)
    own = {n: float(v) for n, v in zip(NAMES, rolled[key].nrmse(scale), strict=True)}
    return {
        **line,
        "horizon": key,
        "model": {"total": rolled[key].total(scale), **own},
        "loses": worse_than(own, line),
        "how": found.folds.words if left_out else f"fitted to {log.name}",
    }


def baseline_of(model: GreyBox, log: Log, how: Derivative) -> dict[str, Any]:
    """Return the same for a model as it is, over a log's windows of 5 s.

    Args:
        model: as it is.
        log: whose windows are run.
        how: how accelerations are obtained for the regression.
    """
    scale = scale_of(log)
    rolled = {h: r for h in ("5",) if (r := roll(model, log, h, scale)) is not None}
    return compare_with_baseline(rolled, model.actuation, scale, log, how)


def standing(rollout: Mapping[str, Any], line: Mapping[str, Any]) -> list[str]:
    """Return how good the model is in free running, best known first: worse than none, than a regression, or near noise.

    Args:
        rollout: of the comparison, by horizon.
        line: what `compare_with_baseline` returned.
    """
    key = next((h for h in HORIZONS if (rollout.get(h) or {}).get("total") is not None), None)
    if key is None:
        return ["no stretch was long enough, or moved enough, to let the model run free"]
    found = rollout[key]
    error, held, floor = found["total"], found.get("persistence"), found.get("noise_floor")
    out = [f"over {key} s of free running the error is {error:.3g} of the spread of the motion"]
    if held is not None and np.isfinite(held):
        out.append(f"{_than(error, held)} holding the initial velocity ({held:.3g})")
    total = line.get("total") if line.get("horizon") == key else None
    if total is not None and np.isfinite(total):
        out.append(f"{_than(error, total)} a plain regression ({total:.3g})")
    if floor is not None and np.isfinite(floor):
        ratio = error / floor if floor > 0 else np.inf
        times = f"{ratio:.2g}" if ratio < 99.5 else f"{ratio:.0f}"
        near = "about what noise alone leaves" if ratio < 1.25 else f"{times} times what noise alone leaves"
        out.append(f"{near} ({floor:.3g})")
    return out


def _than(error: float, other: float) -> str:
    """Return in a word how an error compares with another; within 5 % they are as good as each other."""
    if ALIKE * error < other:
        return "better than"
    return "no better than" if error <= ALIKE * other else "WORSE than"


def words(line: Mapping[str, Any]) -> list[str]:
    """Return in one or two sentences how the model compares with them; nothing where that is not known."""
    if not line:
        return []
    total, held = line["total"], line["persistence"]["total"]
    out = [
        f"Over {line['horizon']} s of free running the model errs by {line['model']['total']:.3g}, a plain regression by "
        f"{total:.3g}, holding the initial velocity by {held:.3g}."
    ]
    for key, what in (("baseline", "the plain regression"), ("persistence", "holding the initial velocity")):
        if line["loses"][key]:
            out.append(f"In {', '.join(line['loses'][key])} the model is worse than {what}.")
    return out
