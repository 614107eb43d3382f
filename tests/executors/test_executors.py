"""Executors give the same answers in the same order, whoever computes them and whoever dies meanwhile."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import pytest

from auvnn.errors import ConfigError, InputError, MissingExtra
from auvnn.executors import EXECUTORS, Lost, executor_for
from tests.executors.chores import always_deadly, noisy, once_deadly, power, refusing


def test_one_worker_is_this_process():
    with executor_for() as own:
        assert [pid for _, pid in own.run(power, 2.0, [1, 2])] == [os.getpid()] * 2


def test_processes_answer_in_order_and_are_used_again():
    with executor_for(workers=2) as pool:
        first = list(pool.run(power, 2.0, list(range(12))))
        second = list(pool.run(power, 3.0, [2]))
    assert [value for value, _ in first] == [2.0**k for k in range(12)]
    assert second[0][0] == 9.0 and second[0][1] in {pid for _, pid in first}
    assert os.getpid() not in {pid for _, pid in first}


def test_a_killed_worker_s_task_is_computed_by_another(tmp_path):
    with executor_for("processes", 2) as pool:
        found = list(pool.run(once_deadly, str(tmp_path / "mark"), list(range(8))))
        assert pool.deaths == 1  # pyright: ignore[reportAttributeAccessIssue]
    assert (tmp_path / "mark").exists()
    assert found == [1.0 / (1 + k) for k in range(8)]


def test_a_task_that_kills_every_worker_is_given_up():
    with executor_for("processes", 2) as pool, pytest.raises(Lost, match="part 2: 3 workers died"):
        list(pool.run(always_deadly, None, [0, 1, 2]))


def test_a_loss_can_be_told_in_its_place():
    with executor_for("processes", 2) as pool:
        first, lost, last = pool.run(always_deadly, None, [0, 1, 2], losses=True)
    assert (first, last) == (0, 2) and isinstance(lost, Lost) and lost.task == 1


def test_an_error_of_the_function_is_raised_here_and_the_pool_lives_on():
    with executor_for("processes", 2) as pool:
        with pytest.raises(InputError, match="task 2 has no samples"):
            list(pool.run(refusing, None, [0, 1, 2, 3]))
        assert list(pool.run(noisy, None, [5])) == [5]


def test_what_a_worker_prints_stays_out_of_the_answer(capfd):
    with executor_for("processes", 1) as pool:
        list(pool.run(noisy, None, [1]))
    out, err = capfd.readouterr()
    assert out == "" and "a library says something" in err


@pytest.mark.parametrize(
    ("name", "workers", "address", "words"),
    [
        ("proceses", 1, None, "Did you mean"),
        (None, 0, None, "at least 1"),
        ("processes", 2, "a:1", "take ray or dask"),
    ],
)
def test_wrong_wishes_are_refused(name, workers, address, words):
    with pytest.raises(ConfigError, match=words):
        executor_for(name, workers, address)


@pytest.mark.parametrize(("name", "package"), [("ray", "ray"), ("dask", "distributed")])
def test_a_missing_package_is_named_with_its_cure(name, package):
    if importlib.util.find_spec(package):
        pytest.skip(f"{package} is installed")
    with pytest.raises(MissingExtra, match=r"auvnn\[cluster\]"), executor_for(name, 2):
        pass


@pytest.mark.long
@pytest.mark.parametrize("name", ["ray", "dask"])
def test_a_cluster_of_two_goes_on_without_one(name, tmp_path, monkeypatch):
    pytest.importorskip("ray" if name == "ray" else "distributed")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), *sys.path]))
    with EXECUTORS.get(name)(2) as cluster:
        found = list(cluster.run(once_deadly, str(tmp_path / "mark"), list(range(8))))
        with pytest.raises(InputError, match="task 2 has no samples"):
            list(cluster.run(refusing, None, [0, 1, 2, 3]))
    assert (tmp_path / "mark").exists()
    assert found == [1.0 / (1 + k) for k in range(8)]


LATE = """
import pathlib, sys, time
mark = pathlib.Path({mark!r})
if any("dashboard/agent.py" in word for word in sys.orig_argv) and not mark.exists():
    mark.write_text("")
    time.sleep(25)
"""


@pytest.mark.long
def test_a_ray_node_that_does_not_come_up_in_time_is_tried_again(tmp_path, monkeypatch):
    """Ray waits 15 s for its agent: the first one here sleeps longer, as it would on a machine that is busy."""
    pytest.importorskip("ray")
    mark = tmp_path / "late"
    (tmp_path / "sitecustomize.py").write_text(LATE.format(mark=str(mark)))
    here = str(Path(__file__).parent)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), here, *sys.path]))
    with executor_for("ray", 2) as cluster:
        assert [value for value, _ in cluster.run(power, 2.0, [1, 2, 3])] == [2.0, 4.0, 8.0]
    assert mark.exists()
