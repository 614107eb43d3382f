"""Sums over parts give what the whole log in memory gives, whoever computes them and whoever dies meanwhile."""

from __future__ import annotations

import json
import os
import signal
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.full_data import large_logs as many
from auvnn.diagnosis.full_data.full_data import score_tests
from auvnn.diagnosis.full_data.large_logs import diagnose_files
from auvnn.diagnosis.full_data.map_reduce import LinearisationPoint, MapReduce, PartTask, sums_of
from auvnn.diagnosis.hypotheses.standard_errors import standard_errors
from auvnn.diagnosis.score_tests import few_windows
from auvnn.diagnosis.score_tests.probes import probed
from auvnn.diagnosis.score_tests.score import score
from auvnn.errors import ConfigError, InputError
from auvnn.estimation.trajectories.initial_states import fit_initial_states
from auvnn.estimation.window_sums.sufficient_statistics import ScoreMoments, add_parts, reduce_windows
from auvnn.executors import executor_for
from auvnn.log_chunks import scan as parts_
from auvnn.log_chunks.scan import Plan, WindowCut
from auvnn.log_chunks.windows import plan_files
from auvnn.logs import Log
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.metrics.commands.stated import as_stated
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands
from tests.small_logs import make_log, small_vehicle

CURRENT = {"ocean_current": {"v_north": 0.15, "v_east": -0.1}}
EFFECTS = ["ocean_current", "net_buoyancy"]
UNCERTAIN = {"added_mass": 0.1}


def vehicle(**changes: Any) -> Any:
    return small_vehicle(UNCERTAIN, **changes)


@pytest.fixture(scope="module")
def paths(tmp_path_factory) -> list[Path]:
    folder = tmp_path_factory.mktemp("dives")
    truth = GreyBox(vehicle()).with_effects(CURRENT)
    return [
        make_log(truth, runs=1, duration=16.0, rate=10.0, noise=1.0, seed=seed).write(
            folder / f"dive{seed}.parquet"
        )
        for seed in range(3)
    ]


@pytest.fixture
def small_parts(monkeypatch) -> None:
    monkeypatch.setattr(parts_, "ROWS", 170)
    monkeypatch.setattr(parts_, "WINDOWS", 4)


def planned(paths: list[Path]) -> tuple[Plan, WindowCut]:
    cut = WindowCut(2.0, 1.5, "thrusters", Mapping.read(None))
    return plan_files(paths, cut), cut


def point(paths: list[Path], cut: WindowCut, asked: list[str]) -> tuple[LinearisationPoint, Any, list[str]]:
    """Stand at a point that no fit has chosen, so that nothing vanishes there."""
    from auvnn.diagnosis.hypotheses.stated_priors import lay_out
    from auvnn.diagnosis.score_tests.probes import extent_of

    windows = cut_windows(Log.read(paths), 2.0, warmup=1.5, kind="thrusters", partial=True)
    layout = lay_out(GreyBox(vehicle()), asked)
    sigma = np.full(18, np.inf)
    sigma[:12] = [0.02] * 3 + [0.003] * 3 + [0.004] * 6
    base = [n for n in layout.names if n in layout.nuisance]
    return LinearisationPoint(layout, tuple(asked), extent_of(windows), None, sigma, cut), windows, base


def close(one: Any, other: Any) -> None:
    one, other = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    scale = np.nanmax(np.abs(other)) if other.size else 1.0
    assert np.allclose(one, other, rtol=1e-10, atol=1e-10 * max(scale, 1e-300), equal_nan=True)


