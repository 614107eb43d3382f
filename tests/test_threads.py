"""One thread while a call runs, the caller's own setting afterwards, and threads that sleep."""

from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np
import pytest
import torch
from threadpoolctl import threadpool_info

from auvnn import threads
from auvnn.diagnosis import diagnose
from auvnn.diagnosis.noise_law.leader_fits import LeaderFits
from auvnn.models import GreyBox
from auvnn.threads import on_one_thread, one_thread, processors, side_by_side, sleep_when_idle
from tests.cli.stand_ins import ENVIRONMENT
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import small_vehicle


@pytest.fixture(autouse=True)
def undecided(monkeypatch):
    """Nobody has said how many threads there shall be, and this process uses two."""
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def pools():
    return {(p["user_api"], p["filepath"]): p["num_threads"] for p in threadpool_info()}


def test_one_thread_within_and_the_old_setting_after():
    before = pools()
    with one_thread():
        assert torch.get_num_threads() == 1 and set(pools().values()) == {1}
    assert torch.get_num_threads() == 2 and pools() == before


def test_the_old_setting_comes_back_after_an_error():
    @on_one_thread
    def fails():
        assert torch.get_num_threads() == 1
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        fails()
    assert torch.get_num_threads() == 2


def test_who_has_decided_keeps_that(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    with one_thread():
        assert torch.get_num_threads() == 2


def test_idle_threads_sleep_unless_told_otherwise():
    environment = {"OMP_WAIT_POLICY": "ACTIVE"}
    sleep_when_idle(environment)
    assert environment["OMP_WAIT_POLICY"] == "ACTIVE" and environment["KMP_BLOCKTIME"] == "0"


def test_the_command_line_asks_for_it_before_torch_is_loaded():
    script = (
        "import os, sys; from auvnn.cli import main as m; m._prepare(); "
        "assert 'torch' not in sys.modules; print(os.environ['OMP_WAIT_POLICY'])"
    )
    environment = {k: v for k, v in ENVIRONMENT.items() if k not in ("OMP_WAIT_POLICY",)}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment)
    assert done.stdout.strip() == "PASSIVE", done.stderr


class Seen(Exception):
    """Somebody looked at an argument."""


class Probe:
    """An argument that notes on how many threads it is looked at, and ends the call."""

    def __init__(self):
        self.threads = []

    def look(self):
        self.threads.append((torch.get_num_threads(), set(pools().values())))
        raise Seen

    def __getattr__(self, name):
        self.look()

    def __iter__(self):
        self.look()


@pytest.mark.parametrize(
    ("room", "verb"),
    [
        ("comparison", "compare"), ("diagnosis", "diagnose"), ("diagnosis", "diagnose_files"),
        ("improvement", "add"), ("improvement", "improve"), ("improvement", "fleet"), ("online", "adapt"),
        ("simulation", "simulate"), ("training", "train"), ("training", "train_files"),
    ],
)  # fmt: skip
def test_every_call_that_computes_runs_on_one_thread_and_gives_the_setting_back(room, verb):
    import importlib
    import inspect

    call = getattr(importlib.import_module(f"auvnn.{room}"), verb)
    wanted = [p for p in inspect.signature(call).parameters.values() if p.default is p.empty]
    probe, before = Probe(), pools()
    # What stands for a model is asked for its kind alone; the manoeuvre is looked at.
    given = ["rov95", probe] if verb == "simulate" else [probe for p in wanted]
    with pytest.raises(Seen):
        call(*given)
    assert probe.threads == [(1, {1})]
    assert torch.get_num_threads() == 2 and pools() == before


@pytest.fixture
def two(monkeypatch):
    """Nobody else computes on this machine, which has two processors."""
    monkeypatch.setattr(threads, "processors", lambda *_: 2)


def test_items_are_worked_on_at_the_same_time_and_come_back_in_order(two):
    both = threading.Barrier(2, timeout=30.0)

    def one(item):
        both.wait()
        return item, threading.get_ident()

    found = side_by_side(one, [3, 1])
    assert [item for item, _ in found] == [3, 1] and len({thread for _, thread in found}) == 2
    assert side_by_side(one, []) == []


def test_what_holds_for_a_time_holds_side_by_side_too(two):
    def one(_):
        return np.geterr()["divide"], torch.is_grad_enabled()

    with np.errstate(divide="raise"), torch.no_grad():
        assert side_by_side(one, range(3)) == [("raise", False)] * 3
    assert side_by_side(one, range(2))[0][1]


def test_the_first_error_is_raised(two):
    def one(item):
        if item:
            raise ValueError(str(item))

    with pytest.raises(ValueError, match="1"):
        side_by_side(one, [0, 1, 2])


def test_how_many_compute_side_by_side(monkeypatch):
    monkeypatch.setattr(threads._Place, "shared", False)
    assert [processors({"OMP_NUM_THREADS": n}) for n in ("1", "3", "99", "2,4", "many")] == [1, 3, 4, 2, 1]
    monkeypatch.setattr("os.sched_getaffinity", lambda _: range(3), raising=False)
    assert processors({}) == 3
    threads.beside_others()
    assert processors({}) == processors({"OMP_NUM_THREADS": "3"}) == 1


def test_a_diagnosis_says_the_same_on_two_threads(monkeypatch):
    model, members = GreyBox(small_vehicle()), []
    log = wandering_log(model.with_effects({"net_buoyancy": {"force": 8.0}}), 2.0, 1.0, runs=2, duration=20.0)
    found = []
    fit = LeaderFits._one

    def followed(fits, name, *given):
        members.append(threading.current_thread() is threading.main_thread())
        return fit(fits, name, *given)

    monkeypatch.setattr(LeaderFits, "_one", followed)
    for count in (1, 2):
        monkeypatch.setattr(threads, "processors", lambda *_, n=count: n)
        asked = ["net_buoyancy", "constant_force", "biofouling"]
        found.append(diagnose(model, log, asked, advice=False, costs=False, whiteness=False).to_dict())
    assert True in members and False in members
    assert found[0] == found[1] and "net_buoyancy" in found[0]["missing"]
