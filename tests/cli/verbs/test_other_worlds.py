"""The whole way by commands in a world whose commands change between the log's samples: simulate, add, compare."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

SIMULATE = (
    "simulate",
    "model=rov95",
    "plant=numpy",
    "hidden=[net_buoyancy]",
    "rate=5",
    "runs=3",
    "duration=30",
)


def test_a_world_is_named_as_the_help_says(auvnn, refused, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    status, _, err = auvnn(*SIMULATE, "world=between", "world.control_rate=50", "out=made")
    assert status == 0, err
    told = json.loads(Path("made/truth.json").read_text())["world"]
    assert told["name"] == "between" and told["control_rate"] == 50.0
    assert "no world called 'nowhere'. There are: between, conventions" in refused(
        *SIMULATE, "world=nowhere", "out=no"
    )
    status, _, _ = auvnn("simulate", "model=rov95", "runs=1", "duration=4", "out=plain")
    assert status == 0 and "world" not in json.loads(Path("plain/truth.json").read_text())


def test_what_add_finds_of_the_commands_is_told_and_compare_drives_the_model_so(auvnn, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert auvnn(*SIMULATE, "world=between", "out=made")[0] == 0
    status, out, err = auvnn("add", "model=rov95", "log=made/log.parquet", "effect=net_buoyancy", "out=added")
    assert status == 0 and "Commands change between the log's samples" in out + err
    told = json.loads(Path("added/improvement.json").read_text())
    stated = yaml.safe_load(Path("added/model/model.yaml").read_text())["commands"]
    assert told["commands"] == pytest.approx(stated) and stated["interval"] == pytest.approx(0.2)
    assert auvnn("compare", "model=added/model", "log=made/log.parquet", "out=compared")[0] == 0
    compared = json.loads(Path("compared/comparison.json").read_text())
    own = compared["rollout"]["5"]
    # Driven so, the model errs by what noise leaves; with commands that are held it errs by several times that.
    assert own["total"] < 1.3 * own["noise_floor"]
    assert any("The model states it" in w for w in compared["warnings"])
