"""Commands between samples: a log that was thinned out is told from one whose commands were held."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law import answer
from auvnn.diagnosis.noise_law.answer import _held
from auvnn.diagnosis.noise_law.commands.holding import (
    AVERAGED,
    Holding,
    between,
    cubic_weights,
    holding,
)
from auvnn.models import GreyBox
from tests.small_logs import make_log, sines, small_vehicle, thinned

STEP = 5


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def asked(model, log):
    windows, layout = windows_for(model, log), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=4)
    return holding(first, windows)


def test_commands_that_change_every_tick_are_not_held(model):
    """Five ticks of a fast controller a sample: the mean command of an interval is two fifths on the way to the next."""
    log = thinned(make_log(model, duration=20.0, rate=25.0, noise=0.3, max_step=0.04), STEP)
    found = asked(model, log)
    assert found.name in ("ahead", "linear", "smooth") and found.share == pytest.approx(0.4, abs=0.11)
    assert found.odds > np.log(100.0) and found.to_dict()["between_samples"] == found.name


def test_commands_that_were_held_are_held(model):
    found = asked(model, make_log(model, duration=20.0, rate=5.0, noise=0.3))
    assert found.name == "held" and found.share == 0.0


def test_a_share_mixes_each_sample_with_the_next(model):
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    mixed, plain = between(windows, 0.25).inputs.command, windows.inputs.command
    assert torch.allclose(mixed[:, :-1], 0.75 * plain[:, :-1] + 0.25 * plain[:, 1:])
    assert torch.equal(mixed[:, -1], plain[:, -1]) and between(windows, 0.0) is windows


def test_the_cubic_through_four_samples_has_the_mean_of_any_cubic():
    """By the closed form of the integral of a power; over the interval itself -1, 13, 13, -1 over 24."""
    assert np.allclose(cubic_weights(0.5), np.array([-1.0, 13.0, 13.0, -1.0]) / 24.0)
    at = np.array([-1.0, 0.0, 1.0, 2.0])
    for share in (0.0, 0.3, 0.41, 1.0):
        for power in range(4):
            low, high = share - 0.5, share + 0.5
            mean = (high ** (power + 1) - low ** (power + 1)) / (power + 1)
            assert np.dot(cubic_weights(share), at**power) == pytest.approx(mean, abs=1e-12)


def test_a_smooth_command_is_the_mean_of_its_cubic(model):
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    mixed, plain = between(windows, 0.5, smooth=True).inputs.command, windows.inputs.command
    own = (-plain[:, :-3] + 13.0 * plain[:, 1:-2] + 13.0 * plain[:, 2:-1] - plain[:, 3:]) / 24.0
    assert torch.allclose(mixed[:, 1:-2], own)


def test_a_fit_that_grows_without_bound_is_passed_over(model):
    """Its squared error may have been the smallest while it was fitted: the next best says how commands go."""
    log = make_log(model, duration=12.0, rate=5.0, noise=0.3)
    windows, layout = windows_for(model, log), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=2)
    none = replace(first.fitted.statistics, channel=0.0 * first.fitted.statistics.channel)
    wild = replace(first, fitted=replace(first.fitted, initial=1e160 * first.fitted.initial, statistics=none))
    with pytest.raises(np.linalg.LinAlgError, match="without bound"):
        holding(wild, windows)

    def found(first, *tried):
        state: Any = SimpleNamespace(
            first=first, tried=list(tried), current=wild, refuted=None, windows=windows, chosen=()
        )
        return _held(state)

    assert found(first, wild) == (first, holding(first, windows))
    assert found(wild)[1].name == "held"


def test_commands_with_the_noise_of_a_fast_controller_are_averaged(model):
    """Each sample has noise that lasts a fifth of its interval: the mean of the samples about it is nearer the truth."""
    random, t = np.random.default_rng(4), np.arange(40 * 25 + 1) / 25
    slow = np.stack([0.2 * sines(t, 8, k, high=0.2) for k in range(2)])
    noisy = slow + 0.5 * random.normal(size=slow.shape)
    found = asked(
        model,
        thinned(make_log(model, command=noisy, duration=40.0, rate=25.0, noise=0.3, max_step=0.04), STEP),
    )
    assert found.name == "averaged" and found.samples >= 4 and found.to_dict()["samples"] == found.samples
    held = asked(model, make_log(model, command=noisy[:, ::STEP], duration=40.0, rate=5.0, noise=0.3))
    assert held.name == "held"


def test_an_average_has_binomial_weights(model):
    """One and three and three and one eighths; a command that changes its sign with each sample vanishes in it."""
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    plain = windows.inputs.command
    own = (plain[:, :-3] + 3.0 * plain[:, 1:-2] + 3.0 * plain[:, 2:-1] + plain[:, 3:]) / 8.0
    assert torch.allclose(between(windows, 0.5, samples=4).inputs.command[:, 1:-2], own)
    sign = torch.as_tensor((-1.0) ** np.arange(plain.shape[1]))[None, :, None].expand_as(plain)
    turned = replace(windows, inputs=replace(windows.inputs, command=sign))
    for samples in AVERAGED:
        mean = between(turned, 0.5, samples=samples).inputs.command
        assert mean[:, samples // 2 : -samples // 2].abs().max() < 1e-12


@pytest.mark.parametrize(("explains", "name"), [(0.0, "held"), (1.0, "law")])
def test_names_stand_against_another_law_only_if_they_explain_more(model, monkeypatch, explains, name):
    """Names with which commands seem held, though without them they do not: what explains more decides."""
    log = thinned(make_log(model, duration=20.0, rate=25.0, noise=0.3, max_step=0.04), STEP)
    windows, layout = windows_for(model, log), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=4)
    less = replace(first.fitted.statistics, channel=0.9 * first.fitted.statistics.channel)
    named = replace(first, effects=("lag",), fitted=replace(first.fitted, statistics=less))
    held = Holding("held", 0.0, 0.0, 0.0)
    monkeypatch.setattr(answer, "holding", lambda e, w: held if e is named else holding(e, w))
    cost = answer.cost_at_best
    monkeypatch.setattr(
        answer, "cost_at_best", lambda e, *more: cost(e, *more) * (explains if e is named else 1.0)
    )
    state: Any = SimpleNamespace(
        first=first, tried=(named,), refuted=None, current=named, windows=windows, chosen=("lag",)
    )
    least, law = _held(state)
    assert (law.name == "held") == (name == "held") and (least is named) == (name == "held")


@pytest.mark.parametrize(("chosen", "name"), [((), "averaged"), (("lag",), "held")])
def test_noisy_commands_count_where_no_name_stands(model, monkeypatch, chosen, name):
    """By what was tried commands seem held, for it has taken up their noise; the fit without any name says averaged."""
    log = make_log(model, duration=12.0, rate=5.0, noise=0.3)
    windows, layout = windows_for(model, log), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=2)
    less = replace(first.fitted.statistics, channel=0.5 * first.fitted.statistics.channel)
    tried = replace(first, effects=("lag",), fitted=replace(first.fitted, statistics=less))
    held, averaged = Holding("held", 0.0, 0.0, 0.0), Holding("averaged", 0.5, 9.0, 9.0, 4)
    monkeypatch.setattr(answer, "holding", lambda e, w: held if e is tried else averaged)
    monkeypatch.setattr(answer, "cost_at_best", lambda e, *more: float(e is first))
    state: Any = SimpleNamespace(
        first=first, tried=(tried,), refuted=None, current=first, windows=windows, chosen=chosen
    )
    least, law = _held(state)
    assert law.name == name and least is tried
