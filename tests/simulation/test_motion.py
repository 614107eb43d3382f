"""The made logs against an independent plant, and what their rows mean."""

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

from auvnn.errors import AuvnnError, ConfigError
from auvnn.models import GreyBox, Inputs
from auvnn.simulation import simulate
from auvnn.vehicle import load_vehicle
from tests.unchecked import unchecked

COARSE = {"rate": 10.0, "max_step": 0.05}


def model_of(name: str, actuation: str | None = None, **changes) -> GreyBox:
    return GreyBox(unchecked(load_vehicle(name), **changes), actuation=actuation)


def plain_rate(y, tau, current):
    """The 90 kg vehicle in plain numpy: position, rotation matrix, momentum balance. Numbers typed in."""
    rotation, nu = y[3:12].reshape(3, 3), y[12:]
    mass = np.diag([90.0, 90.0, 90.0, 10.0, 15.0, 13.0])
    added = np.diag([54.0, 72.0, 360.0, 11.0, 43.5, 5.2])
    water = np.concatenate([rotation.T @ current, np.zeros(3)])
    relative = nu - water
    water_rate = np.concatenate([-np.cross(nu[3:], water[:3]), np.zeros(3)])

    def gyric(matrix, velocity):
        p = matrix @ velocity
        return np.concatenate([
            np.cross(velocity[3:], p[:3]),
            np.cross(velocity[:3], p[:3]) + np.cross(velocity[3:], p[3:]),
        ])  # fmt: skip

    linear = np.array([250.0, 200.0, 175.0, 20.0, 20.0, 15.0])
    quadratic = np.array([350.0, 350.0, 400.0, 100.0, 100.0, 75.0])
    weight, buoyancy = rotation.T @ [0.0, 0.0, 90.0 * 9.81], rotation.T @ [0.0, 0.0, -883.81]
    static = np.concatenate([weight + buoyancy, np.cross([0.0, 0.0, -0.05], buoyancy)])
    force = tau + static - gyric(mass, nu) - gyric(added, relative)
    force -= linear * relative + quadratic * np.abs(relative) * relative - added @ water_rate
    p, q, r = nu[3:]
    spin = np.array([[0, -r, q], [r, 0, -p], [-q, p, 0]])
    rate = np.linalg.solve(mass + added, force)
    return np.concatenate([rotation @ nu[:3], (rotation @ spin).ravel(), rate])


def plain_wrench(command):
    """Four horizontal thrusters at 35 degrees and two vertical ones, 120 N each."""
    places = [(0.202, -0.216), (0.202, 0.216), (-0.265, 0.195), (-0.265, -0.195), (0.216, 0.0), (-0.216, 0.0)]
    cosine, sine = np.cos(np.radians(35)), np.sin(np.radians(35))
    ways = 2 * [(cosine, sine, 0), (cosine, -sine, 0)] + 2 * [(0, 0, 1)]
    tau = np.zeros(6)
    for c, (x, y), way in zip(command, places, ways, strict=True):
        force = 120.0 * c * abs(c) * np.array(way)
        tau += np.concatenate([force, np.cross([x, y, 0.0], force)])
    return tau


def test_log_equals_an_independent_plant():
    current = {"v_north": 0.2, "v_east": -0.1, "v_down": 0.05}
    made = simulate(
        model_of("rov90"), "multisine", hidden={"ocean_current": current}, runs=1, duration=6.0, noise="none"
    )
    run = made.log.runs[0]
    w, x, y, z = run.quaternion[0]
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    state = np.concatenate([run.position[0], rotation.ravel(), run.nu[0]])
    for k in range(len(run.t) - 1):
        tau, water = plain_wrench(run.thrusters[k]), np.array([0.2, -0.1, 0.05])
        # Row k's command is held up to row k + 1, and the logged acceleration is the one it causes at once.
        assert plain_rate(state, tau, water)[12:] == pytest.approx(run.nu_dot[k], abs=1e-5)
        held = (tau, water)
        state = solve_ivp(
            lambda t, s, held=held: plain_rate(s, *held), (0, 0.05), state, rtol=1e-9, atol=1e-11
        ).y[:, -1]
        # RK4 loses an order where a velocity changes sign, because of |nu| nu.
        assert run.nu[k + 1] == pytest.approx(state[12:], abs=1e-6)
    assert run.position[-1] == pytest.approx(state[:3], abs=1e-6)
    assert np.abs(run.nu).max() > 0.1


