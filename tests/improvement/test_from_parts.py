"""Fits of large effects that end in a wrong minimum over whole windows are begun from parts of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.cross_validation.fitters import ByWindows
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.estimation.priors import set_parameters
from auvnn.improvement import fits, from_parts
from auvnn.improvement.from_parts import better_from_parts, missed
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

NAME, FORCE = "net_buoyancy", 8.0


@pytest.fixture(scope="module")
def case():
    model = GreyBox(small_vehicle())
    log = make_log(model.with_effects({NAME: {"force": FORCE}}), runs=2, duration=20.0, noise=1.0)
    layout, fitter = lay_out(model, [NAME]), ByWindows(windows_for(model, log))
    base = [n for n in layout.names if n != NAME]
    before = fitter.fit(layout, base, (), None)
    return fitter, layout, base, fitter.fit(layout, base, [NAME], None), before


def wrong(found, layout, force):
    """Return the fit as if it had ended at another force."""
    model = layout.model.rebuilt(found.fitted.model.copied_effects())
    set_parameters(model, [NAME], np.array([force]))
    return replace(found, fitted=replace(found.fitted, model=model))


def forces(found):
    return found.fitted.model.effect(NAME).theta.item()


def test_a_fit_that_predicts_badly_gives_way(case, monkeypatch):
    fitter, layout, base, found, before = case
    monkeypatch.setattr(from_parts, "noise_share", lambda _: 0.1)
    said = []
    better = better_from_parts(fitter, layout, base, [NAME], wrong(found, layout, -20.0), before, said.append)
    assert forces(better) == pytest.approx(FORCE, rel=0.05)
    assert len(said) == 2 and "from there again" in said[0]


def test_a_fit_that_is_as_good_stays_itself(case, monkeypatch):
    fitter, layout, base, found, before = case
    monkeypatch.setattr(from_parts, "noise_share", lambda _: 0.1)
    said = []
    assert better_from_parts(fitter, layout, base, [NAME], found, before, said.append) is found
    assert not said, "the error has fallen to less than half"
    for name in ("FELL", "SMALL"):
        with monkeypatch.context() as changed:
            changed.setattr(from_parts, name, 0.0)
            assert better_from_parts(fitter, layout, base, [NAME], found, before, said.append) is found
    assert len(said) == 4


def test_where_noise_is_most_of_the_error_nothing_is_tried(case, monkeypatch):
    fitter, layout, base, found, before = case
    monkeypatch.setattr(from_parts, "noise_share", lambda _: 0.81)
    bad = wrong(found, layout, -20.0)
    assert better_from_parts(fitter, layout, base, [NAME], bad, before, lambda _: None) is bad


def test_what_is_missed_is_counted_in_the_variances_of_the_velocities(case):
    """Against the same by hand; what runs away counts as five standard deviations."""
    fitter, layout, _, found, _ = case
    windows, model = fitter.windows, found.fitted.model
    seen = from_parts.predicted(model, windows)
    there = windows.mask[..., 6:12].numpy() > 0
    there[:, 0] = False
    std = torch.stack(
        [windows.nu[..., k][windows.mask[..., 6 + k] > 0].std(unbiased=False) for k in range(6)]
    ).numpy()
    error = (windows.nu.numpy() - seen) / std
    assert missed(model, windows) == pytest.approx(float((error[there] ** 2).mean()), rel=0.01)
    assert missed(wrong(found, layout, 40.0).fitted.model, windows) > 5 * missed(model, windows)
    away = replace(windows, nu=windows.nu.clone())
    away.nu[:, 1:] += 1e6 * torch.sign(torch.randn(away.nu[:, 1:].shape, dtype=torch.float64))
    assert missed(model, away) <= from_parts.CUT**2


def test_every_fit_with_a_name_is_asked_for_a_better_one(case, monkeypatch):
    """Name after name, beside those before; the fit of the coefficients alone is not."""
    fitter, *_ = case
    asked, given_back = [], []

    def noted(fitter, layout, base, effects, found, before, say):
        asked.append((list(effects), before))
        given_back.append(replace(found, evidence=float(len(asked))))
        return given_back[-1]

    monkeypatch.setattr(fits, "better_from_parts", noted)
    model = GreyBox(small_vehicle())
    made = fits.fitted_by(fitter, model, [NAME, "constant_force"], lambda _: None)
    assert [effects for effects, _ in asked] == [[NAME], [NAME, "constant_force"]]
    assert made.fits[1] is given_back[0] and made.best is given_back[1]
    assert all(before is fit for (_, before), fit in zip(asked, made.fits, strict=False))
