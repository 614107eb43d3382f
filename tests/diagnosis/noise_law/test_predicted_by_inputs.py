"""Forces of known courses against their own linearisation, and how much of a force measured inputs predict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.likelihood.estimate_law import estimate
from auvnn.diagnosis.noise_law.likelihood.known_forces import with_known_forces
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import Likelihood
from auvnn.diagnosis.noise_law.likelihood.sums import force_sums
from auvnn.diagnosis.noise_law.predicted_by_inputs import _courses, predicted_by_inputs
from auvnn.diagnosis.residuals.input_forces import InputForces
from auvnn.effects import Body, Effect, Moment, Parameter
from auvnn.logs import Log
from auvnn.metrics.force_law import ForceLaw
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import Wander, path
from tests.small_logs import make_log, small_vehicle


class Known(Effect):
    """A force that the model does not have: of the square of one command in sway, or a steady moment in pitch."""

    name = "known"
    cause = "made up for a test"
    symbol = "f"
    reference = "none"

    def __init__(self, size: float, *, steady: bool = False) -> None:
        super().__init__((Parameter("size", "1", 0.0, 1.0, -1e3, 1e3),))
        self.steady = steady
        with torch.no_grad():
            self.theta.fill_(size)

    def wrench(self, moment: Moment, body: Body) -> torch.Tensor:
        """Return the force."""
        square = moment.command[..., :1] ** 2
        force = torch.ones_like(square) if self.steady else square - 0.05
        return self.theta[0] * force * torch.eye(6, dtype=torch.float64)[4 if self.steady else 1]


def about_the_measured(model, log, names=("quadratic_damping",)):
    """Return a fit and windows of 2 s, linear about what was measured."""
    windows, layout = windows_for(model, log, 2.0), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(names), (), iterations=3)
    around = torch.cat([windows.eta, windows.nu], dim=-1)
    return replace(first, around=around), replace(windows, around=around)


def test_a_force_of_a_known_course_is_what_its_own_linearisation_says():
    model = GreyBox(small_vehicle())
    first, windows = about_the_measured(model, make_log(model, runs=1, duration=20.0))
    response = model.prepare().inverse.detach().numpy()
    plain = force_sums(first, windows, first.fitted.sigma, 0.5, response)
    sums = with_known_forces(plain, 4, np.ones((len(windows), plain.cells, 1)), np.array([2.0]))
    # The same force, a pitching moment that stands still, as an effect of a model.
    asked = first.fitted.model.extended_by(Known(0.0, steady=True))
    names = (*first.names, "known")
    fitted = replace(
        first.fitted,
        model=asked,
        names=names,
        theta=np.append(first.fitted.theta, 0.0),
        priors=first.fitted.priors.extended_by(np.array([0.25])),
    )
    own = force_sums(replace(first, fitted=fitted, names=names), windows, first.fitted.sigma, 0.5, response)
    assert sums.known == own.known == plain.known + 1
    law = ForceLaw(
        np.array([1.0, 0, 0, 0, 0.5, 0]), np.full(6, 1.0), plain.cell, plain.span, response=response
    )
    told, expected = (Likelihood(s).by_window(law) for s in (sums, own))
    for name in ("hessian", "slope", "cost"):
        one, other = getattr(told, name), getattr(expected, name)
        assert one == pytest.approx(other, rel=1e-3, abs=1e-3 * np.abs(other).max())
    assert Likelihood(sums).of(law)[1] == pytest.approx(Likelihood(own).of(law)[1], rel=1e-2, abs=1e-4)


def wandering(size: float, rms: float, seed: int, time: float, drive: float) -> tuple[GreyBox, Log]:
    """Return a vehicle, and a log with a sway force that wanders and one that follows a command."""
    model, made = GreyBox(small_vehicle()), []
    for number in range(4):
        members = [Known(size), Wander(path(rms * np.eye(6)[1], time, 40.0, [seed, number]))]
        moved = GreyBox(model.vehicle, members, None, model.actuation)
        made += make_log(moved, runs=1, first=number, duration=40.0, noise=1.0, seed=seed, size=drive).runs
    return model, Log.from_runs(made, name=f"wandering-{seed}")


def asked(size, rms, seed, time=2.0, drive=1.0):
    model, log = wandering(size, rms, seed, time, drive)
    first, windows = about_the_measured(model, log)
    sums = force_sums(first, windows, first.fitted.sigma, 0.5)
    law = estimate(Likelihood(sums)).law
    command = np.concatenate([r.thrusters[:, 0] for r in log.runs])
    share = size**2 * (command**2).var() / (size**2 * (command**2).var() + rms**2)
    return predicted_by_inputs(first, windows, sums, law), share, law


def test_the_share_of_a_force_that_a_command_predicts_is_found():
    found, share, law = asked(25.0, 3.0, 1)
    assert law is not None and found is not None and found.matters
    assert (found.axis, found.input) == ("Y", "thruster_1")
    assert found.share == pytest.approx(share, abs=0.15) and 0.5 * share < found.least < found.share


@pytest.mark.parametrize(
    ("seed", "rms", "time", "drive"),
    [(0, 3.0, 10.0, 1.0), (1, 3.0, 10.0, 1.0), (2, 20.0, 0.7, 0.02), (3, 20.0, 0.7, 0.02)],
)
def test_a_force_of_no_input_is_not_predicted(seed, rms, time, drive):
    # A correlation time of five windows looks like some input in each of them by chance; a force of a second moves the
    # vehicle, so that the motion later in a cell tells of it.
    found, _, law = asked(0.0, rms, seed, time, drive)
    assert law is not None
    assert found is None or not found.matters


def test_of_commands_the_mean_over_a_cell_counts_and_in_closed_loop_what_they_were_before():
    model = GreyBox(small_vehicle())
    first, windows = about_the_measured(model, make_log(model, runs=1, duration=20.0))
    sums = force_sums(first, windows, first.fitted.sigma, 0.5)
    probe = InputForces(first.fitted.model, windows)
    opened, closed = (_courses(probe, first, windows, sums, answers) for answers in (False, True))
    along = probe.along(windows, windows.eta, windows.nu).numpy()
    # Ten samples per second: the second cell holds the samples 5 to 9.
    command, motion = probe.inputs["thruster_1"], probe.inputs["v"]
    assert opened[:, 1, command] == pytest.approx(along[:, 5:10, command].mean(1))
    assert closed[:, 1, command] == pytest.approx(along[:, 5, command])
    for courses in (opened, closed):
        assert courses[:, 1, motion] == pytest.approx(along[:, 5, motion])


def test_without_a_force_nothing_is_predicted():
    model = GreyBox(small_vehicle())
    first, windows = about_the_measured(model, make_log(model, runs=1, duration=20.0))
    sums = force_sums(first, windows, first.fitted.sigma)
    assert predicted_by_inputs(first, windows, sums, None) is None
