"""Training in parts is training in memory to the last bit, whoever computes the sums and whoever dies meanwhile."""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import auvnn
from auvnn.errors import ConfigError, InputError
from auvnn.executors import EXECUTORS, executor_for
from auvnn.log_chunks import samples as pieces
from auvnn.log_chunks import scan as parts
from auvnn.log_chunks.samples import Reading, evenly_spread_runs, pieces_of_file
from auvnn.logs import Log
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.metrics.derivative import choose_derivative
from auvnn.metrics.one_step import one_step, scores
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands
from auvnn.training import train, train_files
from auvnn.training import train_files as module_function
from auvnn.training.distributed import grouped_sums as groups
from auvnn.training.distributed.distributed_problem import DistributedProblem
from auvnn.training.distributed.target_cache import Source
from auvnn.training.held_out import score
from auvnn.training.targets import targets
from tests.small_logs import make_log, small_vehicle

files = sys.modules["auvnn.training.train_files"]
VEHICLE = small_vehicle()
# Every kind of form: networks, one fitted by automatic differentiation, one that is linear, and none.
MIXED = {"form": "mlp", "hidden": 3, "each": {"Y": "dissipative", "K": "polynomial", "M": "zero"}}
SCHEME = {"scheme": "levenberg_marquardt", "max_iterations": 12, "restarts": 2, "halve_every": 5}
GROUP = 130


@pytest.fixture(scope="module")
def bare() -> GreyBox:
    return GreyBox(replace(VEHICLE, linear_damping=None, quadratic_damping=None))


@pytest.fixture(scope="module")
def log() -> Log:
    return make_log(GreyBox(VEHICLE), runs=5, duration=15.0, noise=1.0)


