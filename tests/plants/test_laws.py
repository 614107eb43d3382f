"""Laws of other worlds against closed forms: steady speeds, accelerations at rest, forces worked out by hand."""

import dataclasses

import numpy as np
import pytest

from auvnn.errors import ConfigError
from auvnn.physics.coriolis import coriolis_force
from auvnn.plants.laws import Laws, Wander
from auvnn.vehicle import load_vehicle
from tests.plants.plant_tasks import apart, move, task


def bare(**more):
    """A neutrally buoyant body without drag, fins or restoring moments; further fields as given."""
    known = load_vehicle("rov95")
    centre = np.zeros(3)
    return dataclasses.replace(
        known, buoyancy=known.weight, center_of_gravity=centre, center_of_buoyancy=centre, fins=(),
        damping_elements=(), **{"linear_damping": None, "quadratic_damping": None, **more},
    )  # fmt: skip


def still(what, command=None, nu0=None):
    """The same task from rest, level, under a constant command."""
    count = len(what.eta0)
    eta0 = np.tile([0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0], (count, 1))
    held = 0.0 * what.command if command is None else np.broadcast_to(command, what.command.shape).copy()
    start = np.zeros((count, 6)) if nu0 is None else np.broadcast_to(nu0, (count, 6)).copy()
    return dataclasses.replace(what, eta0=eta0, nu0=start, command=held, bottom=None)


def test_usual_laws_are_the_usual_motion_and_no_other_plant_takes_others():
    what = task("rov95")
    assert Laws().usual
    other = dataclasses.replace(what, laws=Laws(separation=1.0))
    for plant in ("own", "mujoco"):
        pytest.importorskip("mujoco") if plant == "mujoco" else None
        with pytest.raises(ConfigError, match=f"plant {plant} knows the usual laws only.*plant=numpy"):
            move(plant, other)


@pytest.mark.parametrize("exponent", [1.7, 2.0, 2.2])
def test_the_steady_speed_follows_the_exponent(exponent):
    # q v0^2 (u / v0)^n = X, whence u = v0 (X / (q v0^2))^(1/n).
    drag, push, reference = 80.0, 45.0, 0.5
    known = bare(quadratic_damping=np.diag([drag, 1, 1, 1, 1, 1.0]))
    what = still(
        task(known, actuation="wrench", rows=301, rate=5.0, runs=1, every=301,
             laws=Laws(exponent=np.full(6, exponent), speed=np.full(6, reference))),
        [push, 0, 0, 0, 0, 0],
    )  # fmt: skip
    steady = reference * (push / (drag * reference**2)) ** (1.0 / exponent)
    assert move("numpy", what).nu[0, -1, 0] == pytest.approx(steady, rel=1e-5)


def test_displaced_drag_follows_the_exponents_too():
    law = Laws(exponent=np.array([1.7, 2.2, 2.0, 2.0, 2.0, 1.9]), speed=np.full(6, 0.5))
    nu = np.array([[0.3, -0.7, 0.5, 0.0, 0.1, -0.2]])
    by_hand = [0.25 * (0.6**1.7), -0.25 * 1.4**2.2, 0.25, 0.0, 0.25 * 0.2**2, -0.25 * 0.4**1.9]
    assert law.powers(nu)[0] == pytest.approx(by_hand)
    assert Laws().powers(nu) == pytest.approx(np.abs(nu) * nu)


def test_the_thrust_is_off_by_the_curve_of_each_thruster():
    known = bare()
    count = len(known.thrusters)
    phase = np.linspace(0.0, 2.0, count)
    plain = still(task(known, rows=2, runs=1), np.full(count, 0.4))
    off = dataclasses.replace(plain, laws=Laws(thrust=0.05, phase=phase))
    columns = np.array([[*u.direction, *np.cross(u.position, u.direction)] for u in known.thrusters]).T
    thrust = np.array([u.max_forward for u in known.thrusters]) * 0.4**2
    gained = columns @ (thrust * 0.05 * np.cos(0.4 * np.pi + phase))
    inertia = known.inertia_matrix
    found = move("numpy", off).nu_dot[0, 0] - move("numpy", plain).nu_dot[0, 0]
    assert inertia @ found == pytest.approx(gained, rel=1e-9, abs=1e-9)


