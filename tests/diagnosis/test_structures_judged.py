"""Every structure of a model is compared, diagnosed and fitted as what it is: its learned part stays in it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.comparison import compare
from auvnn.diagnosis import diagnose
from auvnn.diagnosis.residuals.variance_component_test import VarianceComponents
from auvnn.improvement import add
from auvnn.models import GreyBox
from auvnn.models.structures import STRUCTURES, build_structure
from auvnn.models.structures.base import learned_parameters
from auvnn.training.fit_structure import fit_structure
from tests.small_logs import make_log, small_vehicle

OPTIONS = {"damping": ({"networks": "six"}, {"networks": "one"}), "separate": ({"restoring": "learned"},)}
EVERY = [(n, o) for n in STRUCTURES.names() for o in OPTIONS.get(n, ({},))]
IDS = [f"{n}-{'-'.join(map(str, o.values()))}" if o else n for n, o in EVERY]


def learned(name, options):
    """Return a model whose learned part gives something that is easily seen where it is lost."""
    made = build_structure(name, small_vehicle(0.1), **options)
    with torch.no_grad():
        for k, parameter in enumerate(learned_parameters(made)):
            parameter.add_(0.3 * torch.sin(torch.arange(parameter.numel()) + k).reshape(parameter.shape))
    return made


def scene():
    eta = torch.tensor([0.0, 0.0, 5.0, 0.1, -0.2, 0.3], dtype=torch.float64)
    nu = torch.tensor([0.6, -0.3, 0.2, 0.1, -0.1, 0.2], dtype=torch.float64)
    return eta, nu, torch.full((8,), 0.2, dtype=torch.float64)


@pytest.mark.parametrize(("name", "options"), EVERY, ids=IDS)
def test_its_learned_part_stays_however_it_is_built_again(name, options):
    made = learned(name, options).with_effects({"net_buoyancy": {"force": 0.0}})
    wanted = made(*scene()).detach()
    bare = GreyBox(made.vehicle)(*scene()).detach()
    if name != "known":
        assert (wanted - bare).abs().max() > 1e-3, "what is learned is seen, or this says nothing"
    ways = {
        "without what is absent": made.without_absent(),
        "rebuilt": made.rebuilt(made.copied_effects()),
        "sharing": made.sharing(made.members),
        "with a probe beside it": made.extended_by(VarianceComponents(made, 5.0)),
        "driven by a wrench and back": made.rebuilt([], actuation="wrench").rebuilt(
            [], actuation="thrusters"
        ),
    }
    for way, other in ways.items():
        assert type(other) is type(made), way
        torch.testing.assert_close(other(*scene()).detach(), wanted, rtol=1e-12, atol=1e-12, msg=way)


@pytest.mark.parametrize(("name", "options"), EVERY, ids=IDS)
def test_what_is_shared_follows_and_what_is_copied_does_not(name, options):
    made = learned(name, options)
    parts = learned_parameters(made)
    if not parts:
        return
    shared, copied = made.sharing([]), made.rebuilt([])
    before = made(*scene()).detach().clone()
    with torch.no_grad():
        for parameter in parts:
            parameter.mul_(1.5)
    assert not torch.allclose(made(*scene()), before)
    torch.testing.assert_close(shared(*scene()), made(*scene()))
    torch.testing.assert_close(copied(*scene()).detach(), before)


@pytest.fixture(scope="module")
def full_log():
    return make_log(GreyBox(small_vehicle()), runs=2, duration=30.0, accelerations=True, seed=9)


SHORT = ("damping-one",)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        pytest.param(n, o, id=i, marks=() if i in SHORT else pytest.mark.long)
        for (n, o), i in zip(EVERY, IDS, strict=True)
    ],
)
def test_it_is_compared_diagnosed_and_fitted_as_it_is(name, options, full_log):
    made = build_structure(name, small_vehicle(0.1), **options)
    if learned_parameters(made):
        fit_structure(made, full_log, restarts=1, max_iterations=20)
    truth = made.with_effects({"constant_force": {"Y": 5.0}})
    log = make_log(truth, runs=3, duration=15.0, noise=1.0, seed=2)
    given = compare(made, log, horizons=["5"]).rollout["5"]["total"]
    right = compare(truth, log, horizons=["5"]).rollout["5"]["total"]
    assert right < 0.5 * given
    found = diagnose(made, log, ["constant_force", "net_buoyancy"], advice=False, whiteness=False)
    assert found.missing == ["constant_force"], found.story
    better = add(made, log, ["constant_force"], horizons=["5"])
    assert better.accepted and type(better.model) is type(made)
    assert better.after["rollout"]["5"]["total"] == pytest.approx(right, rel=0.3)
    assert np.isclose(better.model.effect("constant_force").values()["Y"], 5.0, atol=1.0)
