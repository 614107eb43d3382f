"""State on disk, and the adapter over a whole log."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch

from auvnn.config import config_dir, read_yaml
from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.models import load
from auvnn.online import Adapter, Guards, adapt
from auvnn.online.schemes import ONLINE_SCHEMES
from tests.online.online_world import bare, driven, fed, parameters, vehicle


@pytest.mark.parametrize("scheme", ["rls", "sgd", "replay"])
def test_a_restored_adapter_goes_on_bit_for_bit(scheme, tmp_path):
    run = driven(vehicle(), duration=9.0, noise=(2e-3, 0.05))
    whole = Adapter(bare(), scheme)
    fed(whole, run, range(0, 47))
    whole.save(tmp_path / "state")
    again = Adapter.restore(tmp_path / "state")
    expected, found = (fed(a, run, range(47, run.samples)) for a in (whole, again))
    assert torch.equal(parameters(again), parameters(whole))
    assert [u.cause for u in found] == [u.cause for u in expected]
    assert again.counts == whole.counts
    for name, tensor in whole.scheme.state().items():
        assert torch.equal(again.scheme.state()[name], tensor), name
    assert all(p.suffix in (".json", ".yaml", ".safetensors") for p in (tmp_path / "state").iterdir())


def test_adapt_writes_all_that_it_promises(tmp_path):
    changed = driven(
        vehicle(), lambda m: m.with_effects({"quadratic_damping": dict.fromkeys("XYZKMN", 2.0)}),
        when=4.0, duration=10.0, noise=(2e-3, 0.03),
    )  # fmt: skip
    other = driven(vehicle(), duration=6.0, seed=4)
    runs = [changed, other.cut(slice(None), number=1)]
    log = Log.from_runs(runs, name="made")
    said = []
    adaptation = adapt(vehicle(), log, state=tmp_path / "state", progress=said.append)
    adaptation.model.save(tmp_path / "model")
    data = json.loads(adaptation.write(tmp_path).read_text())
    assert data["schema"] == "auvnn/adaptation/1" and len(said) == 2
    metrics = data["metrics"]
    assert metrics["samples"] == log.samples
    skipped = sum(told["count"] for told in data["skipped"].values())
    assert metrics["samples_learned"] + skipped == log.samples
    assert data["changes"][0]["kind"] == "drag" and data["changes"][0]["run"] == 0
    assert "polynomial" in data["assumed"][0]
    assert len(data["frozen"]) == 2 and len(data["frozen"][0]["t"]) == 6
    assert (tmp_path / "report.html").stat().st_size > 10_000
    for name in ("prediction_error", "frozen_error", "movement", "skipped"):
        assert (tmp_path / "figures" / f"{name}.png").is_file()
    page = (tmp_path / "report.html").read_text()
    assert "a change of drag" in page
    saved = load(tmp_path / "model").damping
    assert saved is not None
    expected = adaptation.adapter.snapshot()
    assert all(torch.equal(p, expected[n]) for n, p in saved.named_parameters())
    assert torch.equal(parameters(Adapter.restore(tmp_path / "state")), parameters(adaptation.adapter))


def test_a_log_that_drives_otherwise_is_refused():
    log = Log.from_runs([driven(vehicle(), duration=3.0)])
    with pytest.raises(InputError, match="driven by wrench"):
        adapt(load("rov95"), log)


def test_the_configs_state_the_defaults():
    assert Guards(**read_yaml(config_dir() / "adapt.yaml")["guards"]) == Guards()
    for name in ONLINE_SCHEMES.names():
        options = read_yaml(config_dir() / "learner" / f"{name}.yaml")
        assert options.pop("scheme") == name
        assert options == ONLINE_SCHEMES.get(name)().options()


def test_a_log_of_rest_changes_nothing(tmp_path):
    run = driven(vehicle(), command=np.zeros((41, 6)))
    adaptation = adapt(bare(), Log.from_runs([run]))
    assert adaptation.metrics["samples_learned"] == 0 and "nothing was learned" in adaptation.warnings[-1]
    adaptation.write(tmp_path)
