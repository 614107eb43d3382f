"""What windows of a run say together: each sample once, and states that go on only where the noise is white."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law import under_law
from auvnn.diagnosis.noise_law.likelihood.sums import force_sums, whole_cells
from auvnn.metrics.coloured_noise import NoiseColour
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def fitted():
    model = GreyBox(small_vehicle())
    # Two seconds, by cells of half a second; one window ends with the sample with which the next one begins.
    windows, layout = windows_for(model, make_log(model, runs=1, duration=20.0), 2.0), lay_out(model, [])
    return fit_hypothesis(layout, windows, ["quadratic_damping"], (), iterations=1), windows


def test_a_sample_that_two_windows_share_counts_once(fitted):
    first, windows = fitted
    about = replace(windows, around=torch.cat([windows.eta, windows.nu], dim=-1))
    apart, joined = (force_sums(first, w, first.fitted.sigma) for w in (windows, about))
    assert apart.states is None and joined.states is not None
    follows = joined.states.follows
    assert follows.any() and not follows.all()
    fewer = (apart.statistics.count - joined.statistics.count)[:, 6:12]
    assert fewer[follows] == pytest.approx(1.0) and fewer[~follows] == pytest.approx(0.0)
    # About the measured trajectory a window begins where the one before it ends.
    assert np.abs(joined.states.offset[follows]).max() == pytest.approx(0.0, abs=1e-12)


def test_where_the_noise_is_not_white_each_window_begins_with_a_state_of_its_own(fitted):
    first, windows = fitted
    colour = NoiseColour(np.where(np.arange(18) < 3, 0.3, 0.0))
    about = replace(windows, around=torch.cat([windows.eta, windows.nu], dim=-1), noise=colour)
    sums = force_sums(first, about, first.fitted.sigma)
    assert sums.states is not None and not sums.states.follows.any()
    assert (sums.statistics.count == force_sums(first, windows, first.fitted.sigma).statistics.count).all()


def test_sums_about_the_same_fit_are_worked_out_once_and_stay_at_home(fitted, monkeypatch):
    first, windows = fitted
    made = []

    def counted(*given):
        made.append(given[0])
        return force_sums(*given)

    monkeypatch.setattr(under_law, "force_sums", counted)
    judge = under_law.Judge(lay_out(first.fitted.model, []), windows, first.fitted.sigma, 0.5, None)
    sums = judge.sums(first)
    # Another law is no other fit; another fit is, and then other trajectories of it are.
    assert judge.sums(replace(first, under_law=first.fitted)) is sums and len(made) == 1
    about = torch.cat([windows.eta, windows.nu], dim=-1)
    again = replace(first, fitted=replace(first.fitted))
    for other in (again, replace(again, around=about)):
        assert judge.sums(other) is not sums
    assert len(made) == 3 and len(judge.last) == 1
    assert pickle.loads(pickle.dumps(judge)).last == [] and len(judge.last) == 1


def test_a_window_holds_a_whole_number_of_cells(fitted):
    _, windows = fitted
    for cell in (0.5, 0.47, 0.3, 5.0):
        found = whole_cells(windows, cell)
        assert found <= cell + 1e-9 and 2.0 / found == pytest.approx(round(2.0 / found))
    assert whole_cells(windows, 0.47) == pytest.approx(0.4)