@pytest.mark.parametrize("hidden", [{}, {"thruster_lag": {"time_constant": 0.2}}])
def test_accelerations_are_slopes_inside_the_interval(hidden):
    step = {"name": "paper", "time": 0.5, "force": 80.0}
    options = {"hidden": hidden, "runs": 1, "duration": 1.0}
    coarse = simulate(model_of("rov95"), step, **options, rate=10.0, noise="none").log.runs[0]
    fine = simulate(model_of("rov95"), step, **options, rate=1000.0, noise="none").log.runs[0]
    h = 1e-3
    for k in range(10):
        near = fine.nu[100 * k : 100 * k + 4]
        # Third-order difference looking forward: nothing of the interval before it.
        slope = (-11 * near[0] + 18 * near[1] - 9 * near[2] + 2 * near[3]) / (6 * h)
        assert coarse.nu_dot[k] == pytest.approx(slope, abs=2e-5)
    assert not hidden or np.abs(coarse.nu_dot[0]).max() > 0.1
    jump = np.abs(coarse.nu_dot[5] - coarse.nu_dot[4]).max()
    assert jump > 0.3 if not hidden else jump < 0.3


def test_a_lag_settles_at_the_first_command():
    step = {"name": "paper", "time": 0.5}
    plain, lagged = (
        simulate(model_of("rov95"), step, hidden=h, runs=1, duration=1.0, rate=10.0, noise="none").log.runs[0]
        for h in (None, {"thruster_lag": {"time_constant": 0.2}})
    )
    assert lagged.nu[5] == pytest.approx(plain.nu[5], abs=1e-12)
    assert np.abs(lagged.nu[6] - plain.nu[6]).max() > 1e-3


def test_sensor_effects_change_what_is_logged_not_the_motion():
    options = {"runs": 1, "duration": 3.0, **COARSE}
    truth = simulate(model_of("rov95"), "multisine", **options, noise="none").log.runs[0]
    arm = np.array([0.3, 0.1, -0.2])
    hidden = {"velocity_lever_arm": dict(zip("xyz", arm.tolist(), strict=True))}
    seen = simulate(model_of("rov95"), "multisine", hidden=hidden, **options, noise="none").log.runs[0]
    assert np.array_equal(seen.position, truth.position)
    assert np.array_equal(seen.thrusters, truth.thrusters)
    for name in ("nu", "nu_dot"):
        got, was = getattr(seen, name), getattr(truth, name)
        assert got[:, :3] == pytest.approx(was[:, :3] + np.cross(was[:, 3:], arm), abs=1e-12)


@pytest.mark.parametrize("excitation", ["multisine", "survey"])
def test_same_seed_same_log_to_the_last_bit(excitation):
    options = {"hidden": ["ocean_current", "cg_offset"], "runs": 2, "duration": 4.0, **COARSE}
    model = model_of("rov95")
    first, again = (simulate(model, excitation, "realistic", seed=7, **options) for _ in range(2))
    other = simulate(model, excitation, "realistic", seed=8, **options)
    for name in ("t", "quaternion", "nu", "position", "thrusters"):
        for a, b, c in zip(first.log.runs, again.log.runs, other.log.runs, strict=True):
            assert np.array_equal(getattr(a, name), getattr(b, name))
            assert name == "t" or not np.array_equal(getattr(a, name), getattr(c, name))
    assert first.truth == again.truth
    assert first.truth["hidden"] != other.truth["hidden"]
    assert first.log.sha256 == again.log.sha256


def test_a_run_stays_what_it_is_when_more_are_asked_for():
    model = model_of("rov95")
    few = simulate(model, "multisine", "realistic", runs=1, duration=4.0, **COARSE).log.runs[0]
    many = simulate(model, "multisine", "realistic", runs=3, duration=4.0, **COARSE).log.runs[0]
    assert few.thrusters == pytest.approx(many.thrusters, abs=1e-9)
    assert few.nu == pytest.approx(many.nu, abs=1e-9)


def test_noise_and_hidden_effects_do_not_change_the_manoeuvre():
    model = model_of("rov95")
    options = {"runs": 1, "duration": 4.0, **COARSE}
    plain = simulate(model, "multisine", **options, noise="none").log.runs[0]
    other = simulate(model, "multisine", "realistic", ["ocean_current"], **options).log.runs[0]
    assert np.array_equal(plain.thrusters, other.thrusters)


def test_actuation_by_wrench():
    made = simulate(
        model_of("rov95"), "multisine", actuation="wrench", runs=1, duration=3.0, **COARSE, noise="none"
    )
    run = made.log.runs[0]
    assert made.plant.actuation == "wrench" and made.log.kind == "wrench"
    assert run.thrusters is None and run.wrench.shape == (31, 6)
    assert (np.abs(run.wrench).max(axis=0) > [5, 5, 5, 0.5, 0.5, 0.5]).all()


def test_fins_are_logged_for_a_vehicle_that_has_them():
    run = simulate(model_of("remus100"), "multisine", runs=1, duration=3.0, **COARSE, noise="none").log.runs[
        0
    ]
    assert run.fins.shape == (31, 4) and run.thrusters.shape == (31, 1)
    assert run.fins.std() > 0.01


