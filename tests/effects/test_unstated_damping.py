"""Drag that the model does not state: where it acts, how it slows a vehicle down, and that a diagnosis finds it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import auvnn
from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.put_into_model import holding
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.effects.unstated_damping import KINDS, UnstatedDamping, _coefficients
from auvnn.errors import ConfigError
from auvnn.estimation.priors import set_parameters
from auvnn.models import GreyBox
from auvnn.plants.independent.hull import build
from auvnn.testing import plain_vehicle
from auvnn.vehicle import Vehicle
from tests.small_logs import make_log, small_vehicle

DOFS = "XYZKMN"


def names(vehicle):
    return [p.name for p in UnstatedDamping.describe(vehicle, "thrusters")]


def test_there_is_one_coefficient_for_each_that_is_not_stated():
    partly = plain_vehicle(linear_damping=[13.0, 0.0, 33.0, 0.0, 0.8, 0.0], quadratic_damping=[141.0] * 6)
    assert names(partly) == ["linear_Y", "linear_K", "linear_N"]
    assert names(plain_vehicle(quadratic_damping=[40.0] * 6)) == [f"linear_{a}" for a in DOFS]
    assert names(plain_vehicle(linear_damping=[40.0] * 6)) == [f"quadratic_{a}" for a in DOFS]
    every = [f"{kind}_{a}" for kind in ("linear", "quadratic") for a in DOFS]
    assert names(plain_vehicle()) == every
    full = plain_vehicle(linear_damping=[40.0] * 6, quadratic_damping=[40.0] * 6)
    assert names(full) == every


def test_it_is_asked_for_where_something_is_not_stated_and_only_there():
    partly = plain_vehicle(linear_damping=[13.0, 0.0, 33.0, 4.0, 0.8, 1.0], quadratic_damping=[141.0] * 6)
    assert UnstatedDamping.lacks(partly, "thrusters") == ()
    full = plain_vehicle(linear_damping=[40.0] * 6, quadratic_damping=[40.0] * 6)
    assert UnstatedDamping.lacks(full, "thrusters")
    # Displaced elements of the drag are stated drag: along their axes, and by their lever arms about others.
    element = {"position": [0.5, 0.3, 0.2], "axes": np.eye(3).tolist()}
    element |= {"linear": [5.0, 5, 5, 0, 0, 0], "quadratic": [9.0, 9, 9, 0, 0, 0]}
    assert UnstatedDamping.lacks(plain_vehicle(damping_elements=[element]), "thrusters")
    ahead = {**element, "position": [0.5, 0.0, 0.0], "linear": [5.0] + [0] * 5, "quadratic": [9.0] + [0] * 5}
    assert "linear_X" not in names(plain_vehicle(damping_elements=[ahead]))
    assert {"linear_M", "linear_N", "quadratic_N"} <= {*names(plain_vehicle(damping_elements=[ahead]))}
    central = plain_vehicle(damping_elements=[{**element, "position": [0.0, 0.0, 0.0]}])
    assert names(central) == [f"{kind}_{a}" for kind in ("linear", "quadratic") for a in "KMN"]


@pytest.mark.parametrize("speed", [0.3, -0.8])
@pytest.mark.parametrize(("dof", "inertia"), [("X", 70.0), ("Z", 90.0), ("N", 6.5)])
def test_a_vehicle_slows_down_as_linear_drag_has_it(dof, inertia, speed):
    """m dv/dt = -d v, of a vehicle whose file states no drag at all."""
    d = 12.0 if dof != "N" else 1.5
    model = GreyBox(plain_vehicle()).with_effects({"unstated_damping": {f"linear_{dof}": d}})
    place = DOFS.index(dof)
    v0 = np.zeros(6)
    v0[place] = speed
    nu = torch.tensor(v0, dtype=torch.float64)
    eta = torch.zeros(6, dtype=torch.float64)
    eta[2] = 5.0
    with torch.no_grad():
        slope = model(eta, nu, torch.zeros(6, dtype=torch.float64))
    expected = np.zeros(6)
    expected[place] = -d * speed / inertia
    np.testing.assert_allclose(slope.numpy(), expected, rtol=1e-12, atol=1e-14)


def test_quadratic_drag_resists_both_ways():
    model = GreyBox(plain_vehicle(linear_damping=[5.0] * 6)).with_effects(
        {"unstated_damping": {"quadratic_Y": 30.0}}
    )
    eta = torch.tensor([0.0, 0, 5, 0, 0, 0], dtype=torch.float64)
    for v in (0.4, -0.4):
        nu = torch.tensor([0.0, v, 0, 0, 0, 0], dtype=torch.float64)
        with torch.no_grad():
            found = model(eta, nu, torch.zeros(6, dtype=torch.float64))[1].item()
        assert found == pytest.approx(-(5.0 * v + 30.0 * v * abs(v)) / (50.0 + 30.0), rel=1e-12)


def test_plausible_sizes_follow_the_drag_that_is_stated():
    vehicle = plain_vehicle(quadratic_damping=[40.0, 80.0, 80.0, 4.0, 5.0, 6.0])
    sizes = {p.name: p.scale for p in UnstatedDamping.describe(vehicle, "thrusters")}
    # Twice the drag is twice the size, and the force at a usual speed is half of the stated one.
    speed = 0.16 * np.sqrt(9.81 * 1.0)
    assert sizes["linear_X"] * speed == pytest.approx(0.5 * 40.0 * speed**2)
    assert sizes["linear_Y"] == pytest.approx(2.0 * sizes["linear_X"])
    turn = 0.128 * np.sqrt(9.81 / 1.0)
    assert sizes["linear_N"] * turn == pytest.approx(0.5 * 6.0 * turn**2)
    # The other way round: quadratic drag that gives half of what the stated linear one does.
    stated = plain_vehicle(linear_damping=[20.0, 30.0, 30.0, 2.0, 2.0, 3.0])
    sizes = {p.name: p.scale for p in UnstatedDamping.describe(stated, "thrusters")}
    assert sizes["quadratic_Y"] * speed**2 == pytest.approx(0.5 * 30.0 * speed)
    assert sizes["quadratic_N"] * turn**2 == pytest.approx(0.5 * 3.0 * turn)
    units = {p.name: p.unit for p in UnstatedDamping.describe(plain_vehicle(), "thrusters")}
    assert (units["linear_X"], units["linear_N"]) == ("N s/m", "N m s")
    assert (units["quadratic_Z"], units["quadratic_K"]) == ("N s2/m2", "N m s2")
    assert all(p.scale > 0.0 for p in UnstatedDamping.describe(plain_vehicle(), "thrusters"))


def test_what_is_stated_is_refused_with_the_names_that_there_are():
    vehicle = plain_vehicle(linear_damping=[5.0] * 6)
    with pytest.raises(ConfigError, match="linear_X"):
        GreyBox(vehicle).with_effects({"unstated_damping": {"linear_X": 3.0}})
    with pytest.raises(ConfigError, match="out of bounds"):
        GreyBox(vehicle).with_effects({"unstated_damping": {"quadratic_X": -3.0}})


@pytest.fixture(scope="module")
def sideways():
    """A vehicle whose file has no linear damping in sway and yaw, and a log of one that has it."""
    linear = [25.0, 0.0, 40.0, 4.0, 5.0, 0.0]
    vehicle: Vehicle = small_vehicle(0.1, linear_damping=linear)
    truth = GreyBox(vehicle).with_effects({"unstated_damping": {"linear_Y": 30.0, "linear_N": 4.0}})
    return vehicle, make_log(truth, runs=3, duration=30.0, noise=1.0, seed=3)


def test_a_diagnosis_names_it_and_finds_its_size(sideways):
    vehicle, log = sideways
    asked = ["unstated_damping", "drag_curve", "linear_damping", "quadratic_damping", "thrust_inflow_loss"]
    found = diagnose(GreyBox(vehicle), log, effects=asked, advice=False)
    assert found.verdict == "named" and found.missing == ["unstated_damping"]
    values = next(c for c in found.candidates if c["effect"] == "unstated_damping")["parameters"]
    for name, truth in (("linear_Y", 30.0), ("linear_N", 4.0)):
        assert abs(values[name]["value"] - truth) < 3.0 * values[name]["std"]
        assert values[name]["std"] < 0.2 * truth


def test_it_is_added_saved_and_read_again(sideways, tmp_path):
    vehicle, log = sideways
    better = auvnn.add(GreyBox(vehicle), log, ["unstated_damping"])
    assert better.accepted
    better.model.save(tmp_path / "model")
    again = auvnn.load(tmp_path / "model")
    assert again.effect("unstated_damping").values() == better.model.effect("unstated_damping").values()
    assert again.effect("unstated_damping").values()["linear_Y"] == pytest.approx(30.0, rel=0.2)


def test_where_all_is_stated_the_table_says_why_it_was_not_asked(sideways):
    full = small_vehicle(0.1)
    log = make_log(GreyBox(full), runs=2, duration=20.0, noise=1.0, seed=8)
    found = diagnose(GreyBox(full), log, effects=["unstated_damping", "net_buoyancy"], advice=False)
    row = next(c for c in found.candidates if c["effect"] == "unstated_damping")
    assert row["needs"] == ["damping that is not stated"]


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("unstated_damping", {"linear_Y": 30.0, "linear_N": 4.0}),
        ("coupled_damping", {"Nv": 12.0}),
        ("payload", {"mass": 3.0, "x": 0.2, "time": 0.0}),
    ],
)
@pytest.mark.parametrize("effects", [(), ("linear_damping",), ("quadratic_damping", "added_mass")])
def test_factors_on_stated_coefficients_leave_alone_what_the_models_effects_add(effect, values, effects):
    """What a fit has is what the model with its values in it has: the factors are on the vehicle's own numbers."""
    vehicle = small_vehicle(0.1, linear_damping=[25.0, 0.0, 40.0, 4.0, 5.0, 0.0])
    model = GreyBox(vehicle).with_effects({effect: values})
    layout = lay_out(model, ["net_buoyancy", "drag_curve"])
    groups = ["added_mass", "linear_damping", "quadratic_damping", "inertia"]
    theta = np.linspace(0.8, 1.2, len(layout.of(groups)))
    fitted = layout.model.rebuilt(layout.model.copied_effects())
    set_parameters(fitted, groups, theta)
    told = holding(model, layout, groups, theta, effects)
    for made in (fitted, told):
        assert made.effect(effect).values() == model.effect(effect).values()
    state = torch.tensor([0.3, 0.5, -0.2, 0.1, 0.2, 0.6], dtype=torch.float64)
    eta = torch.tensor([0.0, 0, 5, 0, 0, 0], dtype=torch.float64)
    command = torch.full((8,), 0.2, dtype=torch.float64)
    with torch.no_grad():
        torch.testing.assert_close(
            fitted(eta, state, command), told(eta, state, command), rtol=1e-9, atol=1e-12
        )