@pytest.fixture(scope="module")
def dives(log, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("dives")
    for run in log.runs:
        log.select([run.number]).write(folder / f"dive{run.number}.parquet")
    return folder


@pytest.fixture
def small_groups(monkeypatch) -> None:
    monkeypatch.setattr(groups, "GROUP", GROUP)


@pytest.fixture(scope="module")
def in_memory(bare, log) -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(groups, "GROUP", GROUP)
        return train(bare, log, SCHEME, MIXED, seed=3)


def train_in_parts(bare: GreyBox, dives: Any, **options: Any) -> Any:
    return train_files(bare, dives, SCHEME, MIXED, seed=3, group=GROUP, **options)


def bits(training: Any) -> dict[str, bytes]:
    return {name: t.numpy().tobytes() for name, t in training.model.damping.state_dict().items()}


def numbers(training: Any) -> dict[str, float]:
    return {k: v for k, v in training.metrics.items() if k != "seconds"}


def test_many_files_in_parts_give_what_one_log_in_memory_gives_to_the_last_bit(bare, log, dives, in_memory):
    found = train_in_parts(bare, dives)
    assert found.parts is not None
    assert (found.parts["files"], found.parts["runs"], found.parts["samples"]) == (5, 5, log.samples)
    assert found.parts["groups"] == 4  # of 3 runs of 151 samples
    assert bits(found) == bits(in_memory)
    assert found.history == in_memory.history and found.stopped == in_memory.stopped
    one, other = numbers(found), numbers(in_memory)
    assert one == pytest.approx(other, rel=1e-12)
    plain = found.to_dict()
    assert plain["parts"] == found.parts and "parts" not in in_memory.to_dict()
    assert plain["derivative"]["stopping"].startswith("run 3, the last of")


def test_another_order_of_adding_would_not_do(bare, dives, in_memory):
    """Groups of another size are another order: the same to rounding at first, and then no more."""
    other = train_files(bare, dives, SCHEME, MIXED, seed=3, group=GROUP - 30)
    assert bits(other) != bits(in_memory)
    for one, two in zip(other.model.damping.parameters(), in_memory.model.damping.parameters(), strict=True):
        torch.testing.assert_close(one, two, rtol=1e-4, atol=1e-5)


def test_a_single_run_is_split_in_time_as_in_memory(bare, tmp_path, small_groups):
    log = make_log(GreyBox(VEHICLE), runs=1, duration=40.0, accelerations=True, noise=1.0)
    alone = train(bare, Log.read(log.write(tmp_path / "dive.parquet")), SCHEME, MIXED)
    found = train_files(bare, tmp_path / "dive.parquet", SCHEME, MIXED, group=GROUP)
    assert bits(found) == bits(alone)
    assert numbers(found) == pytest.approx(numbers(alone), rel=1e-12)
    for word in ("held_out", "stopping"):
        assert found.derivative[word].split(", from")[1] == alone.derivative[word].split(", from")[1]


def test_a_named_test_log_is_held_out(bare, log, tmp_path, small_groups):
    fitted, held = log.select([0, 1, 2]), log.select([3, 4])
    alone = train(bare, fitted, SCHEME, MIXED, test=held)
    found = train_in_parts(
        bare, fitted.write(tmp_path / "fitted.parquet"), test=held.write(tmp_path / "held.parquet")
    )
    assert found.test == "held" and found.derivative["held_out"] == "held is held out"
    seed_free = train(bare, fitted, SCHEME, MIXED, test=held, seed=3)
    assert bits(found) == bits(seed_free) != bits(alone)
    assert numbers(found) == pytest.approx(numbers(seed_free), rel=1e-12)
    with pytest.raises(InputError, match=r"shares \d+ of \d+ samples with the log"):
        train_in_parts(
            bare, tmp_path / "fitted.parquet", test=log.select([2, 3]).write(tmp_path / "both.parquet")
        )


@pytest.mark.parametrize("accelerations", [False, True])
def test_pieces_of_a_long_run_hold_every_sample_once_and_what_the_whole_run_gives(
    bare, tmp_path, monkeypatch, accelerations
):
    """Portions and pieces much shorter than the run: what lies between two of them is read with margins."""
    monkeypatch.setattr(parts, "ROWS", 250)
    log = make_log(GreyBox(VEHICLE), runs=2, duration=50.0, noise=1.0, accelerations=accelerations)
    path = log.write(tmp_path / "dive.parquet")
    mapping = Mapping.read(None)
    found = pieces_of_file(Reading(mapping, samples=90), path)
    assert len(found.pieces) > 10 and found.samples == log.samples == found.rows
    assert found.duration == pytest.approx(log.duration, abs=1e-9)
    stamps = [r.t for r in evenly_spread_runs(found, found.samples, mapping)]
    np.testing.assert_array_equal(np.concatenate(stamps), np.concatenate([r.t for r in log.runs]))
    how = choose_derivative(log)
    nu, target, _ = targets(bare, log, how)
    source = Source.of(bare, how, mapping, tmp_path / "scratch")
    rows = np.concatenate([source.samples(p) for p in found.pieces])
    good = np.isfinite(nu).all(1) & np.isfinite(target).any(1)
    whole = np.concatenate([nu, target], 1)[good]
    size = np.nanstd(whole, axis=0)
    np.testing.assert_allclose(rows / size, whole / size, atol=1e-10)
    for p, again in zip(found.pieces, [source.samples(p) for p in found.pieces], strict=True):
        np.testing.assert_array_equal(again, source.worked_out(p))


def test_held_out_scores_are_those_of_the_log_in_memory(bare, log, dives, in_memory):
    mapping = Mapping.read(None)
    how = choose_derivative(log)
    models = [bare, in_memory.model]
    all_of = [p for path in sorted(dives.iterdir()) for p in pieces_of_file(Reading(mapping), path).pieces]
    with executor_for() as pool:
        found = score(pool, all_of, models, how, mapping)
    for model, mine in zip(models, found, strict=True):
        want = scores(one_step(model, log, how))
        for name, row in mine.items():
            assert row == pytest.approx({k: want[name][k] for k in ("rmse", "r2")}, rel=1e-12)


class Killed(Exception):
    pass


@pytest.mark.parametrize("after", [1, 7, 11])
def test_killed_anywhere_and_resumed_is_the_same_to_the_last_bit(
    bare, dives, tmp_path, in_memory, monkeypatch, after
):
    usual = files.fit_damping
    monkeypatch.setattr(files, "fit_damping", functools.partial(usual, checkpoint_every=3))

    def kill(words: str) -> None:
        if words.startswith(f"iteration {after}:"):
            raise Killed

    with pytest.raises(Killed):
        train_in_parts(bare, dives, checkpoint=tmp_path / "kept", progress=kill)
    again = train_in_parts(bare, dives, checkpoint=tmp_path / "kept", resume=True)
    assert bits(again) == bits(in_memory) and again.history == in_memory.history


def test_other_data_are_not_gone_on_with(bare, dives, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "fit_damping", functools.partial(files.fit_damping, checkpoint_every=1))
    short = SCHEME | {"max_iterations": 2}
    train_files(bare, dives, short, MIXED, checkpoint=tmp_path / "kept")
    with pytest.raises(ConfigError, match="the data has changed"):
        fewer = sorted(dives.iterdir())[1:]
        train_files(bare, fewer, short, MIXED, checkpoint=tmp_path / "kept", resume=True)


def test_a_file_that_cannot_be_read_is_told_and_left_out(bare, dives, tmp_path, in_memory):
    broken = tmp_path / "broken.parquet"
    broken.write_bytes(next(iter(sorted(dives.iterdir()))).read_bytes()[:-100])
    found = train_in_parts(bare, [*sorted(dives.iterdir()), broken])
    assert bits(found) == bits(in_memory)
    assert any("broken.parquet" in w for w in found.warnings)
    with pytest.raises(InputError, match="broken"):
        train_in_parts(bare, broken)


def test_files_of_different_vehicles_are_refused(bare, dives, tmp_path):
    other = make_log(GreyBox(VEHICLE), runs=1, duration=10.0, accelerations=True, first=9)
    with pytest.raises(InputError, match="differ in nu_dot"):
        train_in_parts(bare, [*sorted(dives.iterdir()), other.write(tmp_path / "other.parquet")])


def test_the_same_recording_twice_is_refused(bare, dives, tmp_path):
    twin = tmp_path / "copy.parquet"
    twin.write_bytes((dives / "dive0.parquet").read_bytes())
    with pytest.raises(InputError, match="same bytes"):
        train_in_parts(bare, [*sorted(dives.iterdir()), twin])


def test_a_worker_that_does_not_see_the_scratch_folder_works_it_out_again(bare, log, dives, tmp_path):
    mapping = Mapping.read(None)
    piece = pieces_of_file(Reading(mapping), dives / "dive0.parquet").pieces[0]
    source = Source.of(bare, choose_derivative(log), mapping, tmp_path / "elsewhere")
    first = source.samples(piece)
    assert not (tmp_path / "elsewhere").exists()
    np.testing.assert_array_equal(source.samples(piece), first)
    here = Source.of(bare, choose_derivative(log), mapping, tmp_path)
    np.testing.assert_array_equal(here.samples(piece), first)
    assert [p.suffix for p in tmp_path.iterdir()] == [".npy"]


def test_what_cannot_be_spread_is_refused(bare, dives):
    with pytest.raises(ConfigError, match="needs the log in memory"):
        train_files(bare, dives, "adam")
    with pytest.raises(ConfigError, match="free running needs the log in memory"):
        train_files(bare, dives, objective="rollout")


def test_two_processes_give_the_same_bits(bare, dives, in_memory):
    assert bits(train_in_parts(bare, dives, workers=2)) == bits(in_memory)


def deadly(shared: tuple[str, Any, Any], task: Any) -> Any:
    """Compute a part of the normal equations, but die the first time that the third group comes along."""
    mark, function, inner = Path(shared[0]), shared[1], shared[2]
    asked = next(iter(getattr(inner, "values", ())), None)
    normal = isinstance(asked, str) and asked == "normal"
    if normal and task.first == 2 * GROUP and not mark.exists():
        mark.write_text("")
        os.kill(os.getpid(), signal.SIGKILL)
    return function(inner, task)


@pytest.mark.long
@pytest.mark.parametrize("name", ["processes", "ray", "dask"])
def test_a_worker_that_is_killed_changes_nothing(bare, dives, tmp_path, monkeypatch, in_memory, name):
    if name != "processes":
        pytest.importorskip("ray" if name == "ray" else "distributed")
    here = str(Path(__file__).parent)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([here, *sys.path]))
    monkeypatch.syspath_prepend(here)
    kind, mark = EXECUTORS.get(name), tmp_path / "mark"
    killer = __import__(Path(__file__).stem).deadly

    class Deadly(kind):
        def run(self, function, shared, tasks, *, losses=False):
            return super().run(killer, (str(mark), function, shared), tasks, losses=losses)

    monkeypatch.setattr(files, "executor_for", lambda *a: Deadly(2))
    found = train_in_parts(bare, dives)
    assert mark.exists()
    assert bits(found) == bits(in_memory)


