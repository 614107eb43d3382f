"""The equations as a whole: against the same written out in numpy, and what they must be blind to."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.effects import EFFECTS
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.physics.attitude import euler_to_quat, quat_multiply
from auvnn.physics.kinematics import eta7_to_eta6
from auvnn.testing import example_vehicle, make_scene
from auvnn.vehicle import builtin_vehicles, load_vehicle

DOUBLE = torch.float64


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def written_out(vehicle, euler, nu, wrench):
    """Return the acceleration by Fossen's equations with matrices as he prints them; no fins."""
    (phi, theta, _), (v, w) = euler, (nu[:3], nu[3:])
    m_rb, m_a = vehicle.rigid_body, vehicle.added_mass
    m, i_o = vehicle.mass, vehicle.rigid_body[3:, 3:]
    # Fossen (2011), eq. 3.56: C_RB from the first of his forms, and eq. 6.43: C_A
    cross = -m * skew(v) - m * skew(skew(w) @ vehicle.center_of_gravity)
    turning = m * skew(skew(v) @ vehicle.center_of_gravity) - skew(i_o @ w)
    c_rb = np.block([[np.zeros((3, 3)), cross], [cross, turning]])
    a = m_a @ nu
    c_a = np.block([[np.zeros((3, 3)), -skew(a[:3])], [-skew(a[:3]), -skew(a[3:])]])
    weight, buoyancy = vehicle.mass * vehicle.gravity, vehicle.buoyancy
    (xg, yg, zg), (xb, yb, zb) = vehicle.center_of_gravity, vehicle.center_of_buoyancy
    st, ct, sp, cp = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)
    g = np.array([  # Fossen (2011), eq. 4.6
        (weight - buoyancy) * st,
        -(weight - buoyancy) * ct * sp,
        -(weight - buoyancy) * ct * cp,
        -(yg * weight - yb * buoyancy) * ct * cp + (zg * weight - zb * buoyancy) * ct * sp,
        (zg * weight - zb * buoyancy) * st + (xg * weight - xb * buoyancy) * ct * cp,
        -(xg * weight - xb * buoyancy) * ct * sp - (yg * weight - yb * buoyancy) * st,
    ])  # fmt: skip
    drag = np.zeros(6)
    if vehicle.linear_damping is not None:
        drag += vehicle.linear_damping @ nu
    if vehicle.quadratic_damping is not None:
        drag += vehicle.quadratic_damping @ (np.abs(nu) * nu)
    for e in vehicle.damping_elements:
        own = np.concatenate([e.axes.T @ (v + np.cross(w, e.position)), e.axes.T @ w])
        f = e.linear * own + e.quadratic * np.abs(own) * own
        force = e.axes @ f[:3]
        drag += np.concatenate([force, e.axes @ f[3:] + np.cross(e.position, force)])
    return np.linalg.solve(m_rb + m_a, wrench - (c_rb + c_a) @ nu - drag - g)


@pytest.mark.parametrize("name", ["example", *builtin_vehicles()])
def test_it_is_fossens_equation(name):
    vehicle = replace(example_vehicle() if name == "example" else load_vehicle(name), fins=())
    model = GreyBox(vehicle, actuation="wrench")
    random = np.random.default_rng(0)
    for _ in range(10):
        euler, nu = random.uniform(-1.2, 1.2, 3), random.uniform(-1, 1, 6)
        wrench = random.uniform(-20, 20, 6)
        expected = written_out(vehicle, euler, nu, wrench)
        eta = torch.tensor([1.0, 2.0, 3.0, *euler], dtype=DOUBLE)
        found = model(eta, torch.tensor(nu), torch.tensor(wrench)).numpy()
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max())


def test_thrusters_push_as_geometry_and_curves_say(example):
    """Against cross products and numpy's interpolation, one thruster with a table among quadratic ones."""
    command = np.array([0.7, -0.35, -0.6, 0.2, -0.9, 0.05])
    wrench = np.zeros(6)
    for c, unit in zip(command, example.vehicle.thrusters, strict=True):
        if unit.curve == "quadratic":
            thrust = c * abs(c) * (unit.max_forward if c > 0 else unit.max_reverse)
        else:
            thrust = np.interp(c, unit.curve.command, unit.curve.thrust)
        wrench += thrust * np.concatenate([unit.direction, np.cross(unit.position, unit.direction)])
    commanded = GreyBox(example.vehicle, actuation="wrench")  # its fins are the same in both
    eta, nu = torch.tensor([0, 0, 5, 0.2, 0.1, 1], dtype=DOUBLE), torch.full((6,), 0.3, dtype=DOUBLE)
    torch.testing.assert_close(
        example(eta, nu, torch.tensor(command)),
        commanded(eta, nu, torch.tensor(wrench)),
        rtol=1e-12,
        atol=1e-13,
    )


