"""Effects that trained subnetworks have swallowed are found again, and honest subnetworks are not accused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.learned_drag import with_drag_only
from auvnn.effects import effect_class
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands
from auvnn.training import train
from tests.small_logs import make_log, small_vehicle

VEHICLE = small_vehicle()
TRUTH = GreyBox(VEHICLE)
BARE = GreyBox(replace(VEHICLE, linear_damping=None, quadratic_damping=None))
NAMES = ["net_buoyancy", "thruster_lag", "cg_offset"]


def trained(hidden, runs=3, duration=12.0):
    """Return the bare model with subnetworks trained on a log of the vehicle with something hidden, and the log."""
    plant = TRUTH.with_effects(hidden) if hidden else TRUTH
    log = make_log(plant, runs=runs, duration=duration, noise=1.0)
    return train(BARE, log).model, log


def check(effect, name, value, **size):
    model, log = trained({effect: {name: value}}, **size)
    found = diagnose(model, log, [*NAMES, effect], advice=False, whiteness=False)
    assert (found.verdict, found.missing) == ("named", [effect])
    p = found.candidates[0]["parameters"][name]
    assert abs(p["value"] - value) < 4 * p["std"] + 0.01 * value and p["std"] < 0.05 * value
    assert any("train the subnetworks again" in w for w in found.warnings)


def test_what_the_subnetworks_swallowed_is_named_with_its_value():
    check("net_buoyancy", "force", 6.0)


@pytest.mark.long
def test_a_current_that_they_swallowed_is_named_on_a_log_of_some_length():
    """A drift of the water looks like drag for as long as the headings are few."""
    check("ocean_current", "v_north", 0.25, runs=4, duration=40.0)


def test_honest_subnetworks_are_not_accused():
    model, log = trained(None)
    found = diagnose(model, log, NAMES, advice=False, whiteness=False)
    assert (found.verdict, found.missing) == ("adequate", [])


def test_only_drag_is_kept():
    """A law that is drag comes back as it is; a force at rest goes."""
    log = make_log(TRUTH, runs=1, duration=16.0)
    bank = DampingBank.from_description({"form": "polynomial", "coupled": True})
    generator = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for p in bank.parameters():
            p.copy_(torch.randn(p.shape, generator=generator, dtype=p.dtype))
    path = CommandPath("smooth", 0.4, 0.2)
    model, spread = with_drag_only(with_commands(GreyBox(BARE.vehicle, (), bank), path), log)
    # What the model states beside its numbers stays.
    assert model.commands == path
    nu = torch.as_tensor(log.runs[0].nu.copy())
    assert model.damping is not None and spread is not None and spread.shape == (252,) and (spread > 0).all()
    with torch.no_grad():
        torch.testing.assert_close(model.damping(nu), bank(nu), rtol=1e-3, atol=1e-3)

    class Pushed(torch.nn.Module):
        input_scale = bank.input_scale

        def __init__(self):
            super().__init__()
            self.bank = bank

        def forward(self, x):
            return self.bank(x) + 5.0

    pushed, _ = with_drag_only(GreyBox(BARE.vehicle, (), Pushed()), log)
    assert pushed.damping is not None
    assert np.abs(pushed.damping(torch.zeros(6, dtype=torch.float64)).numpy()).max() == 0.0


def test_a_model_that_has_learned_nothing_stays_as_it_is():
    log = make_log(TRUTH, runs=1, duration=8.0)
    assert with_drag_only(TRUTH, log) == (TRUTH, None)


def test_corrections_are_those_of_a_polynomial():
    kind = effect_class("learned_drag")
    values = np.random.default_rng(0).normal(size=252)
    described = kind.describe(VEHICLE, "thrusters")
    effect = kind.build(VEHICLE, "thrusters", {p.name: v for p, v in zip(described, values, strict=True)})
    nu = np.array([0.3, -0.2, 0.1, 0.4, -0.5, 0.6])
    state = torch.zeros(7, dtype=torch.float64)
    state[3] = 1.0
    rates = [
        GreyBox(VEHICLE, e)(state, torch.as_tensor(nu), torch.zeros(8, dtype=torch.float64)).detach()
        for e in ([effect], [])
    ]
    force = TRUTH.prepare().total.numpy() @ (rates[0] - rates[1]).numpy()
    rows = values.reshape(6, 42)
    expected = [
        -sum(row[j] * nu[j] for j in range(6))
        - sum(row[6 + 6 * k + j] * abs(nu[k]) * nu[j] for k in range(6) for j in range(6))
        for row in rows
    ]
    np.testing.assert_allclose(force, expected, rtol=1e-9)
    names = [p.name for p in described]
    assert (
        names[0] == "X_u"
        and names[42 + 6 + 6 * 5 + 1] == "Y_absr_v"
        and described[42 + 37].unit == "N/(rad/s)/(m/s)"
    )
