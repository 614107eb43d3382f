"""The paper's structures: one interface, the right sizes, and the same answers where they must agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.errors import ConfigError, ModelError
from auvnn.logs import Log
from auvnn.models import GreyBox, load
from auvnn.models.structures import STRUCTURES, build_structure
from auvnn.models.structures.base import Structure, learned_parameters, parameter_count, without_damping
from auvnn.training.fit_structure import OneStepData, fit_structure
from tests.small_logs import make_log, small_vehicle

ALL = [
    ("known", {}), ("classical", {}), ("parallel", {}), ("separate", {}), ("damping", {}),
    ("damping", {"networks": "one"}), ("separate", {"inertia": "learned", "restoring": "learned"}),
    ("separate", {"shared": True}),
]  # fmt: skip


@pytest.fixture
def vehicle():
    return small_vehicle()


@pytest.fixture
def states():
    generator = torch.Generator().manual_seed(0)
    quaternion = torch.nn.functional.normalize(
        torch.randn(9, 4, generator=generator, dtype=torch.float64), dim=-1
    )
    eta = torch.cat([torch.zeros(9, 3, dtype=torch.float64), quaternion], -1)
    return eta, *(s * torch.randn(9, 6, generator=generator, dtype=torch.float64) for s in (0.4, 20.0))


def shaken(model: GreyBox) -> GreyBox:
    generator = torch.Generator().manual_seed(5)
    with torch.no_grad():
        for p in learned_parameters(model):
            p.add_(0.3 * torch.randn(p.shape, generator=generator, dtype=p.dtype))
    return model


def log_of(vehicle) -> Log:
    return make_log(
        GreyBox(vehicle, actuation="wrench"), runs=2, duration=15.0, rate=10.0, accelerations=True
    )


@pytest.mark.parametrize(("name", "options"), ALL)
def test_every_structure_is_called_run_saved_and_rebuilt_alike(name, options, vehicle, states, tmp_path):
    model = shaken(build_structure(name, vehicle, actuation="wrench", seed=2, **options))
    nu_dot = model(*states)
    assert nu_dot.shape == (9, 6) and bool(torch.isfinite(nu_dot).all())
    # Row by row as all at once.
    torch.testing.assert_close(torch.stack([model(*(s[i] for s in states)) for i in range(9)]), nu_dot)
    eta, nu, command = states
    times = torch.arange(4, dtype=torch.float64) * 0.1
    run = model.rollout(eta[0], 0.1 * nu[0], command[:4], times)
    assert run.nu.shape == (4, 6) and not run.diverged
    # One Euler step of the same model.
    euler = model.rollout(eta[0], 0.1 * nu[0], command[:2], times[:2], solver="euler", max_step=1.0)
    torch.testing.assert_close(euler.nu[1], 0.1 * nu[0] + 0.1 * model(eta[0], 0.1 * nu[0], command[0]))
    model.save(tmp_path / "m")
    again = load(tmp_path / "m")
    assert type(again) is type(model)
    torch.testing.assert_close(again(*states), nu_dot, rtol=0, atol=0)
    torch.testing.assert_close(model.rebuilt([])(*states), nu_dot, rtol=0, atol=0)


@pytest.mark.parametrize(
    ("name", "options", "count"),
    [
        ("known", {}, 0),
        ("classical", {}, 12),
        ("classical", {"coupled": True}, 72),
        ("damping", {}, 6 * 71),
        ("damping", {"networks": "one"}, 424),
        ("parallel", {}, 426),
        ("separate", {}, 426),
        ("separate", {"damping": "known", "inertia": "learned"}, 21),
        ("separate", {"damping": "known", "restoring": "learned"}, 6 * (3 * 5 + 5 + 5 + 1)),
    ],
)
def test_they_learn_as_many_numbers_as_they_say(name, options, count, vehicle):
    assert parameter_count(build_structure(name, vehicle, actuation="wrench", **options)) == count


def test_each_of_the_papers_networks_has_71_weights(vehicle):
    model = build_structure("damping", vehicle, actuation="wrench")
    assert sum(p[0].numel() for p in learned_parameters(model)) == 12 * 5 + 5 + 5 + 1 == 71


def test_the_known_model_is_the_equation_of_motion_without_damping(vehicle, states):
    nu = states[1]
    known = build_structure("known", vehicle, actuation="wrench")
    full = GreyBox(vehicle, actuation="wrench")
    # M (nu_dot_cpm - nu_dot_ppm) = D(nu) nu, equation 14, with D written out here.
    inertia = full.prepare().total
    found = (known(*states) - full(*states)) @ inertia.T
    linear, quadratic = torch.tensor(vehicle.linear_damping), torch.tensor(vehicle.quadratic_damping)
    torch.testing.assert_close(found, nu @ linear.T + (nu.abs() * nu) @ quadratic.T)


@pytest.mark.parametrize("name", ["classical", "parallel"])
def test_untrained_they_add_nothing(name, vehicle, states):
    known = build_structure("known", vehicle, actuation="wrench")
    model = build_structure(name, vehicle, actuation="wrench")
    torch.testing.assert_close(model(*states), known(*states), rtol=0, atol=1e-13)


def test_separate_with_everything_known_is_the_vehicle(vehicle, states):
    model = build_structure("separate", vehicle, actuation="wrench", damping="known")
    torch.testing.assert_close(model(*states), GreyBox(vehicle, actuation="wrench")(*states), rtol=0, atol=0)


def test_what_separate_learns_replaces_what_was_known(vehicle, states):
    """With the learned M^-1 at the true one and networks that say D nu + C_A nu, separate is the vehicle."""
    eta, nu, command = states
    model = build_structure("separate", vehicle, actuation="wrench", inertia="learned")
    full = GreyBox(vehicle, actuation="wrench")
    inverse = model.learned["inverse_inertia"]()
    torch.testing.assert_close(inverse, torch.linalg.inv(full.prepare().rigid))
    shaken(model)
    changed = model.learned["inverse_inertia"]()
    assert bool((torch.linalg.eigvalsh(changed) > 0).all())
    torch.testing.assert_close(changed, changed.T)
    # M nu_dot = tau - g - C_RB nu - network, each written out.
    from auvnn.models.structures.damping import velocity_features
    from auvnn.physics.attitude import quat_to_matrix
    from auvnn.physics.coriolis import coriolis_force
    from auvnn.physics.restoring import restoring_force

    prepared = full.prepare()
    body = prepared.body
    g = restoring_force(quat_to_matrix(eta[:, 3:]), body.weight, body.buoyancy, body.cg, body.cb)
    wrench = (
        command - g - coriolis_force(prepared.rigid, nu) - model.learned["velocity"](velocity_features(nu))
    )
    torch.testing.assert_close(model(*states), wrench @ changed.T)


def test_parallel_adds_an_acceleration_of_velocity_wrench_and_attitude(vehicle, states):
    from auvnn.physics.attitude import quat_to_matrix

    eta, nu, command = states
    model = shaken(build_structure("parallel", vehicle, actuation="wrench"))
    known = build_structure("known", vehicle, actuation="wrench")
    x = torch.cat([nu, nu.abs(), command, quat_to_matrix(eta[:, 3:])[:, 2]], -1)
    network = model.learned["parallel"]
    hidden = torch.tanh(x @ network.hidden_weight.T + network.hidden_bias)
    added = hidden @ network.output_weight.T + network.output_bias
    torch.testing.assert_close(model(*states), known(*states) + added)


def test_classical_recovers_the_coefficients_that_made_the_data(vehicle):
    diagonal = replace(
        vehicle, linear_damping=np.diag([25.0, 35.0, 40.0, 4.0, 5.0, 5.0]),
        quadratic_damping=np.diag([40.0, 60.0, 80.0, 4.0, 5.0, 6.0]),
    )  # fmt: skip
    model = build_structure("classical", diagonal, actuation="wrench")
    fit_structure(model, log_of(diagonal))
    (form,) = model.damping.groups()
    linear, quadratic = form.coefficients(model.damping.input_scale, model.damping.output_scale)
    np.testing.assert_allclose(linear.numpy(), diagonal.linear_damping, atol=1e-6)
    np.testing.assert_allclose(quadratic.numpy(), diagonal.quadratic_damping, atol=1e-5)


@pytest.mark.parametrize(("name", "options"), [("parallel", {"hidden": 6}), ("damping", {"networks": "one", "hidden": 8}),
                                               ("separate", {"hidden": 3})])  # fmt: skip
def test_training_lowers_the_one_step_error_of_every_network(name, options, vehicle):
    log = log_of(vehicle)
    model = build_structure(name, vehicle, actuation="wrench", **options)
    fit = fit_structure(model, log, restarts=1, max_iterations=25)
    assert max(fit.relative_rmse) < 0.25
    # What it says is what the model does.
    data = OneStepData.of(log, model)
    error = (model(torch.tensor(log.runs[0].eta), torch.tensor(log.runs[0].nu), torch.tensor(log.runs[0].wrench))
             - torch.tensor(log.runs[0].nu_dot)).detach()  # fmt: skip
    assert data.nu.shape == (fit.samples, 6)
    assert float(error.abs().max()) < 6 * max(fit.rmse) + 1e-9


def test_learned_inertia_finds_the_added_mass(vehicle):
    """With C + D and g known, M^-1 is all that is missing; it starts at the rigid body's."""
    model = build_structure("separate", vehicle, actuation="wrench", inertia="learned", damping="known")
    fit_structure(model, log_of(vehicle), restarts=1, max_iterations=60)
    truth = torch.linalg.inv(GreyBox(vehicle, actuation="wrench").prepare().total)
    found = model.learned["inverse_inertia"]().detach()
    torch.testing.assert_close(found, truth, rtol=0, atol=1e-5 * float(truth.abs().max()))


