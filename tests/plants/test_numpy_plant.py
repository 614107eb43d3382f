"""The independent plant against the model: two derivations, two formulations, two solvers, one motion."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auvnn.damping.bank import DampingBank
from auvnn.effects import EFFECTS
from auvnn.effects import cross_flow_drag as cross_flow_module
from auvnn.errors import AuvnnError, ConfigError
from auvnn.models import GreyBox
from auvnn.plants.independent.plant import SUPPORTED
from auvnn.simulation import simulate
from auvnn.vehicle import DampingElement, load_vehicle
from tests.plants.plant_tasks import apart, move, plausible, task
from tests.unchecked import unchecked

# As a share of the largest motion. Left over by the model's own RK4 at 5 ms; at 2.5 ms it is a tenth of it.
CLOSE = 2e-6
VEHICLES = ("rov95", "bluerov2_heavy", "remus100")
NEEDS = {"voltage_droop": "bluerov2", "fin_stall": "remus100", "fin_gain": "remus100", "fin_offset": "remus100",
         "fin_drag": "remus100", "fin_lag": "remus100"}  # fmt: skip
# Compared on their own below: the model takes sums (over strips, over rows) where this plant has integrals.
SUMMED = ("cross_flow_drag", "thrust_overshoot", "propeller_lag")


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("actuation", ["thrusters", "wrench"])
def test_nominal_vehicles_move_alike(vehicle, actuation):
    what = task(vehicle, actuation=actuation, max_step=0.0025)
    assert apart(move("own", what), move("numpy", what)) < 0.25 * CLOSE


def test_every_effect_of_the_catalogue_is_known():
    assert set(EFFECTS.names()) <= SUPPORTED


@pytest.mark.parametrize("name", [n for n in EFFECTS.names() if n not in SUMMED])
def test_every_effect_does_the_same(name):
    vehicle = NEEDS.get(name, "rov95")
    # The BlueROV2 is small and quick: half the step for the same error.
    beside = EFFECTS.get(name).acts_with[:1]
    effects = {n: plausible(n, vehicle) for n in (*beside, name)}
    what = task(vehicle, effects, max_step=0.0025 if vehicle == "bluerov2" else 0.005)
    own, other = move("own", what), move("numpy", what)
    assert apart(own, other) < CLOSE
    # And it does something, so that the agreement means something.
    assert apart(other, nominal(vehicle, beside)) > 100 * CLOSE


@functools.cache
def nominal(vehicle, beside=()):
    return move("numpy", task(vehicle, {n: plausible(n, vehicle) for n in beside}))


@pytest.mark.parametrize(
    ("vehicle", "names"),
    [
        ("bluerov2", ("thruster_deadband", "thruster_lag", "actuation_delay", "thruster_gain", "thrust_inflow_loss",
                      "voltage_droop", "propeller_torque")),
        ("bluerov2", ("thrust_curve", "thruster_deadband", "thruster_lag", "voltage_droop")),
        ("bluerov2", ("thruster_gain", "thrust_polynomial", "thruster_deadband", "thruster_lag")),
        ("rov95", ("ocean_current", "current_shear", "waves", "tether", "added_mass", "munk_moment")),
        ("rov95", ("waves", "current_shear", "drag_only_current", "added_mass_coriolis", "munk_moment",
                   "bottom_proximity")),
        ("bluerov2", ("ocean_current", "drag_only_current", "drag_curve", "quadratic_damping")),
        ("rov95", ("ocean_current", "drag_only_current", "drag_curve")),
        ("remus100", ("body_lift_stall", "ocean_current", "body_lift", "drag_only_current", "munk_moment")),
        ("remus100", ("ocean_current", "drag_only_current", "cross_flow_drag")),
        ("remus100", ("drag_only_current", "ocean_current", "fin_stall", "fin_gain", "body_lift", "tether",
                      "turning_forces", "thrust_inflow_loss")),
        ("rov95", ("bottom_proximity", "surface_proximity", "biofouling", "ocean_current", "quadratic_damping")),
        ("rov95", ("bottom_proximity", "payload", "biofouling", "drag_curve")),
        ("remus100", ("biofouling", "ocean_current", "drag_curve", "surface_proximity")),
        ("remus100", ("cg_offset", "payload", "net_buoyancy", "compressibility", "coupled_damping", "ocean_current")),
        ("remus100", ("fin_stall", "body_lift", "turning_forces", "flooding", "trapped_water", "linear_damping")),
        ("remus100", ("fin_stall", "fin_gain", "fin_offset", "fin_drag", "fin_lag")),
        ("remus100", ("fin_gain", "fin_offset", "fin_stall")),
        ("rov95", ("cg_offset", "trapped_water", "payload")),
        ("rov95", ("gyro_bias", "velocity_lever_arm", "velocity_scale", "velocity_misalignment", "tilted_vertical",
                   "accelerometer_tilt")),
    ],
)  # fmt: skip
def test_effects_together_do_the_same(vehicle, names):
    what = task(vehicle, {n: plausible(n, vehicle, 5) for n in names}, seed=4)
    assert apart(move("own", what), move("numpy", what)) < CLOSE


@pytest.mark.parametrize("name", ["thruster_gain", "thruster_deadband", "thrust_curve", "thrust_polynomial",
                                  "thrust_inflow_loss", "propeller_torque", "thruster_lag"])  # fmt: skip
def test_effects_on_a_commanded_wrench_do_the_same(name):
    known = load_vehicle("remus100")
    values = {p.name: p.null + 0.7 * p.scale for p in EFFECTS.get(name).describe(known, "wrench")}
    what = task("remus100", {name: values}, actuation="wrench")
    assert apart(move("own", what), move("numpy", what)) < CLOSE


def test_displaced_drag_does_the_same():
    rng = np.random.default_rng(2)
    parts = tuple(
        DampingElement(rng.normal(size=3), Rotation.random(rng=rng).as_matrix(),
                       rng.uniform(1, 10, 6), rng.uniform(5, 30, 6)) for _ in range(2)
    )  # fmt: skip
    known = dataclasses.replace(load_vehicle("rov95"), damping_elements=parts)
    factors = {a: 0.6 + 0.2 * i for i, a in enumerate("XYZKMN")}
    effects = {"linear_damping": factors, "quadratic_damping": factors, "cross_flow_drag": {"share": 0.0}}
    what = task(known, effects)
    assert apart(move("own", what), move("numpy", what)) < CLOSE


def test_strips_of_the_cross_flow_are_enough(monkeypatch):
    # The model sums 8 strips, this plant 48: what lies between them is the model's quadrature, and nothing else.
    values = {"cross_flow_drag": {"share": 1.0}}
    coarse = task("remus100", values)
    left = apart(move("own", coarse), move("numpy", coarse))
    assert left < CLOSE
    monkeypatch.setattr(cross_flow_module, "STRIPS", 48)
    fine = task("remus100", values)
    assert apart(move("own", fine), move("numpy", fine)) < 0.1 * left
    assert apart(move("numpy", fine), nominal("remus100")) > 100 * CLOSE


def test_overshoot_of_the_model_is_the_mean_over_each_row():
    # The excess fades within a row; the model takes its mean there. With four times as many rows (and the same
    # commands) the motions come 16 times as close: the impulse of every row is right, its timing is not.
    known = load_vehicle("rov95")
    values = {"thrust_overshoot": {"time_constant": 0.4, **dict.fromkeys("XYZKMN", 0.8)}}
    off = []
    for finer in (1, 4):
        what = task(
            known, values, actuation="wrench", rows=10 * finer + 1, rate=20.0 * finer, every=2 * finer
        )
        own, other = move("own", what), move("numpy", what)
        off.append(np.abs(own.nu - other.nu).max())
    assert off[0] < 2e-3 and 11 < off[0] / off[1] < 21


@pytest.mark.parametrize(
    "effects",
    [
        {"propeller_lag": {"time_constant": 0.15}},
        {"propeller_lag": {"time_constant": 0.15}, "thruster_lag": {"time_constant": 0.1}},
        {
            "propeller_lag": {"time_constant": 0.15},
            "thrust_overshoot": {"time_constant": 0.4, "thruster_1": 0.5, "thruster_4": -0.3},
        },
    ],
    ids=["alone", "with a lag of the thrust", "with an overshoot"],
)
def test_a_lag_of_propellers_in_the_model_is_that_of_the_mean_speed_of_each_row(effects):
    # Its square is not the mean of the square. With four times as many rows, and the same commands, both come closer.
    off = []
    for finer in (1, 4):
        what = task("rov95", effects, rows=10 * finer + 1, rate=20.0 * finer, every=2 * finer)
        own, other = move("own", what), move("numpy", what)
        off.append(np.abs(own.nu - other.nu).max())
    assert off[0] < 3e-3 and 6 < off[0] / off[1] < 24
    assert np.abs(other.nu - move("numpy", dataclasses.replace(what, effects={})).nu).max() > 0.02


def test_momentum_and_energy_are_kept_without_forces():
    # A third argument, of neither plant: nothing acts on body and water together.
    known = load_vehicle("remus100")
    centre = np.array([0.05, -0.03, 0.02])
    drift = dataclasses.replace(
        known, buoyancy=known.weight, center_of_gravity=centre, center_of_buoyancy=centre,
        linear_damping=None, quadratic_damping=None, fins=(),
    )  # fmt: skip
    what = task(drift, actuation="wrench", rows=31)
    what = dataclasses.replace(what, command=0 * what.command)
    run = move("numpy", what)
    momentum = run.nu @ drift.inertia_matrix.T
    rotation = Rotation.from_quat(run.eta[..., 3:].reshape(-1, 4), scalar_first=True).as_matrix()
    rotation = rotation.reshape(*run.nu.shape[:2], 3, 3)
    linear = np.einsum("rtij,rtj->rti", rotation, momentum[..., :3])
    angular = np.einsum("rtij,rtj->rti", rotation, momentum[..., 3:]) + np.cross(run.eta[..., :3], linear)
    energy = 0.5 * (run.nu * momentum).sum(-1)
    for kept in (linear, angular, energy[..., None]):
        assert np.abs(kept - kept[:, :1]).max() < 1e-8 * np.abs(kept).max()
    assert np.abs(run.nu[:, -1] - run.nu[:, 0]).max() > 0.01


def test_a_lag_and_a_delay_give_the_closed_form():
    # One axis, no drag: m u_dot = T(t - d), T towards the command with tau; integrated by hand.
    known = load_vehicle("rov95")
    bare = dataclasses.replace(
        known, buoyancy=known.weight, center_of_gravity=np.zeros(3), center_of_buoyancy=np.zeros(3),
        linear_damping=None, quadratic_damping=None, damping_elements=(),
        added_mass=np.diag(np.diagonal(known.added_mass)),
    )  # fmt: skip
    tau, delay = 0.13, 0.17
    what = task(bare, {"thruster_lag": {"time_constant": tau}, "actuation_delay": {"delay": delay}},
                actuation="wrench", rows=21, runs=1)  # fmt: skip
    eta0 = np.array([[0.0, 0, 1, 1, 0, 0, 0]])
    command = np.zeros_like(what.command)
    command[:, 4:, 0] = 20.0
    run = move("numpy", dataclasses.replace(what, eta0=eta0, nu0=np.zeros((1, 6)), command=command))
    since = np.maximum(what.t - what.t[4] - delay, 0.0)
    mass = bare.mass + bare.added_mass[0, 0]
    expected = 20.0 / mass * (since - tau * (1.0 - np.exp(-since / tau)))
    assert run.nu[0, :, 0] == pytest.approx(expected, abs=1e-9)
    assert run.nu_dot[0, :, 0] == pytest.approx(20.0 / mass * (1.0 - np.exp(-since / tau)), abs=1e-7)


def test_simulated_log_is_the_same_in_closed_loop():
    model = GreyBox(load_vehicle("rov95"))
    how = {
        "hidden": {"ocean_current": {"v_north": 0.2, "v_east": 0.1}},
        "runs": 2,
        "duration": 2.0,
        "rate": 10.0,
    }
    logs = [simulate(model, "survey", "realistic", plant=p, **how) for p in ("own", "numpy")]
    assert [m.truth["conditions"]["plant"] for m in logs] == ["own", "numpy"]
    for a, b in zip(*(m.log.runs for m in logs), strict=True):
        assert a.nu == pytest.approx(b.nu, abs=1e-6)
        assert a.position == pytest.approx(b.position, abs=1e-6)
        assert a.thrusters == pytest.approx(b.thrusters, abs=1e-4)


def test_drawn_coefficients_are_the_same():
    model = GreyBox(load_vehicle("rov95"))
    how = {"coefficients": "drawn", "runs": 1, "duration": 1.0, "rate": 10.0, "accelerations": True}
    a, b = (simulate(model, "multisine", plant=p, **how, noise="none").log.runs[0] for p in ("own", "numpy"))
    assert a.nu_dot == pytest.approx(b.nu_dot, abs=1e-5)


def test_what_it_does_not_know_is_refused():
    model = GreyBox(load_vehicle("rov95"))
    short = {"runs": 1, "duration": 1.0, "rate": 10.0}
    with pytest.raises(ConfigError, match=r"no plant called 'nunpy'\. Did you mean 'numpy'"):
        simulate(model, plant="nunpy", **short, noise="none")
    with pytest.raises(ConfigError, match=r"residual_force.*no equations.*plant=own"):
        simulate(model.with_effects(["residual_force"]), plant="numpy", **short, noise="none")
    learned = GreyBox(load_vehicle("rov95"), damping=DampingBank.from_description("zero"))
    with pytest.raises(ConfigError, match=r"damping subnetworks.*plant=own"):
        simulate(learned, plant="numpy", **short, noise="none")


def test_divergence_says_when_and_by_what():
    known = unchecked(load_vehicle("rov95"), quadratic_damping=-2e3 * np.eye(6))
    what = task(known, actuation="wrench", rows=200)
    with pytest.raises(AuvnnError, match=r"rov95: run \d diverged after .* s; the largest term was drag"):
        move("numpy", what)


def test_longer_steps_are_hidden_by_noise():
    """The noise is of milliradians and millimetres per second; thrown about as here, longer steps change 2 % of that."""
    vehicle = "bluerov2_heavy"
    fine, coarse = (move("numpy", task(vehicle, {"ocean_current": plausible("ocean_current", vehicle)}, max_step=h))
                    for h in (0.01, 0.025))  # fmt: skip
    assert 0.0 < np.abs(fine.nu - coarse.nu).max() < 1e-4