def test_voltage_only_where_it_is_known_and_slowly_falling():
    assert (
        simulate(model_of("rov95"), runs=1, duration=3.0, **COARSE, noise="none").log.runs[0].voltage is None
    )
    options = {"runs": 3, "duration": 60.0, **COARSE}
    for run in simulate(model_of("bluerov2"), **options, noise="none").log.runs:
        assert (np.diff(run.voltage) < 0).all()
        assert 0.9 * 16 < run.voltage.min() <= run.voltage.max() < 1.06 * 16
        assert 0.1 < run.voltage[0] - run.voltage[-1] < 0.3


def test_divergence_is_an_error_that_says_when_and_which_term():
    model = model_of("rov90")
    plant_model = model_of("rov90", linear_damping=-3e3 * np.eye(6))
    words = r"rov90: run \d diverged after [\d.]+ s; the largest term was (linear|quadratic) damping"
    with pytest.raises(AuvnnError, match=words):
        simulate(plant_model, "survey", runs=2, duration=10.0, **COARSE, noise="none")
    assert simulate(model, "survey", runs=1, duration=2.0, **COARSE, noise="none").log.samples == 21


def test_drag_that_drives_is_held_by_quadratic_drag_where_steps_are_short_enough():
    """v = 3000 / d_q at most, for each axis by itself; a step that is too long would only seem to diverge."""
    plant_model = model_of("rov90", linear_damping=-3e3 * np.eye(6))
    run = simulate(plant_model, "multisine", runs=1, duration=10.0, **COARSE, noise="none").log.runs[0]
    own = np.diag(plant_model.vehicle.quadratic_damping)
    assert 1.0 < np.abs(run.nu[:, :3]).max() < 2 * 3e3 / own[:3].min()


LAG, DELAY = {"thruster_lag": {"time_constant": 0.3}}, {"actuation_delay": {"delay": 0.173}}


@pytest.mark.parametrize("actuators", [LAG, DELAY, {**DELAY, **LAG}])
def test_closed_loop_replayed_in_open_loop_is_the_same(actuators):
    hidden = {**actuators, "ocean_current": {"v_north": 0.1}}
    made = simulate(model_of("bluerov2_heavy"), "survey", "none", hidden, runs=2, duration=3.0)
    t = torch.tensor(made.log.runs[0].t)
    with torch.no_grad():
        for run in made.log.runs:
            eta0 = torch.tensor(np.concatenate([run.position[0], run.quaternion[0]]))
            command = Inputs(torch.tensor(run.thrusters.copy()), voltage=None)
            again = made.plant.rollout(eta0, torch.tensor(run.nu[0].copy()), command, t, max_step=0.01)
            assert run.nu == pytest.approx(again.nu.numpy(), abs=1e-9)
            assert run.quaternion == pytest.approx(again.eta[:, 3:].numpy(), abs=1e-9)


def test_truth_follows_the_contract():
    options = {"seed": 3, "runs": 1, "duration": 2.0, **COARSE}
    made = simulate(model_of("rov95"), "paper", "paper", "net_buoyancy", **options)
    truth = made.truth
    assert truth["schema"] == "auvnn/truth/1" and truth["noise"] == "paper"
    assert truth["seed"] == 3 and truth["model"] == "rov95"
    assert list(truth["hidden"]) == ["net_buoyancy"] and abs(truth["hidden"]["net_buoyancy"]["force"]) > 1
    assert truth["conditions"]["excitation"]["time"] == 15.0
    assert made.plant.effect("net_buoyancy").values() == truth["hidden"]["net_buoyancy"]


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"excitation": "multisin"}, "multisine"),
        ({"excitation": {"name": "multisine", "efort": 1.0}}, "effort"),
        ({"excitation": {"name": "multisine", "effort": "much"}}, "number"),
        ({"excitation": {"name": "multisine", "effort": 3.0}}, "effort"),
        ({"excitation": {"name": "survey", "hold": [5.0]}}, "list of 2"),
        ({"excitation": {"effort": 1.0}}, "name"),
        ({"noise": "realistc"}, "realistic"),
        ({"noise": {"name": "paper", "amplitude": "peak"}}, "uniform"),
        ({"noise": {"standard_deviation": {"uu": 0.1}}}, "channel"),
        ({"noise": {"standard_deviation": {"u": -0.1}}}, "from 0 up"),
        ({"hidden": {"ocean_curent": None}}, "ocean_current"),
        ({"hidden": {"ocean_current": {"north": 0.2}}}, "v_north"),
        ({"hidden": {"ocean_current": {"v_north": 20.0}}}, "out of bounds"),
        ({"runs": 0}, "runs"),
        ({"seed": -1}, "seed"),
        ({"rate": 0.0}, "rate"),
        ({"duration": 0.05}, "duration"),
        ({"duration": float("nan")}, "duration"),
        ({"coefficients": "draw"}, "drawn"),
        ({"actuation": "rudder"}, "wrench"),
    ],
)
def test_bad_options_are_refused_in_one_line(options, word):
    with pytest.raises(ConfigError, match=word) as caught:
        simulate(model_of("rov95"), **{"noise": "none", **options})
    assert "\n" not in str(caught.value)
