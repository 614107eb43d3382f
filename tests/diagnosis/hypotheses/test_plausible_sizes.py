"""The prior of how large an effect may be: normal near its null, and with a tail that data can overrule."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar
from scipy.stats import t

from auvnn.diagnosis.hypotheses.plausible_sizes import departure, heavy, sizes_of
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.score_tests.score import score_from_sums
from auvnn.models import GreyBox
from tests.small_logs import small_vehicle


@pytest.mark.parametrize("away", [0.0, 0.5, 1.7, 1.8, 3.0, 20.0, 129.0])
def test_it_is_the_normal_prior_at_the_likeliest_standard_deviation(away):
    def at(log_size):
        # A standard deviation s with the density s^-2, at least one scale: the normal density has one over s besides.
        return away**2 * np.exp(-2.0 * log_size) + 6.0 * log_size

    least = minimize_scalar(at, bounds=(0.0, 10.0), method="bounded", options={"xatol": 1e-10}).fun
    assert heavy(np.array([away, -away])) == pytest.approx(min(least, at(0.0)), abs=1e-6)


def test_it_can_be_normalised_and_falls_as_a_student_distribution():
    whole = 2.0 * quad(lambda x: float(np.exp(-0.5 * heavy(np.array([x]))[0])), 0.0, np.inf)[0]
    assert whole == pytest.approx(np.sqrt(2.0 * np.pi), rel=0.08)
    one, other = (-2.0 * t.logpdf(x, 2) for x in (1e3, 1e4))
    told = heavy(np.array([1e3, 1e4]))
    assert told[1] - told[0] == pytest.approx(other - one, rel=1e-4)


def test_what_is_stated_stays_normal_and_what_is_asked_for_has_the_tail():
    layout = lay_out(GreyBox(small_vehicle()), ["net_buoyancy", "quadratic_damping"])
    names = ["quadratic_damping", "net_buoyancy"]
    theta = np.concatenate([layout.means[n] for n in names])
    stated, asked = sizes_of(layout, names, ["net_buoyancy"]), sizes_of(layout, names, names)
    # A tenth of each coefficient was stated; asked for, the catalogue says how large it may be.
    assert stated[:6] == pytest.approx(0.1 * np.abs(layout.means["quadratic_damping"]))
    far = theta + 5.0 * stated
    by_hand = 6 * 25.0 + float(heavy(np.array([5.0]))[0])
    assert departure(layout, names, ["net_buoyancy"], far) == pytest.approx(by_hand)
    free = float(heavy((far - theta) / asked).sum())
    assert departure(layout, names, names, far) == pytest.approx(free)
    assert departure(layout, [], [], np.zeros(0)) == 0.0


def test_the_evidence_of_a_test_has_the_tail_too():
    layout = lay_out(GreyBox(small_vehicle()), ["net_buoyancy"])
    scale = float(layout.described("net_buoyancy")[0].scale)
    known, away = 1e4, 20.0
    found = score_from_sums(
        layout, "net_buoyancy", np.array([away * known / scale]), np.array([[known / scale**2]]), lambda *_: 1.0, 400
    )  # fmt: skip
    likely = float(heavy(np.array([away / np.sqrt(1.0 + 1.0 / known)]))[0])
    assert found.evidence == pytest.approx(0.5 * (away**2 * known - likely - np.log1p(known)))
