"""Windows that `add` takes where no step of a fit over the usual ones leads on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from auvnn.improvement import fits
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

NAME, FORCE = "net_buoyancy", 8.0


@pytest.fixture(scope="module")
def case():
    model = GreyBox(small_vehicle())
    log = make_log(model.with_effects({NAME: {"force": FORCE}}), runs=2, duration=30.0, noise=1.0)
    return model, log


@pytest.mark.parametrize("stuck", [0, 1, 2, 3])
def test_windows_are_as_long_as_fits_settle(case, monkeypatch, stuck):
    """Where none is short enough, the usual ones stay, with what the fits over them say."""
    model, log = case
    real, asked = fits.fitted_by, []

    def fitted(fitter: Any, *rest: Any) -> Any:
        found = real(fitter, *rest)
        asked.append(0.1 * (fitter.windows.mask.shape[1] - 1))
        last = replace(found.best, fitted=replace(found.best.fitted, stuck=len(asked) <= stuck))
        return replace(found, fits=[*found.fits[:-1], last])

    monkeypatch.setattr(fits, "fitted_by", fitted)
    steps = fits.fit_steps(
        model, log, [NAME], objective="rollout", window=None, derivative=None, say=lambda _: None
    )
    whole = asked[0]
    assert asked == pytest.approx([whole, 0.5 * whole, 0.25 * whole][: min(stuck + 1, 3)], abs=0.11)
    assert bool(steps.notes) == (0 < stuck < 3)
    assert steps.final.effect(NAME).theta[0].item() == pytest.approx(FORCE, rel=0.1)
    assert steps.stuck == (stuck == 3)


def test_windows_whose_length_was_asked_for_stay(case, monkeypatch):
    model, log = case
    real, asked = fits.fitted_by, []

    def fitted(fitter: Any, *rest: Any) -> Any:
        found = real(fitter, *rest)
        asked.append(len(fitter.windows))
        last = replace(found.fits[-1], fitted=replace(found.fits[-1].fitted, stuck=True))
        return replace(found, fits=[last])

    monkeypatch.setattr(fits, "fitted_by", fitted)
    fits.fit_steps(model, log, [NAME], objective="rollout", window=3.0, derivative=None, say=lambda _: None)
    assert len(asked) == 1
