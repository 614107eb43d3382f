"""What a dry run refuses, and that options reach the verbs as they are written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from auvnn.cli.main import main
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def told(capsys, *words):
    status = main(list(words))
    seen = capsys.readouterr()
    return status, seen.out, seen.err


def test_a_dry_run_knows_the_names_of_effects(here, capsys):
    status, _, err = told(capsys, "simulate", "model=rov90", "hidden=[tethr]", "dry_run=true")
    assert status == 2 and "tether" in err and err.count("\n") == 1
    status, _, err = told(capsys, "simulate", "model=rov90", "hidden={tether: {stifness: 3}}", "dry_run=true")
    assert status == 2 and "stif" in err
    for hidden in ("[tether]", "[]"):
        status, out, _ = told(capsys, "simulate", "model=rov90", f"hidden={hidden}", "dry_run=true")
        assert status == 0 and "would write" in out and not list(here.iterdir())


def test_a_dry_run_reads_the_beginning_of_a_log(here, capsys):
    Path("bad.csv").write_text("t,u\n0,1\n")
    status, _, err = told(capsys, "compare", "model=rov90", "log=bad.csv", "dry_run=true")
    assert status == 2 and "bad.csv" in err
    make_log(GreyBox(small_vehicle()), duration=5.0).write("good.csv")
    for name, refused in (("ocean_curent", True), ("ocean_current", False)):
        status, _, err = told(capsys, "add", "model=rov90", "log=good.csv", f"effect={name}", "dry_run=true")
        assert (status == 2) == refused, err


def test_the_objective_of_add_is_an_option_like_any_other(here, capsys):
    known = GreyBox(small_vehicle())
    truth = known.with_effects({"constant_force": {"X": 5.0}})
    make_log(truth, duration=20.0, accelerations=True, noise=1.0).write("log.csv")
    known.save("known")
    status, out, err = told(
        capsys,
        "add",
        "model=known",
        "log=log.csv",
        "effect=constant_force",
        "objective=one_step",
        "out=better",
    )
    assert status == 0, err
    assert json.loads(Path("better/improvement.json").read_text())["objective"] == "one_step"
    assert "assumed   run 1, the last of" in out


def test_a_test_log_that_is_named_is_not_assumed(here, capsys):
    known = GreyBox(small_vehicle())
    truth = known.with_effects({"constant_force": {"X": 5.0}})
    make_log(truth, duration=20.0, noise=1.0).write("log.csv")
    make_log(truth, duration=20.0, noise=1.0, seed=5).write("other.csv")
    known.save("known")
    words = ("add", "model=known", "log=log.csv", "test=other.csv", "effect=constant_force", "out=better")
    status, out, err = told(capsys, *words)
    assert status == 0, err
    assert "assumed" not in out and "test      other is held out" in out


def test_a_model_driven_by_a_wrench_stays_so_on_a_log_that_has_both(here, capsys):
    import polars as pl

    thrusters = GreyBox(small_vehicle())
    log = make_log(thrusters, duration=6.0)
    log.write("both.csv")
    table = pl.read_csv("both.csv")
    allocation = thrusters.actuators.allocation.numpy()
    command = table.select([f"thruster_{k}" for k in range(1, 9)]).to_numpy()
    wrench = 40.0 * command * abs(command) @ allocation.T
    table = table.with_columns(**{f"tau_{a}": wrench[:, k] for k, a in enumerate("XYZKMN")})
    table.write_csv("wrench.csv")
    GreyBox(small_vehicle(), actuation="wrench").save("known")
    status, _, err = told(capsys, "compare", "model=known", "log=wrench.csv", "out=compared")
    assert status == 0, err
    found = json.loads(Path("compared/comparison.json").read_text())
    assert found["rollout"]["5"]["total"] < 0.1, (
        "the wrench that was logged moves the model as the thrusters did"
    )
