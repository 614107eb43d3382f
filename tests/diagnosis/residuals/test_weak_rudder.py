"""A fin that gives less lift than stated: what is left depends on that fin's angle, and the answer says so."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.residuals.input_forces import InputForces
from auvnn.models import GreyBox, load
from auvnn.simulation import simulate

WEAK = {"fin_1": 1.0, "fin_2": 0.6, "fin_3": 1.0, "fin_4": 0.6}


@pytest.fixture(scope="module")
def model() -> GreyBox:
    return load("remus100")


def logged(model: GreyBox, hidden, runs: int, duration: float, excitation: str = "multisine"):
    return simulate(
        model, excitation, "realistic", hidden=hidden, runs=runs, duration=duration, rate=10.0, seed=1
    ).log


def test_the_force_of_a_fin_in_the_probe_grows_with_the_square_of_the_speed(model):
    windows = windows_for(model, logged(model, None, 1, 15.0))
    probe = InputForces(model, windows)
    speed = torch.tensor([[0.5, 0.0, 0.0], [1.0, 0.3, -0.2], [2.0, 0.0, 0.4]], dtype=torch.float64)
    angle = torch.tensor([0.1, -0.2, 0.15], dtype=torch.float64)
    raw = torch.zeros(3, len(probe.kept("mean")), dtype=torch.float64)
    raw[:, :3] = speed
    raw[:, [list(probe._moving)[list(probe.inputs).index("fin_2")]]] = angle[:, None]
    given = probe.features(raw)[:, probe.inputs["fin_2"]][:, 1].numpy()
    wanted = (speed.numpy() ** 2).sum(1) * angle.numpy()
    np.testing.assert_allclose(given / given[0], wanted / wanted[0], rtol=1e-12)


@pytest.mark.long
def test_what_a_weak_rudder_leaves_is_traced_to_its_angle(model):
    log = logged(model, {"fin_gain": WEAK}, 3, 40.0, "survey")
    found = diagnose(
        model, log, ["net_buoyancy", "constant_force"], advice=False, costs=False, whiteness=False
    )
    assert found.missing == []
    told = {name for shares in found.depends_on.values() for name in shares}
    assert told & {"fin_2", "fin_4"}, found.depends_on