def test_the_terms_add_up_to_inertia_times_acceleration(example, bank):
    model = GreyBox(example.vehicle, damping=bank).with_effects({"ocean_current": {"v_north": 0.3}})
    scene = make_scene(example.vehicle, "thrusters")
    row = scene.inputs.each()[0]
    rate = model(scene.eta, scene.nu, row.command, fins=row.fins)
    from auvnn.physics.attitude import quat_to_matrix

    thrust = model.actuators.static(row.command)
    terms = model.wrenches(
        scene.eta[:, :3], quat_to_matrix(scene.eta[:, 3:]), scene.nu, thrust, row, scene.times[0]
    )
    assert {
        "thrust",
        "Coriolis",
        "linear damping",
        "quadratic damping",
        "damping elements",
        "damping subnetworks",
        "restoring",
        "fins",
    } < set(terms)
    total = (model.prepare().total @ rate.unsqueeze(-1)).squeeze(-1)
    torch.testing.assert_close(sum(terms.values()), total, rtol=1e-11, atol=1e-11)


def test_euler_angles_and_quaternion_agree(example):
    scene = make_scene(example.vehicle, "thrusters", runs=10)
    row = scene.inputs.each()[0]
    by_quaternion = example(scene.eta, scene.nu, row.command, fins=row.fins)
    by_angles = example(eta7_to_eta6(scene.eta), scene.nu, row.command, fins=row.fins)
    torch.testing.assert_close(by_angles, by_quaternion, rtol=1e-12, atol=1e-13)
    # A quaternion and its negative are the same attitude.
    other = torch.cat([scene.eta[:, :3], -scene.eta[:, 3:]], dim=-1)
    assert torch.equal(example(other, scene.nu, row.command, fins=row.fins), by_quaternion)


def test_position_and_heading_do_not_matter(example):
    scene = make_scene(example.vehicle, "thrusters", runs=10)
    row = scene.inputs.each()[0]
    turn = euler_to_quat(torch.tensor([0, 0, 1.234], dtype=DOUBLE)).expand(10, 4)
    moved = scene.eta[:, :3] + torch.tensor([100.0, -50.0, 7.0], dtype=DOUBLE)
    elsewhere = torch.cat([moved, quat_multiply(turn, scene.eta[:, 3:])], dim=-1)
    here = example(scene.eta, scene.nu, row.command, fins=row.fins)
    torch.testing.assert_close(
        example(elsewhere, scene.nu, row.command, fins=row.fins), here, rtol=1e-12, atol=1e-12
    )


def test_a_batch_is_its_members_and_leading_shapes_broadcast(example, bank):
    model = GreyBox(example.vehicle, damping=bank)
    scene = make_scene(example.vehicle, "thrusters", runs=6)
    row = scene.inputs.each()[0]
    whole = model(scene.eta, scene.nu, row.command, fins=row.fins)
    for k in range(6):
        one = model(scene.eta[k], scene.nu[k], row.command[k], fins=row.fins[k])
        torch.testing.assert_close(one, whole[k], rtol=1e-13, atol=1e-13)
    grid = model(
        scene.eta.view(2, 3, 7),
        scene.nu.view(2, 3, 6),
        row.command.view(2, 3, -1),
        fins=row.fins.view(2, 3, -1),
    )
    torch.testing.assert_close(grid.view(6, 6), whole, rtol=1e-13, atol=1e-13)
    shared = model(scene.eta, scene.nu, row.command[0], fins=row.fins[0], time=torch.arange(6, dtype=DOUBLE))
    repeated = model(scene.eta, scene.nu, row.command[:1].expand(6, -1), fins=row.fins[:1].expand(6, -1))
    torch.testing.assert_close(shared, repeated, rtol=1e-13, atol=1e-13)


