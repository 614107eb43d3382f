"""Stamps of any beginning: seconds since 1970 teach the same, or are refused where their type cannot hold them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.errors import ConfigError
from auvnn.online import Adapter
from tests.online.online_world import bare, driven, fed, parameters, vehicle

UNIX = 1_716_200_000.0


def test_seconds_since_1970_teach_what_seconds_since_the_start_teach():
    # Noise as of a sensor: without any, the gate would see the rounding of the stamps itself.
    run = driven(vehicle(), duration=6.0, noise=(0.002, 0.0))
    plain, dated = Adapter(bare()), Adapter(bare())
    told = fed(plain, run, measured=False)
    later = fed(dated, replace(run, t=run.t + UNIX), measured=False)
    assert [u.cause for u in later] == [u.cause for u in told]
    assert plain.counts.adapted == dated.counts.adapted > 40
    # A double near 1.7e9 s is exact to 2.4e-7 s: of a step of 0.05 s that is 5e-6.
    held = parameters(plain)
    assert (parameters(dated) - held).abs().max() < 1e-3 * held.abs().max()


@pytest.mark.parametrize("kind", [np.float32, lambda t: torch.tensor(t, dtype=torch.float32)])
def test_a_stamp_that_its_type_cannot_hold_is_refused_in_one_line(kind):
    run = driven(vehicle(), duration=1.0)
    adapter = Adapter(bare(), watch=False)
    row = run.eta[0], run.nu[0], run.wrench[0]
    with pytest.raises(ConfigError, match=r"in float32, exact to 1\.3e\+02 s only: give it as float64"):
        adapter.step(kind(UNIX), *row)
    assert adapter.step(kind(0.0), *row).cause == "first"
    assert adapter.step(np.float64(UNIX), *row).cause != "not_finite"
