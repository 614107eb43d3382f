"""Each damping form against its equation written another way, and the promises that are its own."""

from __future__ import annotations

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from auvnn.damping.bank import DampingBank
from auvnn.damping.dissipative import Dissipative
from auvnn.damping.mlp import MLP
from auvnn.damping.polynomial import Polynomial
from auvnn.errors import ConfigError


def velocities(count=50, seed=0, size=1.0):
    return size * torch.randn(count, 6, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def shaken(form, seed=1, size=1.0):
    make = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for tensor in form.parameters():
            tensor.copy_(size * torch.randn(tensor.shape, generator=make, dtype=torch.float64))
    return form


def test_the_stacked_networks_equal_six_separate_ones():
    form, nu = shaken(MLP(range(6))), velocities()
    alone = []
    for axis in range(6):
        network = nn.Sequential(nn.Linear(12, 5), nn.Tanh(), nn.Linear(5, 1)).double()
        with torch.no_grad():
            network[0].weight.copy_(form.hidden_weight[axis])
            network[0].bias.copy_(form.hidden_bias[axis])
            network[2].weight.copy_(form.output_weight[axis][None])
            network[2].bias.copy_(form.output_bias[axis][None])
        alone.append(network(torch.cat([nu, nu.abs()], 1)))
    torch.testing.assert_close(form(nu), torch.cat(alone, 1), rtol=1e-13, atol=1e-13)


def test_the_paper_counts_426_weights():
    assert sum(tensor.numel() for tensor in MLP(range(6)).parameters()) == 426


def test_quadratic_inputs_are_those_of_quadratic_drag():
    nu = velocities(3)
    features = MLP((0,), inputs="quadratic").features(nu)
    assert torch.equal(features[:, 6:], nu.abs() * nu)


def test_zero_at_rest_is_zero_at_rest_and_otherwise_shifted():
    form = shaken(MLP((0, 3), zero_at_rest=True))
    plain = MLP((0, 3))
    state = form.state_dict() | {"output_bias": torch.zeros(2, dtype=torch.float64)}
    plain.load_state_dict(state)
    nu, rest = velocities(), torch.zeros(6, dtype=torch.float64)
    assert torch.equal(form(rest), torch.zeros(2, dtype=torch.float64))
    torch.testing.assert_close(form(nu), plain(nu) - plain(rest))
    assert float(plain(rest).detach().abs().min()) > 0.01


def test_polynomial_is_the_matrices_of_the_classical_law():
    form, nu = shaken(Polynomial(range(6))), velocities()
    law = torch.stack([form.linear @ v + form.quadratic @ (v.abs() * v) for v in nu])
    torch.testing.assert_close(form(nu), law)
    own = shaken(Polynomial((4, 1), coupled=False))
    for place, axis in enumerate((4, 1)):
        v = nu[:, axis]
        torch.testing.assert_close(
            own(nu)[:, place], own.linear[place] * v + own.quadratic[place] * v * v.abs()
        )


@pytest.mark.parametrize("coupled", [True, False])
def test_polynomial_coefficients_are_in_si_units(coupled):
    bank = DampingBank([shaken(Polynomial((axis,), coupled=coupled), seed=axis) for axis in range(6)])
    bank.input_scale.copy_(torch.tensor([0.3, 0.2, 0.4, 0.1, 0.2, 2.0]))
    bank.output_scale.copy_(torch.tensor([50.0, 20.0, 30.0, 4.0, 5.0, 6.0]))
    form, nu = bank.groups()[0], velocities()
    linear, quadratic = form.coefficients(bank.input_scale, bank.output_scale)
    assert linear.shape == quadratic.shape == (6, 6)
    torch.testing.assert_close(bank(nu), nu @ linear.T + (nu.abs() * nu) @ quadratic.T)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    size=st.sampled_from([0.1, 1.0, 10.0, 300.0]),
    speed=st.sampled_from([1e-6, 0.1, 1.0, 100.0]),
    scale=st.floats(1e-3, 1e3),
)
def test_dissipative_never_drives_on_any_axis_whatever_its_parameters(seed, size, speed, scale):
    form = shaken(Dissipative(range(6)), seed=seed, size=size)
    bank = DampingBank([form])
    bank.input_scale.copy_(torch.rand(6, generator=torch.Generator().manual_seed(seed)) + scale)
    bank.output_scale.fill_(scale)
    nu = velocities(40, seed=seed + 1, size=speed)
    assert bool((nu * bank(nu) >= 0).all())
    assert torch.equal(bank(torch.zeros(6, dtype=torch.float64)), torch.zeros(6, dtype=torch.float64))


def test_an_mlp_does_drive_somewhere_so_the_test_above_can_fail():
    nu = velocities(500)
    assert bool((nu * shaken(MLP(range(6)))(nu) < 0).any())


def test_dissipative_grows_quadratically_beyond_its_data():
    form = Dissipative((0,))
    with torch.no_grad():
        form.speed_weight[0, 0] = 2.0
    far = torch.zeros(2, 6, dtype=torch.float64)
    far[:, 0] = torch.tensor([1e3, 2e3])
    assert math.isclose(float(form(far)[1] / form(far)[0]), 4.0, rel_tol=1e-2)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: MLP((0,), hidden=0), "hidden"),
        (lambda: MLP((0,), hidden=True), "hidden"),
        (lambda: MLP((0,), inputs="cubic"), "quadratic"),
        (lambda: MLP((0,), zero_at_rest="yes"), "zero_at_rest"),
        (lambda: Polynomial((0,), coupled=1), "coupled"),
        (lambda: Dissipative((0,), hidden=2.5), "hidden"),
    ],
)
def test_options_out_of_range_are_refused(make, words):
    with pytest.raises(ConfigError, match=words):
        make()
