"""One thread while a call runs, the caller's own setting afterwards, and threads that sleep."""

from __future__ import annotations

import subprocess
import sys

import pytest
import torch
from threadpoolctl import threadpool_info

from auvnn.threads import on_one_thread, one_thread, sleep_when_idle
from tests.cli.stand_ins import ENVIRONMENT


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