@pytest.mark.parametrize("few", [40.0, 0.0])
def test_tests_of_effects_are_those_of_the_log_in_memory(paths, small_parts, monkeypatch, few):
    monkeypatch.setattr(few_windows, "FEW", few)
    asked = ["ocean_current", "payload"]
    plan, cut = planned(paths)
    at, windows, base = point(paths, cut, asked)
    assert len(plan.parts) > 5 and plan.windows == len(windows)
    with executor_for() as pool:
        found = score_tests(MapReduce(pool, plan.parts), at, base, asked)
    held = probed(at.layout, asked, at.extent)
    model = held.layout.model
    statistics, _ = reduce_windows(
        model, windows, fit_initial_states(model, windows, at.sigma), model.effect_names, at.sigma
    )
    close(found.sums.hessian, statistics.total)
    close(found.sums.slope, statistics.slope.sum(0))
    close(found.sums.cost, statistics.cost.sum())
    for name in asked:
        alone, _ = held.best(name, lambda label: score(statistics, held.layout, base, label))
        for field in ("p_value", "statistic", "inflation", "estimate", "std", "evidence", "gain"):
            close(getattr(found.scores[name], field), getattr(alone, field))
        assert found.scores[name].degrees == alone.degrees


def test_parts_go_between_samples_as_the_model_states(paths, small_parts):
    asked = ["ocean_current"]
    plan, cut = planned(paths)
    at, windows, base = point(paths, cut, asked)
    path = CommandPath("linear", 0.5, 0.1)
    stated = replace(at, layout=replace(at.layout, model=with_commands(at.layout.model, path)))
    with executor_for() as pool:
        held, found = (score_tests(MapReduce(pool, plan.parts), p, base, asked) for p in (at, stated))
    model = stated.probed.layout.model
    assert model.commands == path
    along = as_stated(model, windows)
    statistics, _ = reduce_windows(
        model, along, fit_initial_states(model, along, at.sigma), model.effect_names, at.sigma
    )
    close(found.sums.cost, statistics.cost.sum())
    close(found.sums.slope, statistics.slope.sum(0))
    assert not np.allclose(found.sums.cost, held.sums.cost, rtol=0.05)


def test_moments_of_parts_are_those_of_all():
    random = np.random.default_rng(0)
    vectors, run = random.normal(size=(40, 3)), np.repeat([1, 2, 3], [11, 9, 20])
    cuts = [0, 1, 8, 20, 33, 40]
    parts = [ScoreMoments.of(vectors[a:b], run[a:b]) for a, b in pairwise(cuts)]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    centred = vectors - vectors.mean(0)
    beside = run[1:] == run[:-1]
    lagged = centred[1:][beside].T @ centred[:-1][beside]
    close(total.spread(), centred.T @ centred + 0.5 * (lagged + lagged.T))


def deadly(shared: tuple[str, LinearisationPoint], task: PartTask) -> Any:
    """Compute a part, but die the first time that the third one comes along."""
    mark, at = Path(shared[0]), shared[1]
    if task.part.number == 4 and "dive1" in task.part.path.name and not mark.exists():
        mark.write_text("")
        os.kill(os.getpid(), signal.SIGKILL)
    return sums_of(at, task)


@pytest.mark.long
@pytest.mark.parametrize("name", ["processes", "ray", "dask"])
def test_a_worker_that_is_killed_changes_nothing(paths, small_parts, tmp_path, monkeypatch, name):
    if name != "processes":
        pytest.importorskip("ray" if name == "ray" else "distributed")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), *sys.path]))
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    module = __import__(Path(__file__).stem)
    plan, cut = planned(paths)
    at, _, _ = point(paths, cut, EFFECTS)
    tasks = [PartTask(p) for p in plan.parts]
    alone = [sums_of(at, task) for task in tasks]
    with executor_for(name, 2) as pool:
        spread = list(pool.run(module.deadly, (str(tmp_path / "mark"), at), tasks))
    assert (tmp_path / "mark").exists()
    one, two = add_parts(s for s, _, _ in alone), add_parts(s for s, _, _ in spread)
    for field in vars(one):
        close(getattr(two, field), getattr(one, field))


