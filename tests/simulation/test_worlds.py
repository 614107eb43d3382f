"""Worlds against figures of their own: theory of the wandering force, held commands, shares of what is spoilt."""

import numpy as np
import pytest

from auvnn.errors import ConfigError
from auvnn.models import load
from auvnn.simulation import simulate
from auvnn.simulation.noise import make_noise
from auvnn.simulation.worlds import World, make_world
from auvnn.simulation.worlds.law import commanded_wrench, ornstein_uhlenbeck
from auvnn.simulation.worlds.sensing import Sensing
from auvnn.simulation.worlds.world import Sensors, world_names

SHORT = {"runs": 1, "duration": 4.0, "plant": "numpy", "max_step": 0.025}


@pytest.fixture(scope="module")
def model():
    return load("rov95")


def streams(count, key=0):
    return [np.random.default_rng([key, i]) for i in range(count)]


def test_the_wandering_force_has_the_variance_and_the_memory_of_theory():
    rms, times = np.array([1.0, 2.0, 0.5, 3.0, 0.0, 1.0]), np.array([0.5, 0.8, 1.0, 2.0, 1.0, 0.6])
    h, count = 0.025, 4000
    values = ornstein_uhlenbeck(rms, times, h, count, streams(40)).values
    live = rms > 0
    assert np.all(values[..., ~live] == 0.0)
    found = np.sqrt((values**2).mean((0, 1)))
    # Standard error of a variance with 2 T / (N h) independent parts.
    error = np.sqrt(times / (40 * count * h))
    assert np.all(np.abs(found[live] / rms[live] - 1.0) < 4.0 * error[live])
    lag = np.round(times / h).astype(int)
    for i in np.flatnonzero(live):
        product = (values[:, lag[i] :, i] * values[:, : -lag[i], i]).mean() / found[i] ** 2
        assert product == pytest.approx(np.exp(-lag[i] * h / times[i]), abs=8.0 * error[i])
    # Stationary from the first knot.
    first = np.sqrt((ornstein_uhlenbeck(rms, times, h, 2, streams(4000)).values[:, 0] ** 2).mean(0))
    assert first[live] == pytest.approx(rms[live], rel=0.06)


def test_commands_between_samples_are_those_of_a_faster_log(model):
    fast = simulate(model, "survey", "realistic", seed=3, rate=100.0, **SHORT)
    thin = simulate(model, "survey", "realistic", seed=3, rate=5.0, world="between", **SHORT)
    whole, part = fast.log.runs[0], thin.log.runs[0]
    for name in ("t", "nu", "quaternion", "position", "thrusters"):
        assert getattr(part, name) == pytest.approx(getattr(whole, name)[::20], abs=1e-12), name
    # Between two rows the commands do change.
    spread = np.stack([whole.thrusters[i : i + 20].std(0) for i in range(0, 380, 20)])
    assert spread.max() > 0.02
    assert {n: p.shape for n, p in thin.set_points.items()}["depth"] == (1, len(part.t))


def test_rates_that_do_not_fit_are_refused(model):
    with pytest.raises(ConfigError, match=r"rate = 30: world between changes commands at 100 Hz"):
        simulate(model, world="between", rate=30.0, **SHORT, noise="none")
    with pytest.raises(ConfigError, match="rate = 200"):
        simulate(model, world="between", rate=200.0, **SHORT, noise="none")


def test_the_force_is_a_share_of_what_is_commanded_and_does_not_hang_on_what_is_hidden(model):
    plain = simulate(model, "multisine", "none", seed=5, **SHORT)
    made = [
        simulate(model, "multisine", "none", hidden, seed=5, world="disturbed_25", **SHORT)
        for hidden in (None, {"net_buoyancy": {"force": 20.0}})
    ]
    run = plain.log.runs[0]
    columns = np.array(
        [[*u.direction, *np.cross(u.position, u.direction)] for u in model.vehicle.thrusters]
    ).T
    most = np.array([np.where(run.thrusters > 0, [u.max_forward for u in model.vehicle.thrusters],
                              [u.max_reverse for u in model.vehicle.thrusters])])[0]  # fmt: skip
    wrench = (most * run.thrusters * np.abs(run.thrusters)) @ columns.T
    told = [m.truth["world"]["drawn"]["force"] for m in made]
    assert told[0] == told[1]
    assert told[0]["rms"] == pytest.approx(0.25 * np.sqrt((wrench**2).mean(0)), rel=1e-9, abs=1e-9)
    assert all(0.5 <= t <= 5.0 for t in told[0]["correlation"])
    # Seen in the motion: with it, the velocities are others.
    assert np.abs(made[0].log.runs[0].nu - run.nu).max() > 0.01


def test_fins_count_among_what_is_commanded():
    known = load("remus100")
    made = simulate(known, "multisine", "none", seed=2, **SHORT)
    motion = type("Motion", (), {"command": made.log.runs[0].thrusters[None], "fins": made.log.runs[0].fins[None],
                                 "nu": made.log.runs[0].nu[None]})  # fmt: skip
    wrench = commanded_wrench(known.vehicle, "thrusters", motion)
    assert np.sqrt((wrench**2).mean((0, 1)))[[1, 2, 4, 5]].min() > 0.1