def test_unknown_names_and_options_are_told(vehicle):
    with pytest.raises(ConfigError, match="Did you mean 'parallel'"):
        build_structure("paralell", vehicle)
    with pytest.raises(ConfigError, match="'hidden'"):
        build_structure("parallel", vehicle, hiden=3)
    with pytest.raises(ConfigError, match="known or learned"):
        build_structure("separate", vehicle, inertia="maybe")
    with pytest.raises(ConfigError, match="six or one"):
        build_structure("damping", vehicle, networks="two")
    assert STRUCTURES.names() == ["known", "classical", "parallel", "separate", "damping"]


def test_a_damaged_structure_is_refused(vehicle, tmp_path):
    from auvnn.storage import read_folder, write_folder

    build_structure("parallel", vehicle, actuation="wrench").save(tmp_path / "m")
    files = read_folder(tmp_path / "m")
    text = files["model.yaml"].decode().replace("hidden: 15", "hidden: 14")
    assert text != files["model.yaml"].decode()
    write_folder(tmp_path / "bad", {**files, "model.yaml": text})
    with pytest.raises(ModelError, match="shape"):
        load(tmp_path / "bad")
    write_folder(tmp_path / "worse", {**files, "model.yaml": text.replace("name: parallel", "name: strange")})
    with pytest.raises(ModelError, match="structure"):
        load(tmp_path / "worse")


def test_without_damping_leaves_the_rest(vehicle):
    bare = without_damping(vehicle)
    assert bare.linear_damping is None and bare.mass == vehicle.mass
    assert isinstance(build_structure("parallel", vehicle), Structure)