def test_a_log_that_is_small_gives_the_answer_of_diagnose(paths):
    model = GreyBox(vehicle())
    log = Log.read(paths)
    options = {"window": 2.0, "max_effects": 1, "advice": False}
    alone = diagnose(model, log, EFFECTS, **options)
    found = diagnose_files(model, paths, EFFECTS, **options)
    assert found.whole_log is not None and alone.whole_log is None
    assert found.missing == alone.missing == ["ocean_current"]
    one, other = json.loads(json.dumps(alone.to_dict())), json.loads(json.dumps(found.to_dict()))
    for key in ("candidates", "steps", "verdict", "unexplained", "residual_tests"):
        assert other[key] == one[key]
    whole = found.whole_log
    assert (whole["samples"], whole["files"], whole["runs"]) == (log.samples, 3, 3)
    assert whole["looked_at"] == whole["windows"] == whole["searched"]["windows"]
    assert whole["settled"] and whole["adequate"]
    # The fit by passes comes to where the fit in memory came.
    explanation = alone.explanation
    assert explanation is not None
    size = len(GreyBox(vehicle()).with_effects(CURRENT).effect("ocean_current").parameters_of)
    std, _ = standard_errors(explanation, np.arange(len(explanation.fitted.theta))[-size:])
    for k, row in enumerate(whole["parameters"]["ocean_current"].values()):
        value = explanation.fitted.theta[-size:][k]
        assert abs(row["value"] - value) < 0.05 * std[k]
        assert row["std"] == pytest.approx(std[k], rel=0.05)


def test_a_long_log_is_searched_on_a_sample_and_fitted_whole(paths, monkeypatch):
    monkeypatch.setattr(parts_, "WINDOWS", 4)
    plan, _ = planned(paths)
    folder = paths[0].parent
    found = diagnose_files(
        GreyBox(vehicle()),
        folder,
        EFFECTS,
        window=2.0,
        max_effects=1,
        advice=False,
        search=12,
        windows=None,
        leading=1,
    )
    whole = found.whole_log
    assert whole is not None and found.missing == ["ocean_current"]
    assert whole["searched"]["windows"] == 12 < whole["windows"] == plan.windows == whole["looked_at"]
    assert any("12 of 24 windows" in w for w in found.warnings)
    line = found.to_dict()["baseline"]
    assert line and line["total"] > 0 and line["persistence"]["total"] > 0 and line["model"]["total"] > 0, (
        line
    )
    for name, true in CURRENT["ocean_current"].items():
        row = whole["parameters"]["ocean_current"][name]
        assert abs(row["value"] - true) < 4 * row["std"]


def test_a_file_that_cannot_be_read_is_told_and_left_out(paths, tmp_path):
    broken = tmp_path / "broken.parquet"
    broken.write_bytes(paths[0].read_bytes()[:-100])
    with executor_for() as pool:
        cut = WindowCut(2.0, 1.5, "thrusters", Mapping.read(None))
        plan = many._planned(pool, [broken, *paths], cut, lambda words: None)
        assert plan.runs == 3 and "broken.parquet" in plan.notes[0]
        with pytest.raises(InputError, match="broken"):
            many._planned(pool, [broken], cut, lambda words: None)


@pytest.mark.parametrize("option", ["search", "windows", "leading"])
def test_numbers_that_cannot_be_are_refused(paths, option):
    with pytest.raises(ConfigError, match=f"{option}=0"):
        diagnose_files(GreyBox(vehicle()), paths, **{option: 0})
    with pytest.raises(ConfigError, match="window=soon"):
        diagnose_files(GreyBox(vehicle()), paths, window="soon")  # pyright: ignore[reportArgumentType]


def test_names_that_are_not_told_are_not_told_of_the_whole_log(monkeypatch):
    """Of the fit to all of the log the answer holds the names that it gives, and no other as a coefficient."""
    explanation = SimpleNamespace(effects=("tether", "payload"), fitted=SimpleNamespace(sigma=np.ones(18)))
    fitted = SimpleNamespace(
        names=("added_mass", "tether", "payload"), values=lambda layout, names: list(names), lasting=False,
        sums=SimpleNamespace(cost=1.0, count=np.ones(18)), steps=1, settled=True,
    )  # fmt: skip
    plan = SimpleNamespace(runs=1, samples=1, duration=1.0, windows=1)
    looked = SimpleNamespace(scores={})
    for unsure, told in (([], ["tether", "payload"]), (["payload"], ["tether"])):
        found = SimpleNamespace(explanation=explanation, unsure=unsure)
        data = many._describe(plan, 1, 1, {}, looked, None, fitted, found)
        assert data["parameters"] == told and data["coefficients"] == ["added_mass"]