def test_subnetworks_act_on_the_velocity_through_the_water(rov, bank):
    model = GreyBox(rov.vehicle, damping=bank, actuation="wrench")
    eta, nu, zero = (
        torch.zeros(6, dtype=DOUBLE),
        torch.full((6,), 0.2, dtype=DOUBLE),
        torch.zeros(6, dtype=DOUBLE),
    )
    gained = model.prepare().total @ (rov(eta, nu, zero) - model(eta, nu, zero))
    torch.testing.assert_close(gained, bank(nu), rtol=1e-11, atol=1e-11)
    drifting = torch.tensor([0.3, 0, 0, 0, 0, 0], dtype=DOUBLE)
    streams = {"ocean_current": {"v_north": 0.3}}
    gained = model.prepare().total @ (
        rov.with_effects(streams)(eta, drifting, zero) - model.with_effects(streams)(eta, drifting, zero)
    )
    torch.testing.assert_close(gained, bank(zero), rtol=1e-11, atol=1e-11)


def test_added_effects_and_copies_share_nothing_with_the_original(rov, bank):
    first = GreyBox(rov.vehicle, damping=bank, actuation="wrench").with_effects(
        {"net_buoyancy": {"force": 5.0}}
    )
    eta, nu, command = (
        torch.zeros(6, dtype=DOUBLE),
        torch.full((6,), 0.2, dtype=DOUBLE),
        torch.ones(6, dtype=DOUBLE),
    )
    before = first(eta, nu, command).detach()
    second = first.with_effects(["constant_force"])
    assert second.effect_names == ["net_buoyancy", "constant_force"]
    assert torch.equal(second(eta, nu, command), before)
    own = {p.data_ptr() for p in first.parameters()}
    assert own.isdisjoint(p.data_ptr() for p in second.parameters())
    with torch.no_grad():
        for parameter in second.parameters():
            parameter.add_(1.0)
    assert torch.equal(first(eta, nu, command), before)
    assert not torch.equal(second(eta, nu, command), before)
    twins = [rov.with_effects(["net_buoyancy"]) for _ in range(2)]
    assert twins[0].effects[0].theta.data_ptr() != twins[1].effects[0].theta.data_ptr()


def test_a_deep_copy_follows_its_own_parameters(rov):
    model = rov.with_effects({"net_buoyancy": {"force": 5.0}})
    other = copy.deepcopy(model)
    with torch.no_grad():
        other.effects[0].theta.fill_(-5.0)
    eta, zero = torch.zeros(6, dtype=DOUBLE), torch.zeros(6, dtype=DOUBLE)
    assert model(eta, zero, zero)[2] < 0 < other(eta, zero, zero)[2]


def test_precision_and_requires_grad_survive_a_rebuild(rov, bank):
    model = GreyBox(rov.vehicle, damping=bank, actuation="wrench").with_effects(["net_buoyancy"]).float()
    model.effects[0].theta.requires_grad_(False)
    more = model.with_effects(["ocean_current"])
    assert {p.dtype for p in [*more.parameters(), *more.buffers()]} == {torch.float32}
    assert [e.theta.requires_grad for e in more.effects] == [False, True]


def test_a_value_that_a_fit_has_left_at_or_beyond_a_bound_can_still_be_copied(rov):
    model = rov.with_effects({"thruster_lag": {"time_constant": 0.1}})
    with torch.no_grad():
        model.effects[0].theta.fill_(-1e-18)
    assert model.with_effects(["net_buoyancy"]).effects[0].values() == {"time_constant": -1e-18}


def test_impossible_sets_of_effects_are_refused(rov):
    with pytest.raises(ConfigError, match="net_buoyancy is given twice"):
        rov.with_effects(["net_buoyancy"]).with_effects(["net_buoyancy"])
    with pytest.raises(ConfigError, match=r"no effect called 'net_bouyancy'\. Did you mean 'net_buoyancy'"):
        rov.with_effects(["net_bouyancy"])
    with pytest.raises(ConfigError, match="the model has no effect 'waves'; it has: none"):
        rov.effect("waves")

    class Jealous(EFFECTS.get("constant_force")):
        name, excludes = "jealous", ("net_buoyancy",)

    members = [Jealous.build(rov.vehicle, "wrench"), *rov.with_effects(["net_buoyancy"]).effects]
    with pytest.raises(ConfigError, match="jealous and net_buoyancy exclude each other"):
        GreyBox(rov.vehicle, members, actuation="wrench")