def test_a_second_fit_finds_that_it_has_changed(sideways):
    """The same effect is in the model at other values, beside factors on the damping that is stated."""
    vehicle, log = sideways
    before = GreyBox(vehicle).with_effects({"unstated_damping": {"linear_Y": 20.0, "linear_N": 2.5}})
    better = auvnn.add(before, log, ["unstated_damping"], refit=True)
    assert better.model.effect("unstated_damping").values()["linear_Y"] == pytest.approx(30.0, rel=0.2)


@pytest.mark.parametrize(
    ("kind", "dof"), [("linear", "N"), ("linear", "Y"), ("quadratic", "M"), ("quadratic", "X")]
)
def test_what_displaced_elements_resist_is_what_they_resist_in_the_model(kind, dof):
    """Of a unit of velocity: the coefficient that a plausible size is taken from is the model's own drag there."""
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    element = {"position": [0.5, 0.3, -0.2], "axes": turn.tolist()}
    element |= {"linear": [0.0] * 6, "quadratic": [0.0] * 6, kind: [5.0, 7.0, 9.0, 0.3, 0.2, 0.1]}
    vehicle = plain_vehicle(damping_elements=[element])
    nu = torch.zeros(6, dtype=torch.float64)
    nu[DOFS.index(dof)] = 1.0
    eta = torch.tensor([0.0, 0, 5, 0, 0, 0], dtype=torch.float64)
    still = plain_vehicle()
    with torch.no_grad():
        slopes = [GreyBox(v)(eta, nu, torch.zeros(6, dtype=torch.float64)).numpy() for v in (still, vehicle)]
    force = -GreyBox(still).prepare().total.numpy() @ (slopes[1] - slopes[0])
    assert _coefficients(vehicle)[KINDS.index(kind), DOFS.index(dof)] == pytest.approx(force[DOFS.index(dof)])


