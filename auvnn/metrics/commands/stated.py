"""Windows whose commands go between samples as the model states it."""

from __future__ import annotations

from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.commands.paths import between
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox


def as_stated(model: GreyBox, windows: Windows) -> Windows:
    """Return windows whose commands go as the model states for such an interval between samples; else as they are.

    Args:
        model: that is run.
        windows: of commands that are held.
    """
    path = model.commands
    if path is None or not path.counts_at(interval_of(windows)):
        return windows
    curves = MeanThrust.of(model)
    if curves is not None and path.interpolated == "thrust":
        curves = curves.of_thrusts()
    return between(windows, path.share_of_next, path.between_samples, samples=path.samples, curves=curves)


def interval_of(windows: Windows) -> float:
    """Return the usual interval between samples, s."""
    steps = windows.times.diff(dim=-1)
    return float(steps[steps > 0.0].median()) if bool((steps > 0.0).any()) else 0.0


def said(model: GreyBox, interval: float) -> list[str]:
    """Return in a sentence how the model has commands go in a log; nothing where it states nothing.

    Args:
        model: that is run.
        interval: between samples of the log, s.
    """
    path = model.commands
    if path is None:
        return []
    if path.counts_at(interval):
        return [f"{path.words()} The model states it"]
    return [
        f"the model states how commands go between samples of {path.interval:.3g} s; those of this log are "
        f"{interval:.3g} s apart: they are taken as held"
    ]
