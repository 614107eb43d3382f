"""A state that was saved can be restored, whatever was in the adapter when it was saved."""

from __future__ import annotations

import pytest
import torch

from auvnn.online import Adapter
from tests.online.online_world import driven, fed, vehicle


@pytest.mark.parametrize(("learner", "watch"), [("rls", True), ("sgd", False), ("replay", False)])
def test_states_are_restored_after_any_number_of_samples(tmp_path, learner, watch):
    run = driven(vehicle(), duration=6.0)
    adapter = Adapter(vehicle(), learner, watch=watch)
    for k in range(0, 40, 3):
        fed(adapter, run, range(k, k + 3))
        again = Adapter.restore(adapter.save(tmp_path / "state"))
        assert torch.equal(again.weights.read(), adapter.weights.read())
