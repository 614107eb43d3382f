"""A fit killed and resumed ends with the same bits; what is damaged, changed or foreign is refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError, InputError, ModelError
from auvnn.training.checkpoint import Checkpoints
from auvnn.training.fit_damping import fit_damping
from auvnn.training.history import History, Progress, Record
from tests.training.problems import problem

MIXED = {"form": "mlp", "each": {"Y": "dissipative", "K": "polynomial", "M": "zero"}}
SCHEMES = {
    "lm": {"scheme": "levenberg_marquardt", "max_iterations": 14, "restarts": 3, "halve_every": 4},
    "sgd": {"scheme": "sgd", "epochs": 14, "batch_size": 16},
    "adam": {"scheme": "adam", "epochs": 14, "schedule": "cosine", "batch_size": 50},
}


class Killed(Exception):
    pass


def kill_after(iterations):
    def callback(record):
        if record.iteration == iterations:
            raise Killed

    return callback


def fit(folder, scheme="lm", damping=MIXED, made=None, **options):
    bank = DampingBank.from_description(damping)
    made = problem(120, noise=0.1, runs=3) if made is None else made
    options = {"held_out": [2], "seed": 3, "checkpoint_every": 2} | options
    return bank, fit_damping(bank, made, scheme=SCHEMES[scheme], checkpoint_folder=folder, **options)


def bits(bank):
    return {name: tensor.numpy().tobytes() for name, tensor in bank.state_dict().items()}


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("killed", [1, 2, 5, 13])
def test_killed_anywhere_and_resumed_is_the_same_to_the_last_bit(tmp_path, scheme, killed):
    bank, whole = fit(None, scheme)
    with pytest.raises(Killed):
        fit(tmp_path, scheme, callback=kill_after(killed))
    with pytest.raises(Killed):
        fit(tmp_path, scheme, callback=kill_after(killed + 1), resume=True)
    resumed_bank, resumed = fit(tmp_path, scheme, resume=True)
    assert bits(resumed_bank) == bits(bank)
    assert resumed.history == whole.history and resumed.stopped_because == whole.stopped_because
    assert resumed.rmse == whole.rmse and resumed.held_out_rmse == whole.held_out_rmse


def test_resuming_what_is_complete_does_nothing_more(tmp_path):
    bank, whole = fit(tmp_path)
    again, resumed = fit(tmp_path, resume=True, callback=kill_after(1))
    assert bits(again) == bits(bank) and resumed.history == whole.history


def test_resuming_where_nothing_was_saved_starts(tmp_path):
    bank, _ = fit(None)
    assert bits(fit(tmp_path / "new", resume=True)[0]) == bits(bank)


def test_only_the_newest_two_are_kept(tmp_path):
    fit(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["checkpoint-00000012", "checkpoint-00000014"]


def damage(path: Path, how: str) -> None:
    data = path.read_bytes()
    if how == "truncated":
        path.write_bytes(data[: len(data) // 2])
    elif how == "flipped":
        place = len(data) // 3
        path.write_bytes(data[:place] + bytes([data[place] ^ 4]) + data[place + 1 :])
    else:
        path.unlink()


@pytest.mark.parametrize("how", ["truncated", "flipped", "missing"])
@pytest.mark.parametrize("name", ["state.safetensors", "state.json", "manifest.json"])
def test_a_damaged_checkpoint_gives_way_to_the_one_before(tmp_path, how, name):
    bank, whole = fit(tmp_path)
    damage(tmp_path / "checkpoint-00000014" / name, how)
    again, resumed = fit(tmp_path, resume=True)
    assert bits(again) == bits(bank) and resumed.history == whole.history
    assert "checkpoint not used" in resumed.warnings[0] and "checkpoint-00000014" in resumed.warnings[0]


def test_no_intact_checkpoint_is_an_error_that_names_each(tmp_path):
    fit(tmp_path)
    for number in (12, 14):
        damage(tmp_path / f"checkpoint-000000{number}" / "state.safetensors", "flipped")
    with pytest.raises(ModelError, match=r"no checkpoint is intact.*00000014.*00000012"):
        fit(tmp_path, resume=True)


def test_a_fresh_fit_does_not_overwrite_another(tmp_path):
    fit(tmp_path)
    with pytest.raises(InputError, match="resume=true"):
        fit(tmp_path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 4}, "seed was 3 and is 4"),
        ({"held_out": [1]}, "held_out was"),
        ({"scheme": "adam"}, "scheme.scheme was levenberg_marquardt and is adam"),
        ({"damping": "mlp"}, "damping.each"),
        ({"made": problem(121, noise=0.1, runs=3)}, "the data has changed"),
        ({"warm_start": True}, "warm_start was False"),
    ],
)
def test_resuming_with_something_changed_is_refused_with_the_difference(tmp_path, change, words):
    fit(tmp_path)
    with pytest.raises(ConfigError, match=words):
        fit(tmp_path, resume=True, **change)


def test_a_change_can_be_forced_where_the_shapes_allow_it(tmp_path):
    made = problem(120, noise=0.1, runs=3)
    with pytest.raises(Killed):
        fit(tmp_path, callback=kill_after(4))
    weight = torch.full((6,), 2.0, dtype=torch.float64)
    other = problem(120, noise=0.1, runs=3, weight=weight)
    assert other.fingerprint() != made.fingerprint()
    _, resumed = fit(tmp_path, made=other, resume="force")
    assert resumed.iterations == 14
    with pytest.raises(ModelError, match=r"0\.theta is .* instead of"):
        fit(tmp_path, damping=MIXED | {"hidden": 4}, resume="force")


def test_resume_needs_a_folder_and_a_known_word():
    with pytest.raises(ConfigError, match="checkpoint_folder"):
        fit(None, resume=True)
    with pytest.raises(ConfigError, match="true, false or force"):
        fit(None, resume="yes")
    with pytest.raises(ConfigError, match="checkpoint_every"):
        fit(None, checkpoint_every=0)


def test_missing_tensors_are_listed(tmp_path):
    store = Checkpoints(tmp_path, {"a": 1})
    store.save(1, {"one": torch.zeros(2), "two": torch.zeros(3)}, {})
    expected = {"one": ((3,), torch.float32), "three": ((1,), torch.float64)}
    with pytest.raises(ModelError, match=r"three is missing; one is \(2,\) torch.float32 instead of \(3,\)"):
        store.load(expected)


def test_a_checkpoint_of_a_newer_auvnn_is_refused(tmp_path):
    store = Checkpoints(tmp_path, {"a": 1})
    manifest = store.save(1, {"one": torch.zeros(2)}, {}) / "manifest.json"
    told = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(told | {"schema": "auvnn/checkpoint/2"}))
    with pytest.raises(ModelError, match="upgrade auvnn"):
        store.load({})


SCRIPT = """
import sys, time, torch
torch.set_num_threads(1)
sys.path[:0] = {paths!r}
from tests.training.test_resume import fit
def slow(record):
    print(record.iteration, flush=True)
    time.sleep(0.03)
