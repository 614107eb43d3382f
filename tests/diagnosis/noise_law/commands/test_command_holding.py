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
from auvnn.diagnosis.noise_law.commands.holding import AVERAGED, _best, holding
from auvnn.diagnosis.noise_law.commands.law import Holding
from auvnn.diagnosis.noise_law.commands.share import with_share
from auvnn.estimation.window_parts import split
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.commands.paths import between, cubic_at, line_at, step_at
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox, load
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


def test_a_change_in_the_middle_is_no_straight_line(model):
    """At 0.2 s and steps of 0.05 s: two parts of the sample's command and two of the next one's."""
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    plain, within = windows.inputs.command, between(windows, 0.5).inputs.within
    assert torch.equal(within[:, :-1, 1], plain[:, :-1]) and torch.equal(within[:, :-1, 2], plain[:, 1:])
    assert not torch.allclose(within, between(windows, 0.5, "linear").inputs.within)


def mean_of_power(power, low, high):
    return (high ** (power + 1) - low ** (power + 1)) / ((power + 1) * (high - low))


@pytest.mark.parametrize("part", [(0.0, 1.0), (0.25, 0.5)])
def test_the_cubic_through_four_samples_has_the_mean_of_any_cubic(part):
    """By the closed form of the integral of a power; over the interval itself -1, 13, 13, -1 over 24."""
    at = np.array([-1.0, 0.0, 1.0, 2.0])
    for share in (0.0, 0.3, 0.5, 1.0):
        moments, weights = cubic_at(share, part)
        found = np.array(weights) @ np.array(moments)
        if share == 0.5 and part == (0.0, 1.0):
            assert np.allclose(found, np.array([-1.0, 13.0, 13.0, -1.0]) / 24.0)
        for power in range(4):
            mean = mean_of_power(power, share - 0.5 + part[0], share - 0.5 + part[1])
            assert np.dot(found, at**power) == pytest.approx(mean, abs=1e-12)


def test_moments_on_the_line_have_the_mean_of_any_power_up_to_the_seventh():
    for part in ((0.0, 1.0), (0.5, 0.75)):
        moments, weights = line_at(0.5, part)
        for power in range(8):
            found = sum(w * m[1] ** power for m, w in zip(moments, weights, strict=True))
            assert found == pytest.approx(mean_of_power(power, *part), rel=1e-12)
        assert all(sum(m) == pytest.approx(1.0) for m in moments)


def test_a_command_that_changes_once_is_the_one_before_it_and_then_the_next():
    """With 0.3 of the interval left: nothing of its first half, a fifth of (0.5, 0.75), all of the last quarter."""
    for part, after in (((0.0, 0.5), 0.0), ((0.5, 0.75), 0.2), ((0.75, 1.0), 1.0), ((0.0, 1.0), 0.3)):
        moments, weights = step_at(0.3, part)
        assert moments == [(1.0, 0.0), (0.0, 1.0)] and weights == pytest.approx((1.0 - after, after))


def test_a_smooth_command_is_the_mean_of_its_cubic(model):
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    mixed, plain = between(windows, 0.5, "smooth").inputs.command, windows.inputs.command
    own = (-plain[:, :-3] + 13.0 * plain[:, 1:-2] + 13.0 * plain[:, 2:-1] - plain[:, 3:]) / 24.0
    assert torch.allclose(mixed[:, 1:-2], own)


def test_a_command_stands_for_the_mean_thrust(model):
    """Of a quadratic curve, over a straight line that does not change its sign: T = F (a^2 + a b + b^2) / 3."""
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    plain = windows.inputs.command
    found = between(windows, 0.5, "linear", curves=MeanThrust.of(model)).inputs.command[:, :-1]
    a, b = plain[:, :-1], plain[:, 1:]
    mean = torch.sign(a) * (a * a + a * b + b * b) / 3.0
    same = a * b > 0.0
    torch.testing.assert_close((found * found.abs())[same], mean[same], rtol=1e-5, atol=1e-7)
    # Through zero: -|a|^3 / 3 and b^3 / 3 over the whole rise.
    crossed = (b.abs() ** 3 - a.abs() ** 3) / (3.0 * (a.abs() + b.abs())) * torch.sign(b)
    rest = a * b < 0.0
    assert rest.any()
    # The curve bends sharply at zero: four moments are good to some percent of the largest thrust there.
    assert ((found * found.abs())[rest] - crossed[rest]).abs().max() < 0.03 * mean.abs().max()


@pytest.mark.parametrize("along", ["linear", "smooth"])
def test_a_curve_through_thrusts_has_their_mean(model, along):
    """Thrusts that go along one cubic (one line), some through zero: the mean over each interval, by its integral."""
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    places = torch.arange(windows.inputs.command.shape[1], dtype=torch.float64)
    middle = 0.5 * len(places)
    random = np.random.default_rng(3)
    powers = 4 if along == "smooth" else 2
    size = random.uniform(-1.0, 1.0, (powers, 8)) / middle ** np.arange(powers)[:, None] / powers
    share = 0.3 if along == "smooth" else 0.5

    def thrust(of):
        return sum(torch.from_numpy(size[p]) * of(p)[:, None] for p in range(powers))

    at = thrust(lambda p: (places - middle) ** p)
    command = torch.sign(at) * at.abs().sqrt()
    some = replace(windows, inputs=replace(windows.inputs, command=command.expand(len(windows), -1, -1)))
    curves = MeanThrust.of(model)
    found = between(some, share, along, curves=curves.of_thrusts()).inputs.command[0]
    begin = places - middle + share - 0.5
    mean = thrust(lambda p: ((begin + 1.0) ** (p + 1) - begin ** (p + 1)) / (p + 1))
    inside = slice(1, -2)
    torch.testing.assert_close((found * found.abs())[inside], mean[inside], rtol=0.0, atol=2e-7)
    # Through the commands themselves it is another thrust, where they bend.
    other = between(some, share, along, curves=curves).inputs.command[0]
    assert (other * other.abs() - mean)[inside].abs().max() > 1e-4


