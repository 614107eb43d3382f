"""Nothing that lies in the folder where the user stands is run, whoever starts the processes."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import types
from pathlib import Path

import pytest

from auvnn.executors import EXECUTORS
from auvnn.executors.safe_path import environment, import_path, kept_safe, ray_kept_safe
from tests.security.poison import PACKAGE, outside, poisoned

SIMULATE = ["simulate", "model=rov95", "runs=1", "duration=1", "noise=none", "out=made"]
RUN = "import sys; from auvnn.cli.main import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture
def ran(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "theirs"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return poisoned(folder)


def command(*words: str, **more: str) -> subprocess.CompletedProcess[str]:
    """Run `auvnn` as the installed script does: its own folder is first in the search path, not the user's."""
    return subprocess.run(
        [sys.executable, "-P", "-c", RUN, *words],
        env=outside(**more),
        capture_output=True,
        text=True,
        timeout=300,
    )


def square(shared: float, task: float) -> float:
    return shared * task**2


def test_the_poison_works(ran):
    subprocess.run(
        [sys.executable, "-m", "auvnn", "--version"], env=outside(), capture_output=True, timeout=60
    )
    assert ran.exists()


def test_processes_of_a_sweep_run_nothing_of_the_current_folder(ran):
    for name in ("sitecustomize", "usercustomize"):
        Path(f"{name}.py").unlink()  # the command itself is told to run them, by an empty part of PYTHONPATH
    more = {"PYTHONPATH": f"{outside()['PYTHONPATH']}:.:"}
    done = command(*SIMULATE, "seed=0,1", "-m", "-j", "2", **more)
    assert (done.returncode, done.stderr) == (0, "")
    assert Path("made/1/log.parquet").exists() and not ran.exists()


@pytest.mark.parametrize("first", ["", "here"])
def test_workers_run_nothing_of_the_current_folder(ran, monkeypatch, first):
    monkeypatch.setattr(sys, "path", [os.getcwd() if first else "", *sys.path])
    with EXECUTORS.get("processes")(2) as pool:
        assert list(pool.run(square, 2.0, [1.0, 2.0])) == [2.0, 8.0]
    assert not ran.exists()


@pytest.mark.long
@pytest.mark.parametrize(("name", "package"), [("ray", "ray"), ("dask", "distributed")])
def test_clusters_run_nothing_of_the_current_folder(ran, monkeypatch, name, package):
    pytest.importorskip(package)
    monkeypatch.setenv("PYTHONPATH", f":.:{Path(__file__).parent}:{PACKAGE}")
    with EXECUTORS.get(name)(1) as cluster:
        assert list(cluster.run(square, 2.0, [1.0, 2.0])) == [2.0, 8.0]
    assert not ran.exists()
    assert os.environ["PYTHONPATH"].startswith(":.:"), "the user's own environment is as it was"


@pytest.mark.parametrize(
    ("launcher", "module"),
    [
        ("joblib", "hydra_joblib_launcher"),
        ("submitit_local", "hydra_submitit_launcher"),
        ("ray", "hydra_ray_launcher"),
    ],
)
def test_launchers_run_nothing_of_the_current_folder(ran, launcher, module):
    if (
        importlib.util.find_spec("hydra_plugins") is None
        or importlib.util.find_spec(f"hydra_plugins.{module}") is None
    ):
        pytest.skip(f"{module} is not installed")
    done = command(*SIMULATE, "seed=0,1", "-m", f"hydra/launcher={launcher}")
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    assert Path("made/1/log.parquet").exists() and not ran.exists()


def test_whatever_the_command_starts_has_no_current_folder(ran, monkeypatch):
    """What launchers do: a Python by -c or -m, with the environment and the search path of the command."""
    monkeypatch.setenv("PYTHONPATH", f":.:{os.getcwd()}")
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    monkeypatch.setattr(sys, "path", ["", os.getcwd(), ".", *sys.path])
    with kept_safe():
        assert not {"", "."} & set(sys.path) and os.getcwd() not in sys.path
        for words in (["-c", "import typing, json"], ["-m", "json.tool", "--help"]):
            subprocess.run([sys.executable, *words], check=True, capture_output=True, timeout=60)
    assert sys.path[:3] == ["", os.getcwd(), "."] and "PYTHONSAFEPATH" not in os.environ
    assert not ran.exists()


def test_the_module_form_runs_nothing_of_the_current_folder_but_what_has_its_own_name(ran):
    Path("auvnn.py").unlink()  # found by Python itself, before any line of ours
    for name in ("sitecustomize", "usercustomize", "runpy"):
        Path(f"{name}.py").unlink()
    done = subprocess.run(
        [sys.executable, "-m", "auvnn", *SIMULATE], env=outside(), capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert not ran.exists()


def test_a_checkout_in_which_one_stands_is_found(monkeypatch):
    monkeypatch.chdir(PACKAGE)
    monkeypatch.setattr(sys, "path", [PACKAGE, *sys.path])
    assert PACKAGE in import_path() and PACKAGE in environment()["PYTHONPATH"].split(os.pathsep)


def test_ray_is_started_without_the_current_folder_whoever_starts_it(monkeypatch):
    """Ray puts the current folder first in its workers' path, but for jobs of its client; stubs stand for both."""
    begun: list[dict] = []
    ray, config = types.ModuleType("ray"), types.ModuleType("ray.job_config")
    ray.init = begin = lambda **given: begun.append(given)  # type: ignore[attr-defined]
    config.JobConfig = lambda **given: given  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "ray", ray)
    monkeypatch.setitem(sys.modules, "ray.job_config", config)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: object())
    with ray_kept_safe():
        ray.init(num_cpus=1)  # type: ignore[attr-defined]
    assert begun[0]["num_cpus"] == 1 and begun[0]["job_config"]["_client_job"] is True
    assert ray.init is begin  # type: ignore[attr-defined]