fit({folder!r}, checkpoint_every=1, callback=slow)
"""


@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
def test_a_process_that_is_really_killed_resumes_to_the_same_bits(tmp_path):
    bank, whole = fit(None)
    paths = [str(Path(__file__).parent), str(Path(__file__).parents[2])]
    script = SCRIPT.format(paths=paths, folder=str(tmp_path / "run"))
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    while process.stdout.readline().strip() != "4":
        assert process.poll() is None
    time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    again, resumed = fit(tmp_path / "run", checkpoint_every=1, resume=True)
    assert bits(again) == bits(bank) and resumed.history == whole.history
    assert not list((tmp_path / "run").glob(".*"))


def test_the_history_survives_json():
    history = History([Record(1, (0.1,) * 6, (0.2,) * 6), Record(2, (1 / 3,) * 6, (2 / 3,) * 6)])
    assert History.from_dict(json.loads(json.dumps(history.to_dict()))) == history
    bare = History([Record(1, (0.1,) * 6)])
    assert History.from_dict(bare.to_dict()) == bare


def test_progress_says_nothing_where_there_is_no_terminal(capsys):
    with Progress(3) as progress:
        fit_damping(
            DampingBank.from_description("mlp"),
            problem(50),
            scheme={"max_iterations": 3},
            callback=progress,
        )
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


def test_progress_draws_on_a_terminal(monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with Progress(3) as progress:
        progress(Record(2, tuple(np.full(6, 0.5))))
        assert progress._bar.tasks[0].completed == 2
    assert progress._bar is None