@pytest.fixture(scope="module")
def spoilt():
    sensors = Sensors(
        correlation=0.5, outliers=0.01, dropouts=0.05, velocity_rate=5.0, tilt=0.01, jitter=0.005
    )
    return Sensing(
        sensors, make_noise("realistic"), 0.05, 20_000, streams(2), streams(2, 1), np.random.default_rng(3)
    )


def test_sensors_spoil_as_much_as_they_say(spoilt):
    rows = 20_000
    truth = np.zeros((2, rows, 6))
    level = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (2, rows, 4))
    place, attitude, nu = spoilt.record(np.zeros((2, rows, 3)), level, truth)
    for part in (place, attitude, nu[..., :3], nu[..., 3:]):
        assert np.isnan(part[..., 0]).mean() == pytest.approx(0.05, abs=0.012)
    rates = nu[..., 3][np.isfinite(nu[..., 3])]
    assert (np.abs(rates) > 6.0 * 0.003).mean() == pytest.approx(0.01, abs=0.003)
    # Held at 5 Hz: three of four steps repeat the last value.
    u = nu[..., 0]
    same = (np.diff(u, axis=1) == 0.0)[np.isfinite(np.diff(u, axis=1))]
    assert same.mean() == pytest.approx(0.75, abs=0.02)
    # The vertical is off by 0.01 rad: mean attitude, whatever the noise.
    mean = np.nanmean(attitude, axis=(0, 1))
    assert 2.0 * np.linalg.norm(mean[1:]) == pytest.approx(0.01, rel=0.1)
    late = spoilt.stamps(0.05 * np.arange(rows)) - 0.05 * np.arange(rows)
    assert late.std() == pytest.approx(0.005, rel=0.03) and (np.diff(0.05 * np.arange(rows) + late) > 0).all()


def test_noise_with_a_memory_has_the_same_size_and_the_stated_memory(spoilt):
    truth = np.zeros((2, 20_000, 3))
    x = spoilt.draws.added("x", truth)
    assert x.std((0, 1)) == pytest.approx([0.05, 0.05, 0.01], rel=0.05)
    lagged = (x[:, 10:] * x[:, :-10]).mean((0, 1)) / (x**2).mean((0, 1))
    assert lagged == pytest.approx(np.exp(-1.0), abs=0.06)


def test_a_controller_sees_neither_outliers_nor_gaps(spoilt):
    seen = np.stack([spoilt.look(k, np.zeros((2, 3)), np.tile([1.0, 0, 0, 0], (2, 1)), np.zeros((2, 6)))[2]
                     for k in range(400)])  # fmt: skip
    assert np.isfinite(seen).all() and np.abs(seen[..., 3:]).max() < 6.0 * 0.003
    assert (np.diff(seen[..., 0], axis=0) == 0.0).mean() == pytest.approx(0.75, abs=0.02)


def test_a_log_of_the_usual_world_is_what_it_was(model):
    one = simulate(model, "survey", "realistic", seed=4, runs=1, duration=2.0)
    other = simulate(model, "survey", "realistic", seed=4, runs=1, duration=2.0, world=World())
    assert np.array_equal(one.log.runs[0].nu, other.log.runs[0].nu)
    assert "world" not in one.truth and other.truth["world"]["name"] == "custom"


def test_every_shipped_world_can_be_read_and_says_what_is_true_in_it():
    from auvnn.effects import EFFECTS

    assert set(world_names()) == {
        "between", "disturbed_10", "disturbed_25", "shaped", "sensors", "conventions", "everything"
    }  # fmt: skip
    for name in world_names():
        assert make_world(name).name == name
    assert "thruster_gain" in make_world("shaped").true_names
    assert make_world("sensors").true_names == ("tilted_vertical",)
    assert {n for w in world_names() for n in make_world(w).true_names} <= {*EFFECTS.names()}
    mild = make_world({"name": "disturbed_25", "disturbance": {"share": 0.05}})
    assert (mild.disturbance.share, mild.disturbance.correlation) == (0.05, (0.5, 5.0))


@pytest.mark.parametrize(("given", "words"), [
    ("betwen", "no world called 'betwen'. Did you mean 'between'"),
    ({"name": "x", "sensor": {}}, "no option of a world called 'sensor'. Did you mean 'sensors'"),
    ({"name": "x", "shape": {"exponents": [1, 2]}}, "no option of world.shape called 'exponents'"),
    ({"name": "x", "shape": {"exponent": [2.2, 1.7]}}, "world.shape.exponent = .*two rising numbers from 1 to 4"),
    ({"name": "x", "disturbance": {"share": -1}}, "world.disturbance.share = -1: a number from 0 to 10"),
])  # fmt: skip
def test_what_is_no_world_is_refused(given, words):
    with pytest.raises(ConfigError, match=words):
        make_world(given)