@pytest.mark.parametrize("smooth", ["thrust", "command"])
def test_a_log_says_whether_its_thrusts_or_its_commands_are_smooth(model, smooth):
    """Ten ticks a sample, sines of the thrust (of the command): with a quadratic curve only one of them is smooth."""
    t = np.arange(int(30.0 * 50.0) + 1) / 50.0
    wave = 0.35 * sines(t, 8, seed=11, low=0.2, high=0.8)
    command = np.clip(np.sign(wave) * np.sqrt(np.abs(wave)) if smooth == "thrust" else wave, -1.0, 1.0)
    log = thinned(make_log(model, duration=30.0, rate=50.0, noise=0.1, max_step=0.02, command=command), 10)
    windows, layout = windows_for(model, log), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=4)
    found = with_share(layout, first, windows, holding(first, windows))
    assert found.to_dict().get("interpolated", "command") == smooth
    assert found.name in ("linear", "smooth") and found.share == pytest.approx(0.45, abs=0.05)


def test_a_command_that_stays_and_one_of_a_wrench_are_their_own(model):
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    still = torch.full_like(windows.inputs.command, 0.37)
    held = replace(windows, inputs=replace(windows.inputs, command=still))
    curves = MeanThrust.of(model)
    assert torch.allclose(
        between(held, 0.5, "linear", curves=curves).inputs.command, still, rtol=1e-15, atol=0.0
    )
    assert MeanThrust.of(GreyBox(small_vehicle(), actuation="wrench")) is None
    # The thrust of this table is largest at 0.97: behind it one command stands for all, but for itself.
    falling = MeanThrust.of(load("bluerov2_heavy"))
    full = torch.full((1, 2, 8), 0.985, dtype=torch.float64)
    assert torch.equal(falling.command_for([full, full], (0.5, 0.5)), full)


def test_the_least_share_is_looked_for_where_a_wide_parabola_leads():
    """A cost that grows with the fourth power far from its least, at 0.12: from one half a parabola leads to 0.30."""

    def cost(share):
        return 1000.0 * ((share - 0.12) ** 2 + 3.0 * (share - 0.12) ** 4)

    ((share, least, odds),) = _best(cost, [cost(0.0), cost(0.5), cost(1.0)])
    assert share == pytest.approx(0.12, abs=0.01) and least < 1.0 and odds < 0.0


def test_each_step_of_an_interval_has_its_own_mean(model):
    """0.2 s at steps of 0.05 s, on a straight line: four parts, whose mean is that of the interval."""
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    inputs, plain = between(windows, 0.5, "linear").inputs, windows.inputs.command
    assert inputs.within.shape == (*plain.shape[:2], 4, 8)
    rise = plain[:, 1:] - plain[:, :-1]
    for k in range(4):
        own = plain[:, :-1] + (k + 0.5) / 4.0 * rise
        assert torch.allclose(inputs.within[:, :-1, k], own)
    assert torch.allclose(inputs.within.mean(-2), inputs.command)
    curves = MeanThrust.of(model)
    inputs = between(windows, 0.5, "linear", curves=curves).inputs
    thrust, parts = (model.actuators.static(x) for x in (inputs.command, inputs.within))
    # Where a command goes through zero the moments of the whole interval miss a little of the bend.
    same = (plain[:, :-1] * plain[:, 1:] > 0.0).expand_as(rise)
    torch.testing.assert_close(parts.mean(-2)[:, :-1][same], thrust[:, :-1][same], rtol=1e-4, atol=1e-4)
    assert not torch.allclose(inputs.within.mean(-2), inputs.command)


def test_windows_that_are_divided_and_picked_keep_what_is_within(model):
    windows = between(windows_for(model, make_log(model, duration=12.0, rate=5.0)), 0.5, "linear")
    assert torch.equal(windows.pick(slice(1, 2)).inputs.within, windows.inputs.within[1:2])
    assert torch.equal(windows.inputs.rows(3, 7).within, windows.inputs.within[:, 3:7])
    long = between(cut_windows(make_log(model, duration=50.0, rate=5.0), 24.0), 0.5, "linear")
    parts, _, _ = split(long, 8.0)
    assert len(parts) > len(long)
    assert parts.inputs.within.shape[:2] == parts.inputs.command.shape[:2]
    assert torch.allclose(parts.inputs.within.mean(-2), parts.inputs.command)


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
        return _held(None, state)

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
    monkeypatch.setattr(answer, "holding", lambda e, w, layout: held if e is named else holding(e, w))
    cost = answer.cost_at_best
    monkeypatch.setattr(
        answer, "cost_at_best", lambda e, *more: cost(e, *more) * (explains if e is named else 1.0)
    )
    state: Any = SimpleNamespace(
        first=first, tried=(named,), refuted=None, current=named, windows=windows, chosen=("lag",)
    )
    least, law = _held(None, state)
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
    monkeypatch.setattr(answer, "holding", lambda e, w, layout: held if e is tried else averaged)
    monkeypatch.setattr(answer, "cost_at_best", lambda e, *more: float(e is first))
    state: Any = SimpleNamespace(
        first=first, tried=(tried,), refuted=None, current=first, windows=windows, chosen=chosen
    )
    least, law = _held(None, state)
    assert law.name == name and least is tried
