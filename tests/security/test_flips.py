"""One flipped bit in a file of our own: refused, or nothing that counts has changed. A thousand per format is long."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.errors import AuvnnError
from auvnn.logs import Log
from auvnn.models import GreyBox, load
from auvnn.online import Adapter
from auvnn.studies.benchmark import cases
from auvnn.studies.benchmark.journal import Journal
from auvnn.training.checkpoint import Checkpoints
from tests.log_samples import make_log
from tests.studies.benchmark.test_benchmark_running import OPTIONS, answered

Made = tuple[list[Path], Callable[[], Any]]


def log(folder: Path) -> Made:
    path = make_log(2, n=120, noise=0.01).write(folder / "log.parquet")
    return [path], lambda: [run.nu.tobytes() for run in Log.read(path).runs]


def sealed(folder: Path) -> Made:
    path = make_log(2, n=120, noise=0.01).write(folder / "log.csv")
    return [path, path.with_name("log.csv.sha256")], lambda: [run.nu.tobytes() for run in Log.read(path).runs]


def model(folder: Path) -> Made:
    known = load("rov95", actuation="wrench")
    made = GreyBox(known.vehicle, (), DampingBank.from_description("mlp", 0), "wrench")
    path = made.save(folder / "model")

    def read() -> Any:
        found = load(path)
        assert found.damping is not None
        weights = [t.numpy().tobytes() for t in found.damping.state_dict().values()]
        return [json.dumps(found.vehicle.to_dict(), default=str), found.actuation, weights]

    return sorted(path.iterdir()), read


def state(folder: Path) -> Made:
    from tests.online.online_world import driven, fed, vehicle

    adapter = Adapter(vehicle(), "sgd", watch=False)
    fed(adapter, driven(vehicle(), duration=3.0), range(25))
    path = adapter.save(folder / "state")

    def read() -> Any:
        found = Adapter.restore(path)
        return [found.weights.read().numpy().tobytes(), str(found.counts)]

    return sorted(path.iterdir()), read


def checkpoint(folder: Path) -> Made:
    states = Checkpoints(folder / "kept", {"fit": 1})
    expected = {"x": ((40,), torch.float64)}
    states.save(1, {"x": torch.arange(40.0, dtype=torch.float64)}, {"loss": 1.0})

    def read() -> Any:
        found = states.load(expected)
        assert found is not None
        return [found[0], found[1]["x"].numpy().tobytes(), found[2]]

    return sorted((folder / "kept" / "checkpoint-00000001").iterdir()), read


def journal(folder: Path) -> Made:
    kept = Journal(folder / "rows.jsonl")
    todo = cases(OPTIONS)[:3]
    written = {case: kept.append({**answered(case), "p_value": 0.0125}) for case in todo}

    def read() -> Any:
        # A row that is left out is made again; one that is there must be what was written.
        return all(row == written[case] for case, row in kept.rows(todo).items())

    return [kept.path], read


MAKERS = {
    "log": log,
    "sealed log": sealed,
    "model": model,
    "adapter state": state,
    "checkpoint": checkpoint,
    "journal": journal,
}


def tried(folder: Path, kind: str, count: int) -> tuple[int, int, int]:
    """Return how many flips were refused, changed nothing that counts, and were read as something else."""
    files, read = MAKERS[kind](folder)
    good, whole = read(), {path: path.read_bytes() for path in files}
    rng = np.random.default_rng(0)
    sizes = np.array([len(whole[p]) for p in files], float)
    refused = same = wrong = 0
    for k in range(count):
        # Half of them by size, half of them in each file alike: small files decide much.
        path = files[
            int(rng.choice(len(files), p=sizes / sizes.sum()) if k % 2 else rng.integers(len(files)))
        ]
        data = bytearray(whole[path])
        data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        try:
            if read() == good:
                same += 1
            else:
                wrong += 1
        except AuvnnError as error:
            assert "\n" not in str(error)
            refused += 1
        finally:
            path.write_bytes(whole[path])
    return refused, same, wrong


@pytest.mark.parametrize("kind", list(MAKERS))
def test_a_few_flips_are_never_read_as_something_else(tmp_path, kind):
    refused, _, wrong = tried(tmp_path, kind, 24)
    assert wrong == 0 and refused > 8


@pytest.mark.long
@pytest.mark.parametrize("kind", list(MAKERS))
def test_a_thousand_flips_are_never_read_as_something_else(tmp_path, kind, record_property):
    found = tried(tmp_path, kind, 1000)
    record_property("refused, same, wrong", found)
    print(f"{kind}: {found[0]} refused, {found[1]} without effect, {found[2]} wrong")
    assert found[2] == 0 and found[0] > 500
