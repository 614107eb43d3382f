"""Windows in parts: the same rows, one part after the other, each knowing what came before it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.estimation.trajectories.windows_in_turn import CHAIN, followed
from auvnn.estimation.window_parts import split
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

MODEL = GreyBox(small_vehicle())


def test_parts_are_what_windows_of_that_length_would_be():
    """A window of 5 s in two parts: as if windows of 2.5 s had been cut, history for the actuators included."""
    log = make_log(MODEL, runs=2, duration=20.0, rate=20.0, noise=1.0)
    whole, wanted = cut_windows(log, 5.0, warmup=1.0), cut_windows(log, 2.5, warmup=1.0)
    parts, window, begins = split(whole, 2.0)
    assert len(parts) == len(wanted) == 2 * len(whole)
    assert (window == np.repeat(np.arange(len(whole)), 2)).all() and set(begins) == {0, 50}
    for name in ("run", "first", "length"):
        assert (getattr(parts, name) == getattr(wanted, name)).all()
    for name in ("times", "eta", "nu", "mask"):
        assert torch.equal(getattr(parts, name), getattr(wanted, name))
    assert torch.equal(parts.inputs.command, wanted.inputs.command)


def test_an_odd_number_of_intervals_is_padded_and_few_samples_are_left_alone():
    log = make_log(MODEL, runs=1, duration=20.0, rate=5.0, noise=1.0)
    whole = windows_for(MODEL, log, 5.0)
    parts, _, begins = split(whole, 2.0)
    assert parts.mask.shape[1] == 14 and set(begins) == {0, 13}
    assert set(parts.length) == {14, 13} and not parts.mask[parts.length == 13, -1].any()
    # No measurement is lost, and the one that both parts begin or end with is the only one that is there twice.
    assert float(parts.mask.sum()) == float(whole.mask.sum() + whole.mask[:, 13].sum())
    slow = make_log(MODEL, runs=1, duration=20.0, rate=2.0, noise=1.0)
    few = windows_for(MODEL, slow, 5.0)
    assert split(few, 2.0)[0] is few


def test_windows_follow_one_another_within_a_run_and_a_chain():
    log = make_log(MODEL, runs=2, duration=40.0, rate=10.0, noise=1.0)
    parts, *_ = split(windows_for(MODEL, log, 5.0), 2.0)
    before, gap = followed(parts, 2.5)
    per_run = len(parts) // 2
    expected = [-1 if k % CHAIN == 0 else k - 1 for k in range(per_run)]
    assert before.tolist() == expected + [-1 if b < 0 else b + per_run for b in expected]
    assert gap == pytest.approx(0.0, abs=1e-9)
    # A window that is missing between two ends the chain, or leaves a gap.
    rest = parts.pick(np.array([0, 1, 3]))
    before, gap = followed(rest, 2.5)
    assert before.tolist() == [-1, 0, 1] and gap == pytest.approx([0.0, 0.0, 2.5])