def test_effects_of_a_kind_add_up(rov):
    """Two forces and two currents act together, in whatever order."""

    class Tide(EFFECTS.get("ocean_current")):
        name = "tide"

    vehicle, zero = rov.vehicle, torch.zeros(6, dtype=DOUBLE)
    one = EFFECTS.get("ocean_current").build(vehicle, "wrench", {"v_north": 0.3})
    two = Tide.build(vehicle, "wrench", {"v_north": -0.1, "v_east": 0.2})
    both = GreyBox(vehicle, [one, two], actuation="wrench")
    sum_of_both = rov.with_effects({"ocean_current": {"v_north": 0.2, "v_east": 0.2}})
    torch.testing.assert_close(both(zero, zero, zero), sum_of_both(zero, zero, zero), rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize(
    ("eta", "nu", "command"), [((5,), (6,), (6,)), ((7,), (3,), (6,)), ((7,), (6,), (8,)), ((7,), (6,), (1,))]
)
def test_wrong_sizes_are_answered_in_one_line(rov, eta, nu, command):
    with pytest.raises(ConfigError, match="last sizes are 6 or 7, 6, and 6") as caught:
        rov(*(torch.zeros(*shape, dtype=DOUBLE) for shape in (eta, nu, command)))
    assert "\n" not in str(caught.value)


def test_parameters_and_state_are_seen_by_function_transforms(rov, bank):
    """What the diagnosis rests on: functional_call, jvp, jacrev, vmap, over weights and effects together."""
    from torch.func import functional_call, jacrev, jvp, vmap

    model = GreyBox(rov.vehicle, damping=bank, actuation="wrench").with_effects(
        ["ocean_current", "cg_offset"]
    )
    scene = make_scene(rov.vehicle, "wrench", runs=3)
    command = scene.inputs.each()[0].command
    start = {k: v.detach() for k, v in model.named_parameters()}

    def acceleration(parameters, eta, nu, c):
        return functional_call(model, parameters, (eta, nu, c))

    rows = vmap(jacrev(acceleration), in_dims=(None, 0, 0, 0))(start, scene.eta, scene.nu, command)
    direction = {
        k: torch.randn(v.shape, generator=torch.Generator().manual_seed(1), dtype=DOUBLE)
        for k, v in start.items()
    }
    _, along = jvp(lambda p: acceleration(p, scene.eta, scene.nu, command), (start,), (direction,))
    summed = sum((rows[k].flatten(2) @ direction[k].flatten()) for k in start)
    torch.testing.assert_close(summed, along, rtol=1e-9, atol=1e-10)
    step = 1e-6
    ends = []
    for sign in (1, -1):
        moved = {k: v + sign * step * direction[k] for k, v in start.items()}
        ends.append(acceleration(moved, scene.eta, scene.nu, command))
    torch.testing.assert_close(along, (ends[0] - ends[1]) / (2 * step), rtol=1e-6, atol=1e-7)


def test_fins_without_stated_angles_are_held_at_zero():
    """A passive fin at the stern steers against a sideslip; leaving it out would lose half of it."""
    model = GreyBox(load_vehicle("remus100"))
    eta, nu = torch.zeros(6, dtype=DOUBLE), torch.tensor([1.5, 0.2, 0, 0, 0, 0], dtype=DOUBLE)
    command = torch.zeros(1, dtype=DOUBLE)
    silent = model(eta, nu, command)
    assert torch.equal(silent, model(eta, nu, command, fins=torch.zeros(4, dtype=DOUBLE)))
    bare = GreyBox(replace(model.vehicle, fins=()))
    assert silent[5] > bare(eta, nu, command)[5]
    with pytest.raises(ConfigError, match=r"fins \(3,\): the vehicle has 4 fins"):
        model(eta, nu, command, fins=torch.zeros(3, dtype=DOUBLE))


def test_a_model_knows_by_itself_how_it_is_driven(rov):
    assert GreyBox(load_vehicle("rov95")).actuation == "thrusters"
    assert GreyBox(replace(load_vehicle("rov95"), thrusters=())).actuation == "wrench"


def test_the_known_numbers_are_not_trained_and_not_saved_but_move_along(rov):
    model = GreyBox(rov.vehicle, damping=DampingBank.from_description("zero"), actuation="wrench")
    assert list(model.parameters()) == []
    assert not [k for k in model.state_dict() if k.startswith("known_")]
    assert model.float().prepare().total.dtype == torch.float32
