"""The bank: any mixture of forms, scales that only scale, and plain data that bring it back."""

from __future__ import annotations

import pytest
import torch
from torch.func import functional_call, jacfwd, jvp, vmap

from auvnn.damping.bank import DampingBank
from auvnn.damping.mlp import MLP
from auvnn.damping.zero import Zero
from auvnn.errors import ConfigError

MIXED = {
    "form": "mlp",
    "hidden": 3,
    "each": {
        "X": "dissipative",
        "K": "zero",
        "Z": "polynomial",
        "N": {"form": "polynomial", "coupled": False},
    },
}


def velocities(*shape, seed=0):
    return torch.randn(*shape, 6, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def shaken(bank, seed=3):
    make = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for tensor in bank.parameters():
            tensor.add_(0.3 * torch.randn(tensor.shape, generator=make, dtype=torch.float64))
    return bank


def test_six_networks_become_one_module():
    bank = DampingBank([MLP((axis,)) for axis in range(6)])
    assert [tuple(tensor.shape) for tensor in bank.parameters()] == [(6, 5, 12), (6, 5), (6, 5), (6,)]


def test_each_axis_gets_its_own_form_in_its_own_place():
    bank, nu = shaken(DampingBank.from_description(MIXED)), velocities(20)
    answer = bank(nu)
    for form in bank.groups():
        torch.testing.assert_close(form(nu), answer[:, list(form.axes)])
    assert [form.axes for form in bank.groups()] == [(0,), (1, 4), (2,), (3,), (5,)]
    assert torch.equal(answer[:, 3], torch.zeros(20, dtype=torch.float64))


def test_the_order_in_which_forms_are_given_does_not_matter():
    forms = [MLP((axis,)) for axis in range(6)]
    for axis, form in enumerate(forms):
        form.reset(torch.Generator().manual_seed(axis))
    nu = velocities(5)
    assert torch.equal(DampingBank(forms)(nu), DampingBank(forms[::-1])(nu))


@pytest.mark.parametrize("description", ["mlp", "polynomial", "dissipative", "zero", MIXED])
def test_description_and_state_bring_it_back(description):
    bank, nu = shaken(DampingBank.from_description(description)), velocities(9)
    bank.set_scales(velocities(30, seed=1), 40 * velocities(30, seed=2))
    fresh = DampingBank.from_description(bank.describe(), seed=99)
    fresh.load_state_dict(bank.state_dict())
    assert fresh.describe() == bank.describe()
    assert torch.equal(fresh(nu), bank(nu))


def test_options_of_a_single_axis_widen_the_common_ones():
    bank = DampingBank.from_description({"form": "mlp", "inputs": "quadratic", "each": {"Y": {"hidden": 9}}})
    by_axis = {axis: form for form in bank.groups() for axis in form.axes}
    assert by_axis[1].options() == {"hidden": 9, "inputs": "quadratic", "zero_at_rest": False}


def test_scales_are_those_of_the_data_and_ones_where_nothing_moves():
    bank, nu, force = DampingBank.from_description("mlp"), velocities(100), 50 * velocities(100, seed=4)
    nu[:, 3], force[:, 2] = 0.0, 0.0
    bank.set_scales(nu, force)
    assert float(bank.input_scale[3]) == float(bank.output_scale[2]) == 1.0
    torch.testing.assert_close(bank.input_scale[0], nu[:, 0].square().mean().sqrt())
    inner = bank.groups()[0](nu / bank.input_scale) * bank.output_scale
    torch.testing.assert_close(bank(nu), inner)


def test_the_same_seed_gives_the_same_bank_and_another_another():
    nu = velocities(3)
    first, again, other = (DampingBank.from_description("mlp", seed)(nu) for seed in (1, 1, 2))
    assert torch.equal(first, again) and not torch.equal(first, other)


def test_building_a_bank_leaves_the_global_random_numbers_alone():
    torch.manual_seed(5)
    before = torch.get_rng_state()
    DampingBank.from_description(MIXED, seed=8)
    assert torch.equal(torch.get_rng_state(), before)


def test_it_works_under_vmap_jvp_and_functional_call():
    bank, nu = shaken(DampingBank.from_description(MIXED)), velocities(6)
    exact = torch.stack([torch.autograd.functional.jacobian(bank, one) for one in nu])
    torch.testing.assert_close(vmap(jacfwd(bank))(nu), exact)
    tangent = velocities(6, seed=7)
    torch.testing.assert_close(jvp(bank, (nu,), (tangent,))[1], (exact @ tangent[..., None])[..., 0])
    doubled = {name: 2 * value for name, value in bank.state_dict().items() if name == "output_scale"}
    torch.testing.assert_close(functional_call(bank, doubled, (nu,)), 2 * bank(nu))


def test_gradients_at_rest_are_finite():
    bank = shaken(DampingBank.from_description(MIXED))
    rest = torch.zeros(6, dtype=torch.float64, requires_grad=True)
    bank(rest).sum().backward()
    assert all(bool(torch.isfinite(t.grad).all()) for t in [rest, *bank.parameters()] if t.grad is not None)


@pytest.mark.parametrize(
    ("description", "words"),
    [
        ("mpl", "Did you mean 'mlp'"),
        ({"form": "mlp", "hiden": 5}, "Did you mean 'hidden'"),
        ({"form": "zero", "hidden": 5}, "takes no options"),
        ({"form": "mlp", "each": {"U": "zero"}}, "no axis called 'U'"),
        ({"form": "mlp", "each": ["zero"]}, "each"),
        ({"form": "mlp", "each": {"K": 3}}, "axis K"),
        ({"form": ["mlp"]}, "give a name"),
        ({"form": "os:system"}, "no damping form called"),
        ({"form": "builtins.eval"}, "no damping form called"),
        ({"form": "mlp", "_target_": "os.system"}, "no option"),
    ],
)
def test_descriptions_that_cannot_be_used_are_refused(description, words):
    with pytest.raises(ConfigError, match=words):
        DampingBank.from_description(description)


@pytest.mark.parametrize("axes", [(0, 1, 2, 3, 4), (0, 1, 2, 3, 4, 4), ()])
def test_forms_that_do_not_cover_the_six_axes_once_are_refused(axes):
    with pytest.raises(ConfigError, match="each of X Y Z K M N once"):
        DampingBank([Zero((axis,)) for axis in axes])