def test_in_whatever_order_effects_stand_factors_are_on_the_vehicles_own_numbers():
    vehicle = small_vehicle(0.1, linear_damping=[25.0, 0.0, 40.0, 4.0, 5.0, 0.0])
    values = {
        "unstated_damping": {"linear_Y": 30.0},
        "coupled_damping": {"Nv": 12.0},
        "linear_damping": {"Y": 2.0, "X": 2.0},
        "quadratic_damping": {"Y": 1.5, "N": 1.5},
    }
    bodies, hulls = [], []
    for names in (list(values), list(values)[::-1]):
        ordered = {n: values[n] for n in names}
        bodies.append(GreyBox(vehicle).with_effects(ordered).prepare().body)
        nulls = {p: 0.0 for p in ("Yr", "Nv", "Zq", "Mw", "Kv", "Mu", "Xq", "Yp")}
        full = {n: {**dict.fromkeys(DOFS, 1.0), **v} if n.endswith("c_damping") or n == "linear_damping" else v
                for n, v in ordered.items()}  # fmt: skip
        full["coupled_damping"] = {**nulls, **values["coupled_damping"]}
        hulls.append(build(vehicle, full))
    for body, hull in zip(bodies, hulls, strict=True):
        assert body.linear is not None and body.quadratic is not None
        np.testing.assert_allclose(np.diag(body.linear.detach()), [50.0, 30.0, 40.0, 4.0, 5.0, 0.0])
        np.testing.assert_allclose(body.linear.detach(), hull.linear)
        np.testing.assert_allclose(body.quadratic.detach(), hull.quadratic)
        assert body.quadratic[5, 1].item() == pytest.approx(-12.0)
