"""The share of the next sample's command, asked of a fit to commands between samples: against logs that were thinned."""

from __future__ import annotations

from dataclasses import replace

import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.commands.holding import holding
from auvnn.diagnosis.noise_law.commands.law import HELD, Holding
from auvnn.diagnosis.noise_law.commands.share import with_share
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle, thinned


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def first_fit(model, log):
    windows, layout = windows_for(model, log), lay_out(model, [])
    return layout, fit_hypothesis(layout, windows, list(layout.names), (), iterations=4), windows


@pytest.mark.parametrize("ticks", [5, 20])
def test_a_controller_of_so_many_ticks_a_sample_is_half_a_tick_late(model, ticks):
    """Held for a tick, its commands are late by half of one: a share of (1 - 1 / ticks) / 2."""
    log = thinned(make_log(model, duration=30.0, rate=5.0 * ticks, noise=0.1, max_step=0.04), ticks)
    layout, first, windows = first_fit(model, log)
    held = holding(first, windows)
    found = with_share(layout, first, windows, held)
    assert found.share == pytest.approx(0.5 - 0.5 / ticks, abs=0.01)
    assert found.odds >= held.odds and found.gain >= held.gain
    # From a share that is far off, and from another law, it comes to the same.
    curves = MeanThrust.of(model)
    for name, share in (("ahead", 0.2), ("linear", 0.5)):
        other = with_share(layout, first, windows, Holding(name, share, 9.0, 18.0, curves=curves))
        assert other.share == pytest.approx(found.share, abs=0.01) and other.odds > 9.0


def test_commands_that_are_held_or_averaged_are_not_asked_again(model):
    layout, first, windows = first_fit(model, make_log(model, duration=12.0, rate=5.0, noise=0.3))
    assert with_share(layout, first, windows, HELD) is HELD
    mean = replace(HELD, name="averaged", samples=4)
    assert with_share(layout, first, windows, mean) is mean


def test_a_law_that_fits_as_well_as_any_other_stays(model):
    """Commands that change once, when 0.3 of the interval is left: from there no share takes more off the error."""
    ticks = 10
    log = make_log(model, duration=30.0, rate=5.0 * ticks, noise=1.0, max_step=0.02)
    held = log.runs[0].thrusters
    assert held is not None
    command = held.copy()
    # Row k * ticks + j has the sample's command before its change, and the next one's from then on.
    for j in range(ticks):
        later = j >= 7
        command[j:-ticks:ticks] = (held[ticks::ticks] if later else held[:-ticks:ticks])[
            : len(command[j:-ticks:ticks])
        ]
    log = thinned(
        make_log(model, duration=30.0, rate=5.0 * ticks, noise=1.0, max_step=0.02, command=command), ticks
    )
    layout, first, windows = first_fit(model, log)
    found = with_share(layout, first, windows, holding(first, windows))
    assert found.name == "ahead" and found.share == pytest.approx(0.3, abs=0.02)


def test_a_controller_that_is_faster_than_the_log_is_no_lag(model):
    """Half a tick of 10 ms, where nothing else is wrong: with the commands of the interval's middle it was a lag."""
    log = thinned(make_log(model, duration=40.0, rate=100.0, noise=0.1, max_step=0.04), 20)
    found = diagnose(
        model,
        log,
        ["thruster_lag", "actuation_delay", "thrust_overshoot"],
        advice=False,
        whiteness=False,
        costs=False,
    )
    assert found.verdict == "adequate" and not found.missing
    commands = found.stochastic["commands"]
    assert commands["share_of_next"] == pytest.approx(0.475, abs=0.01)
