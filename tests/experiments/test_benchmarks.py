"""The benchmark compares like with like: each peer's right-hand side is that of the model."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.models import GreyBox

HERE = Path(__file__).resolve().parents[2] / "experiments" / "benchmarks"
NAMES = ("measure", "standard", "peers_torch", "peers_jax")


@pytest.fixture(scope="module")
def folder():
    """Let the study's modules be imported, and forget them afterwards."""
    sys.path.insert(0, str(HERE))
    yield
    sys.path.remove(str(HERE))
    for name in NAMES:
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def work(folder):
    """The standard work with networks that were not trained: what they say does not matter here."""
    import standard

    bank = DampingBank.from_description(standard.NETWORKS)
    bank.input_scale.copy_(torch.linspace(0.2, 0.7, 6))
    bank.output_scale.copy_(torch.linspace(3.0, 90.0, 6))
    model = GreyBox(standard.vehicle(False), (), bank, actuation="wrench")
    command, times = standard.manoeuvre()
    still = torch.zeros(7, dtype=torch.float64)
    return standard.Work(model, model, still, still[:6], command, times)


def states():
    generator = torch.Generator().manual_seed(0)
    for _ in range(3):
        y = torch.randn(13, generator=generator, dtype=torch.float64)
        y[3:7] /= y[3:7].norm()
        yield y


def test_the_matrices_of_the_standard_vehicle_are_full(work):
    prepared = work.model.prepare()
    assert bool((prepared.total != 0).all())
    assert torch.linalg.eigvalsh(prepared.total).min() > 0
    assert sum(p.numel() for p in work.model.parameters()) == 426


def test_the_lean_right_hand_side_is_the_models(work):
    import peers_torch

    own, lean = peers_torch.Own(work), peers_torch.Lean(work)
    own.begin()
    lean.begin()
    with torch.no_grad():
        for y in states():
            a, b = own(torch.tensor(1.0), y), lean(torch.tensor(1.0), y)
            assert float((a - b).abs().max() / a.abs().max()) < 1e-13


def test_the_statement_in_jax_is_the_models(work):
    pytest.importorskip("jax")
    import peers_jax
    import peers_torch

    own = peers_torch.Own(work)
    own.begin()
    known, weights = peers_jax.statement(work)
    for y in states():
        with torch.no_grad():
            ours = own(torch.tensor(1.0), y).numpy()
        theirs = np.asarray(peers_jax.rate(known, weights, y.numpy(), work.command[100].numpy()))
        assert np.abs(ours - theirs).max() / np.abs(ours).max() < 1e-13


def test_repeats_are_taken_in_turns_and_the_first_call_counts_apart(folder):
    import measure

    calls = []
    timings = measure.race(
        [
            ("a", lambda: calls.append("a"), 2),
            ("b", lambda: calls.append("b"), 1),
            ("slow", lambda: calls.append("s"), 0),
            ("absent", "not installed", 2),
        ],
        tell=lambda words: None,
    )
    assert calls == ["a", "b", "s", "a", "b", "a"]
    assert [len(t.cpu) for t in timings] == [2, 1, 1, 0]
    text = measure.table("title", [t.to_dict() for t in timings])
    assert "skipped: not installed" in text
    assert text.count("\n| ") == 5
