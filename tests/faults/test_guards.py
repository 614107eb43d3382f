"""Rows 56, 60, 83 to 87, 94 and 95: models against logs that contradict them, and runs beyond what is known."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from auvnn.checks import check_actuators
from auvnn.checks.doubts import doubts, stiff
from auvnn.comparison import compare
from auvnn.damping.bank import DampingBank
from auvnn.damping.region import Region
from auvnn.errors import ConfigError, InputError, ModelError
from auvnn.logs import Log
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox, from_vehicle, load, save
from auvnn.physics.products import matvec
from auvnn.simulation import simulate
from auvnn.testing import plain_vehicle
from auvnn.vehicle import load_vehicle
from tests.faults.vehicles import put
from tests.log_samples import frame
from tests.small_logs import make_log, small_vehicle

# What a rollout in single precision may differ from one in double, relative to the largest value of the channel, over
# 5 s; and what the number of threads may change in double precision. The README states both.
SINGLE, THREADS = 1e-4, 1e-12

MODEL = from_vehicle(small_vehicle())


@pytest.fixture(scope="module")
def driven() -> Log:
    """A log in which all eight thrusters move on their own; steps of 0.1 s, noisy velocities, no accelerations."""
    return make_log(MODEL, runs=2, duration=40.0, noise=1.0, max_step=0.05)


def rewired(log: Log, place: dict[int, int], signs: dict[int, int] | None = None) -> Log:
    """The log with its command columns exchanged and turned."""
    order, sign = list(range(8)), np.ones(8)
    for i, k in place.items():
        order[i] = k
    for i, s in (signs or {}).items():
        sign[i] = s
    return Log.from_runs([replace(r, thrusters=r.thrusters[:, order] * sign) for r in log.runs])


def test_row_56_thrusters_as_stated_raise_no_doubt(driven):
    found = check_actuators(MODEL, driven)
    assert found.as_stated and found.findings == [] and found.words == [] and found.untold == []
    assert found.confidence > 0.95
    np.testing.assert_allclose(found.gains, 1.0, atol=0.25)


@pytest.mark.parametrize(
    ("place", "signs", "words"),
    [
        ({}, {2: -1}, ["thruster_3 is reversed"]),
        ({0: 3, 3: 0}, {}, ["thruster_1 and thruster_4 are exchanged"]),
        ({4: 6, 6: 4}, {1: -1}, ["thruster_2 is reversed", "thruster_5 and thruster_7 are exchanged"]),
        ({0: 1, 1: 2, 2: 0}, {}, ["are exchanged"]),
    ],
    ids=["reversed", "exchanged", "both", "three in a ring"],
)
def test_row_56_reversed_and_exchanged_thrusters_are_named(driven, place, signs, words):
    found = check_actuators(MODEL, rewired(driven, place, signs))
    assert found.sure and not found.as_stated
    for part in words:
        assert any(part in f for f in found.findings), found.findings
    # Column i of the spoilt log holds the command of thruster place[i]: that is what the answer must say.
    assert list(found.assignment.place) == [place.get(i, i) for i in range(8)]
    assert list(found.assignment.sign) == [signs.get(i, 1) for i in range(8)]


def test_row_56_what_is_not_driven_alone_is_not_judged(driven):
    same = Log.from_runs(
        [replace(r, thrusters=np.repeat(r.thrusters[:, :1], 8, axis=1)) for r in driven.runs]
    )
    found = check_actuators(MODEL, same)
    assert found.words == [] and len(found.untold) == 8
    assert "nothing can be said" in found.story[0]


def test_row_56_check_and_compare_say_so(driven, auvnn):
    put("small.yaml", **{k: v for k, v in MODEL.vehicle.to_dict().items() if k != "effects"})
    frame(rewired(driven, {}, {2: -1}).runs[0]).write_parquet("log.parquet")
    status, out, _ = auvnn("check", "log=log.parquet", "model=small.yaml", "out=checked")
    assert status == 0 and "thruster_3 is reversed" in out
    data = json.loads(Path("checked/quality.json").read_text())
    assert (
        data["actuators"]["findings"] == ["thruster_3 is reversed"] and data["actuators"]["confidence"] > 0.95
    )
    assert any(f["where"] == "actuators" and f["level"] == "warning" for f in data["findings"])
    assert any("thruster_3 is reversed" in w for w in doubts(MODEL, Log.read("log.parquet")))


def test_row_60_a_current_that_only_the_model_can_show():
    truth = MODEL.with_effects({"ocean_current": {"v_north": 0.25, "v_east": -0.15}})
    log = make_log(truth, runs=2, duration=60.0, noise=0.5, max_step=0.05)
    words = [w for w in doubts(MODEL, log) if "current" in w]
    assert len(words) == 1 and "consider the effect ocean_current" in words[0]
    north, east = map(float, re.findall(r"(-?[\d.]+)(?: m/s)? (?:north|east)", words[0]))
    assert abs(north - 0.25) < 0.08 and abs(east + 0.15) < 0.08
    assert not any("current" in w for w in doubts(truth, log)), "a model that has the current has no doubt"
    assert not any(
        "current" in w for w in doubts(MODEL, make_log(MODEL, duration=60.0, noise=0.5, max_step=0.05))
    )


def test_row_60_a_model_that_leaves_nothing_at_all_raises_no_doubt():
    exact = simulate(load("rov95"), "multisine", "none", runs=1, duration=15.0).log
    assert doubts(load("rov95"), exact) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"inertia": [0.0, 2.5, 3.0]}, "inertia[0][0] (I_xx) is 0: must be positive"),
        ({"inertia": [2.0, 2.5, 0.0]}, "inertia[2][2] (I_zz) is 0: must be positive"),
        ({"mass": 0.0}, "mass"),
        ({"buoyancy": 0.0}, "buoyancy"),
    ],
)
def test_row_83_no_inertia_or_no_volume(refused, good, change, words):
    line = refused("compare", f"model={put('none.yaml', **change)}", "log=good.csv")
    assert "none.yaml" in line and words in line and "0" in line


def stiff_model(rate: float) -> GreyBox:
    """A body whose surge dies out at this rate by linear drag, 1/s: M_11 = 70 kg."""
    damping = [70.0 * rate, 10.0, 10.0, 1.0, 1.0, 1.0]
    return GreyBox(plain_vehicle(linear_damping=damping), actuation="wrench")


def test_row_84_stiff_damping_is_followed_in_shorter_steps():
    """A time constant of 2 ms against rows of 0.1 s: the closed form is met, and the cut steps are told."""
    model, t = stiff_model(500.0), torch.arange(0.0, 1.05, 0.1).double()
    command = torch.zeros(11, 6).double()
    command[:, 0] = 7000.0
    eta, nu = torch.tensor([[0.0, 0, 0, 1, 0, 0, 0]]).double(), torch.zeros(1, 6).double()
    run = model.rollout(eta, nu, command.expand(1, 11, 6), t, max_step=0.1)
    assert not run.diverged
    settled = 7000.0 / (70.0 * 500.0)
    np.testing.assert_allclose(run.nu[0, 1:, 0].numpy(), settled, rtol=1e-6)
    assert (
        len(run.notes) == 1
        and "velocities settle within 2 ms" in run.notes[0]
        and "steps of 100 ms" in run.notes[0]
    )
    assert stiff_model(5.0).rollout(eta, nu, command.expand(1, 11, 6), t, max_step=0.05).notes == ()
    assert model.rollout(eta, nu, command.expand(1, 11, 6), t, max_step=0.1, check=False).nu.abs().max() > 1e3


def test_row_84_a_lag_far_below_the_step_is_exact_and_told():
    model = GreyBox(plain_vehicle(linear_damping=[70.0, 10, 10, 1, 1, 1]), actuation="wrench")
    lagged = model.with_effects({"thruster_lag": {"time_constant": 0.001}})
    t = torch.arange(0.0, 2.05, 0.1).double()
    command = torch.zeros(21, 6).double()
    command[1:, 0] = 70.0
    start = torch.tensor([0.0, 0, 0, 1, 0, 0, 0]).double(), torch.zeros(6).double()
    u = lagged.rollout(*start, command, t, max_step=0.1).nu[:, 0].detach().numpy()
    # u' = -u + T/70 with T' = (70 - T)/tau from 0.1 s on: 1 - (exp(-s) - tau exp(-s/tau)) / (1 - tau).
    s = np.maximum(t.numpy() - 0.1, 0.0)
    np.testing.assert_allclose(u, 1 - (np.exp(-s) - 0.001 * np.exp(-s / 0.001)) / 0.999, atol=2e-6)
    log = make_log(from_vehicle(small_vehicle()), runs=1, duration=10.0)
    slow = from_vehicle(small_vehicle()).with_effects({"thruster_lag": {"time_constant": 0.001}})
    assert any(
        "thruster_lag: time_constant 0.001 s is far below the log's step of 0.1 s" in w
        for w in stiff(slow, log)
    )
    assert stiff(MODEL, log) == []


def test_row_84_a_comparison_with_a_stiff_model_stays_finite_and_warns():
    log = make_log(MODEL, runs=1, duration=12.0)
    hard = from_vehicle(small_vehicle(linear_damping=[25.0, 35.0, 40.0, 4000.0, 5.0, 5.0]))
    answer = compare(hard, log, horizons=(1,))
    assert answer.rollout["1"]["diverged"] == 0 and answer.rollout["1"]["total"] is not None
    assert any("the model is stiff: velocities settle within" in w for w in answer.warnings)


def test_row_86_a_budget_of_steps(monkeypatch):
    import auvnn.models.free_running.torchdiffeq_solver as solver

    eta, nu = torch.tensor([0.0, 0, 0, 1, 0, 0, 0]).double(), torch.full((6,), 0.1).double()
    command, t = torch.zeros(3, 6).double(), torch.tensor([0.0, 0.5, 1.0]).double()
    model = stiff_model(1.0)
    with pytest.raises(
        ConfigError, match=r"max_step=1e-09 s makes .* steps, more than the budget of 5000000"
    ):
        model.rollout(eta, nu, command, t, max_step=1e-9)
    monkeypatch.setattr(solver, "MAX_EVALUATIONS", 40)
    with pytest.raises(
        ConfigError, match=r"dopri5 gave up at t = 0 s after 40 evaluations: loosen rtol and atol"
    ):
        model.rollout(eta, nu, command, t, solver="torchdiffeq:dopri5", rtol=1e-13, atol=1e-15)


def learned() -> GreyBox:
    """A model with subnetworks that say they were trained up to 0.5 m/s and 0.3 rad/s."""
    bank = DampingBank.from_description({"form": "polynomial", "coupled": False})
    bank.region = Region((-0.5,) * 3 + (-0.3,) * 3, (0.5,) * 3 + (0.3,) * 3)
    return GreyBox(plain_vehicle(linear_damping=[50.0, 50, 50, 5, 5, 5]), (), bank, "wrench")


def test_row_87_leaving_the_trained_region_is_flagged(tmp_path):
    model, t = learned(), torch.arange(0.0, 3.05, 0.1).double()
    command = torch.zeros(31, 6).double()
    eta, nu = torch.tensor([0.0, 0, 0, 1, 0, 0, 0]).double(), torch.zeros(6).double()
    command[:, 0] = 10.0
    assert model.rollout(eta, nu, command, t).notes == ()
    command[:, 0] = 80.0
    (note,) = model.rollout(eta, nu, command, t).notes
    assert (
        note.startswith("beyond what the damping was trained on")
        and "against -0.5 to 0.5" in note
        and "u " in note
    )
    save(model, tmp_path / "model")
    assert load(tmp_path / "model").damping.region == model.damping.region
    assert model.rebuilt(()).damping.region == model.damping.region
    (tmp_path / "model" / "model.yaml").write_text(
        (tmp_path / "model" / "model.yaml").read_text().replace("trained_region:", "trained_regoin:")
    )
    with pytest.raises(ModelError):
        load(tmp_path / "model")


def test_row_87_the_region_is_through_the_water():
    """In a current of 1 m/s a vehicle at rest over ground is outside of what was learned."""
    current = learned().with_effects({"ocean_current": {"v_north": 1.0}})
    t = torch.tensor([0.0, 0.05]).double()
    eta, nu = torch.tensor([0.0, 0, 0, 1, 0, 0, 0]).double(), torch.zeros(6).double()
    assert "u -" in current.rollout(eta, nu, torch.zeros(2, 6).double(), t).notes[0]


def test_row_87_training_keeps_its_region_and_compare_warns():
    from auvnn.training.fit_damping import fit_damping
    from auvnn.training.problem import DampingProblem

    rng = np.random.default_rng(0)
    nu = torch.tensor(rng.uniform(-0.2, 0.2, (300, 6)))
    bank = DampingBank.from_description({"form": "polynomial", "coupled": False})
    fit_damping(bank, DampingProblem(nu, 5.0 * nu))
    assert bank.region is not None
    np.testing.assert_allclose(bank.region.high, nu.amax(0), atol=1e-12)
    vehicle = small_vehicle()
    log = make_log(MODEL, runs=1, duration=12.0, size=1.5)
    warnings = compare(GreyBox(vehicle, (), bank), log, horizons=(1,)).warnings
    assert any("free runs go beyond what the damping was trained on" in w for w in warnings)


def run_of(model: GreyBox, log: Log, dtype: torch.dtype) -> torch.Tensor:
    run = log.runs[0]
    part = {
        k: torch.tensor(v[:51], dtype=dtype)
        for k, v in (("c", run.thrusters), ("eta", run.eta), ("nu", run.nu))
    }
    t = torch.tensor(run.t[:51], dtype=torch.float64)
    with torch.no_grad():
        return model.to(dtype).rollout(part["eta"][0], part["nu"][0], part["c"], t).nu


def test_row_94_single_precision_and_threads_within_the_stated_tolerance(driven):
    wide = run_of(from_vehicle(small_vehicle()), driven, torch.float64)
    narrow = run_of(from_vehicle(small_vehicle()), driven, torch.float32)
    assert narrow.dtype == torch.float32
    scale = wide.abs().amax(0)
    assert float(((narrow.double() - wide).abs() / scale).max()) < SINGLE
    before = torch.get_num_threads()
    answers = []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            answers.append(roll(MODEL, driven, "5", scale_of(driven)).predicted)
    finally:
        torch.set_num_threads(before)
    np.testing.assert_allclose(answers[0], answers[1], rtol=THREADS, atol=THREADS)


def test_row_95_a_batch_of_one_and_a_single_time():
    log = make_log(MODEL, runs=1, duration=5.0)
    run = log.runs[0]
    eta, nu = torch.tensor(run.eta[0]), torch.tensor(run.nu[0])
    command, t = torch.tensor(run.thrusters), torch.tensor(run.t)
    with torch.no_grad():
        alone = MODEL.rollout(eta, nu, command, t)
        batch = MODEL.rollout(eta.expand(1, 7), nu.expand(1, 6), command.expand(1, -1, -1), t)
        single = MODEL.rollout(eta, nu, command[:1], t[:1])
        of_one = MODEL(eta.expand(1, 7), nu.expand(1, 6), command[:1])
    assert batch.nu.shape == (1, *alone.nu.shape)
    np.testing.assert_allclose(batch.nu[0], alone.nu, atol=1e-12)
    np.testing.assert_array_equal(single.nu[0], nu)
    np.testing.assert_allclose(of_one[0], MODEL(eta, nu, command[0]).detach(), atol=1e-14)


@pytest.mark.parametrize("horizon", [0, -1, "0", float("nan")])
def test_row_95_a_horizon_of_no_length_is_refused(horizon):
    log = make_log(MODEL, runs=1, duration=5.0)
    with pytest.raises(ConfigError, match="must be a number of seconds above zero"):
        compare(MODEL, log, horizons=(horizon,))
    with pytest.raises(ConfigError, match="leave at least one to run from"):
        MODEL.rollout(torch.zeros(7), torch.zeros(6), torch.zeros(2, 8), torch.zeros(2), warmup=2)


def test_row_95_runs_of_different_lengths_do_not_disturb_one_another():
    long, short = (
        make_log(MODEL, runs=1, duration=12.0),
        make_log(MODEL, runs=1, duration=5.0, seed=1, first=2),
    )
    both = Log.from_runs([long.runs[0], replace(short.runs[0], number=2)])
    scale = scale_of(both)
    together, alone = roll(MODEL, both, "full", scale), roll(MODEL, short, "full", scale)
    assert together.windows.length.tolist() == [121, 51]
    np.testing.assert_allclose(together.predicted[1, :51], alone.predicted[0], atol=1e-10)
    assert together.count[1].max() == 50, "what is padded does not count"
    with pytest.raises(InputError, match="choose a shorter horizon"):
        cut_windows(short, 60.0)


def test_the_fastest_rate_is_that_of_the_linear_model():
    from auvnn.models.free_running.stiffness import fastest_rate

    model = stiff_model(80.0)
    eta, nu = torch.tensor([[0.0, 0, 0, 1, 0, 0, 0]]).double(), torch.zeros(1, 6).double()
    body = model.prepare()
    exact = torch.linalg.eigvals(matvec(body.inverse, body.body.linear.mT).mT).abs().max()
    assert fastest_rate(model, eta, nu, torch.zeros(1, 6).double()) == pytest.approx(float(exact), rel=1e-6)
    assert load_vehicle("rov95").has_damping  # a built-in model is none that needs shorter steps
    rov = load("rov95")
    fast = fastest_rate(rov, eta, 0.5 + nu, torch.zeros(1, rov.actuators.size).double())
    assert fast < 20.0