def test_the_current_pushes_by_drag_alone():
    drag = np.diag([30.0, 60.0, 70.0, 2.0, 3.0, 4.0])
    known = bare(linear_damping=drag)
    what = still(
        task(known, {"ocean_current": {"v_north": 0.3, "v_east": -0.2, "v_down": 0.0}}, actuation="wrench", rows=2,
             runs=1, laws=Laws(relative=0.0, added_coriolis=0.0)),
        nu0=[0.2, 0.1, 0.0, 0.0, 0.0, 0.4],
    )  # fmt: skip
    import torch

    nu = what.nu0[0]
    through = nu - np.array([0.3, -0.2, 0.0, 0.0, 0.0, 0.0])
    rigid = known.inertia_matrix - known.added_mass
    # The package's own Coriolis matrix of the rigid body is the second derivation.
    turning = coriolis_force(torch.tensor(rigid), torch.tensor(nu)).numpy()
    expected = np.linalg.solve(known.inertia_matrix, -turning - drag @ through)
    assert move("numpy", what).nu_dot[0, 0] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_an_effect_says_what_a_simplifying_simulator_does(share):
    # Two derivations of the current in the drag alone: the plant's own law, and the model's effect.
    water = {
        "ocean_current": {"v_north": 0.3, "v_east": -0.2, "v_down": 0.1},
        "current_shear": {"north": 0.1},
    }
    rest = {"fin_gain": {"fin_1": 0.6}, "body_lift": {"Yuv": -20.0}, "tether": {"drag": 0.3}}
    stated = {"added_mass_coriolis": {"factor": 0.3}, "drag_only_current": {"share": share}}
    plain = task("remus100", water | rest)
    law = dataclasses.replace(plain, laws=Laws(relative=1.0 - share, added_coriolis=0.3))
    moved = move("numpy", law)
    assert apart(move("own", task("remus100", water | rest | stated)), moved) < 2e-6
    assert apart(move("own", plain), moved) > 1e-3


@pytest.mark.parametrize("order", [1, -1])
def test_an_effect_says_how_lift_of_another_form_falls_off(order):
    lift = {"body_lift": {"Yuv": -40.0, "Zuw": -30.0, "Muw": -5.0, "Nuv": 4.0}}
    both = {**lift, "body_lift_stall": {"share": 0.6}}
    plain = still(task("rov95", lift), nu0=[0.5, 0.3, -0.2, 0.1, 0.1, 0.3])
    # The model's effects act one after the other: whichever comes first, the lift is the same.
    told = still(task("rov95", dict([*both.items()][::order])), nu0=[0.5, 0.3, -0.2, 0.1, 0.1, 0.3])
    law = move("numpy", dataclasses.replace(plain, laws=Laws(separation=0.6)))
    assert [*told.effects] == [*both][::order] and apart(move("own", told), law) < 2e-6
    assert apart(move("own", plain), law) > 1e-4


def test_an_inflow_by_the_speed_over_ground_sees_no_current():
    loss = {"thrust_inflow_loss": {"coefficient": 20.0}}
    current = {"ocean_current": {"v_north": 0.4, "v_east": 0.0, "v_down": 0.0}}
    known = bare()
    command = np.full(len(known.thrusters), 0.5)
    free = Laws(relative=0.0, added_coriolis=0.0)
    with_current = still(task(known, loss | current, rows=2, runs=1, laws=free), command)
    without = still(task(known, loss, rows=2, runs=1, laws=free), command)
    assert move("numpy", with_current).nu_dot == pytest.approx(move("numpy", without).nu_dot, abs=1e-12)
    usual = dataclasses.replace(with_current, laws=Laws())
    assert np.abs(move("numpy", usual).nu_dot - move("numpy", without).nu_dot).max() > 1e-3


def test_a_wandering_force_moves_by_its_impulse():
    # M du = integral of F dt, by trapezia, exact for a force that is linear between knots.
    known = bare(added_mass=np.diag([20.0, 30.0, 40.0, 1.0, 1.0, 1.0]))
    rng = np.random.default_rng(1)
    force = np.zeros((1, 41, 6))
    force[..., 0] = rng.normal(size=41)
    wander = Wander(0.025, force)
    what = still(
        task(known, actuation="wrench", rows=21, rate=20.0, runs=1, max_step=0.025, laws=Laws(wander=wander))
    )
    impulse = 0.025 * (0.5 * (force[0, 1:, 0] + force[0, :-1, 0])).cumsum()[1::2]
    assert (known.mass + 20.0) * move("numpy", what).nu[0, 1:, 0] == pytest.approx(
        impulse, rel=1e-5, abs=1e-7
    )
    assert wander.at(0.0125)[0, 0] == pytest.approx(0.5 * (force[0, 0, 0] + force[0, 1, 0]))
    assert wander.knots(0.05, 0.1) == pytest.approx([0.075])


def test_the_quick_step_is_as_good_as_the_adaptive_method():
    calm = Wander(0.0125, np.zeros((2, 100, 6)))
    for vehicle in ("bluerov2_heavy", "remus100"):
        slow = task(vehicle, rows=21, max_step=0.025)
        assert (
            apart(move("numpy", dataclasses.replace(slow, laws=Laws(wander=calm))), move("numpy", slow))
            < 1e-4
        )
