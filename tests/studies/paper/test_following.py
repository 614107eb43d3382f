"""Free runs side by side and in stretches: the same as one by one and row by row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.config import config_dir, read_yaml
from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError
from auvnn.models import GreyBox, load
from auvnn.models.structures.base import without_damping
from auvnn.simulation import simulate
from auvnn.studies.paper.following import Change, snapshot_of, tracked
from auvnn.studies.paper.options import Options
from auvnn.studies.paper.payload import _offline
from auvnn.studies.paper.plant import free_run, free_runs, load_plant

STEP = 0.1


@pytest.fixture(scope="module")
def model() -> GreyBox:
    """The known part with six networks that resist motion a little."""
    bank = DampingBank.from_description("mlp", 1)
    bank.input_scale.fill_(0.3)
    bank.output_scale.copy_(torch.tensor([60.0] * 3 + [10.0] * 3))
    return GreyBox(without_damping(load("rov95").vehicle), (), bank.requires_grad_(False), "wrench")


def made(seed: int, duration: float = 2.0, rate: float = 10.0):
    how = {"runs": 1, "duration": duration, "rate": rate, "accelerations": True, "max_step": STEP}
    return simulate(load("rov95", actuation="wrench"), "multisine", "none", None, seed, **how).log.runs[0]


def test_free_runs_side_by_side_are_those_one_by_one(model):
    runs = {"a": made(1), "short": made(2, duration=1.0), "b": made(3)}
    found = free_runs(model, runs, STEP)
    assert list(found) == list(runs)
    for name, run in runs.items():
        np.testing.assert_allclose(found[name], free_run(model, run, STEP), rtol=1e-12, atol=1e-14)


def test_weights_act_from_the_row_that_they_have_seen(model):
    """Against one step of the integrator at a time, with weights that change now and then, a change and a jump."""
    run = made(4)
    first = snapshot_of(model)
    other = {name: 2.0 * value for name, value in first.items()}
    snapshots = [first] * 5 + [other] * 7 + [first] * (run.samples - 12)
    heavier = replace(model.vehicle, mass=1.5 * model.vehicle.mass)
    change = Change(8, GreyBox(heavier, (), model.damping, "wrench"))
    jump = np.diag([0.7, 0.8, 0.9, 1.0, 1.0, 1.0])
    found = tracked(model, run, snapshots, STEP, change, jump)
    assert run.position is not None and run.wrench is not None
    eta, nu = torch.tensor(run.eta[0]), torch.tensor(run.nu[0])
    expected = [nu.numpy()]
    for k in range(run.samples - 1):
        if k == 8:
            nu = torch.tensor(jump) @ nu
            expected[-1] = nu.numpy()
        own = GreyBox(heavier if k >= 8 else model.vehicle, (), DampingBank.from_description("mlp"), "wrench")
        state = model.damping.state_dict() | snapshots[k]
        own.damping.load_state_dict(state)
        with torch.no_grad():
            rows = slice(k, k + 2)
            on = own.rollout(
                eta, nu, torch.tensor(run.wrench[rows]), torch.tensor(run.t[rows]), max_step=STEP
            )
        eta, nu = on.eta[-1], on.nu[-1]
        expected.append(nu.numpy())
    np.testing.assert_allclose(found, np.stack(expected), rtol=1e-10, atol=1e-13)


def options(model: object) -> Options:
    case = read_yaml(config_dir() / "case" / "payload.yaml")
    case["offline"]["model"] = None if model is None else str(model)
    given = {
        k: v for k, v in read_yaml(config_dir() / "study.yaml").items() if k not in ("defaults", "hydra")
    }
    return Options.read({**given, "case": case, "damping": {"form": "mlp"}, "scheme": {}, "effort": "smoke"})


def test_networks_of_a_former_study_are_taken_as_they_are(model, tmp_path):
    model.save(tmp_path / "model")
    chosen = options(tmp_path / "model")
    found, trained, warned = _offline(load_plant("rov95"), chosen, print)
    assert trained == {} and warned == []
    for name, value in snapshot_of(found).items():
        assert torch.equal(value, snapshot_of(model)[name])
    with pytest.raises(ConfigError, match="no damping subnetworks"):
        _offline(load_plant("rov95"), options("rov95"), print)