MEASURE = """
import resource, sys, torch
torch.set_num_threads(1)
import auvnn
scheme = {"scheme": "levenberg_marquardt", "max_iterations": 3, "restarts": 1}
found = auvnn.train_files(auvnn.load("rov90", actuation="wrench"), sys.argv[1], scheme)
print(found.parts["samples"], resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


@pytest.mark.long
def test_memory_is_flat(tmp_path):
    """Ten times the samples take no more memory; in memory they would take some 500 MB more."""
    pytest.importorskip("pyarrow")
    sys.path.insert(0, str(Path(__file__).parents[2] / "experiments" / "benchmarks"))
    growth = __import__("growth")

    peak = {}
    for size in (100_000, 1_000_000):
        growth.make(size, tmp_path / "log.parquet")
        done = subprocess.run(
            [sys.executable, "-c", MEASURE, str(tmp_path / "log.parquet")], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        samples, peak[size] = map(float, done.stdout.split())
        assert samples == size
    assert peak[1_000_000] < 1.1 * peak[100_000]


def test_it_is_a_public_name():
    assert auvnn.train_files is module_function
    assert pieces.SAMPLES < parts.ROWS
    assert DistributedProblem.__dataclass_fields__["size"].default == groups.GROUP


def test_a_model_trained_in_parts_states_what_the_given_one_does(bare, dives):
    path = CommandPath("linear", 0.5, 0.1)
    few = {**SCHEME, "max_iterations": 2}
    found = train_files(with_commands(bare, path), dives, few, MIXED, seed=3, group=GROUP)
    assert found.model.commands == path
