"""A bottom to simulate over: the altimeter's column, and what cannot be hidden."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.effects.sizes import radius
from auvnn.errors import ConfigError
from auvnn.models import load
from auvnn.simulation import bottom_below, simulate

SHORT = {"runs": 2, "duration": 4.0, "rate": 10.0, "max_step": 0.05}
MANOEUVRE = {"runs": 2, "duration": 4.0, "rate": 10.0}


def test_altitude_is_the_bottom_less_the_depth():
    model = load("rov95")
    flat = simulate(model, "multisine", "none", bottom=12.5, **SHORT).log
    for run in flat.runs:
        np.testing.assert_allclose(run.altitude, 12.5 - run.position[:, 2], rtol=1e-12)
    noisy, open_water = (
        simulate(model, "multisine", bottom=b, noise="realistic", **SHORT) for b in (12.5, None)
    )
    assert open_water.log.runs[0].altitude is None
    for run, other, true in zip(noisy.log.runs, open_water.log.runs, flat.runs, strict=True):
        # Sensors that have nothing to do with the bottom are the same to the last bit.
        assert np.array_equal(run.nu, other.nu)
        error = run.altitude - true.altitude
        assert 0.01 < error.std() < 0.03
    assert noisy.truth["conditions"]["bottom"] == 12.5


def test_where_it_is_needed_there_is_one_close_below():
    model = load("rov95")
    depth = bottom_below(model, "multisine", 0, **MANOEUVRE)
    made = simulate(model, "multisine", "none", {"bottom_proximity": {"strength": 0.4}}, **SHORT)
    assert made.truth["conditions"]["bottom"] == depth
    lowest = min(run.altitude.min() for run in made.log.runs)
    assert lowest == pytest.approx(1.3 * radius(model.vehicle), rel=0.2)
    without = simulate(model, "multisine", "none", None, bottom=depth, **SHORT).log
    assert np.abs(made.log.runs[0].nu - without.runs[0].nu).max() > 1e-4


def test_an_effect_that_the_vehicle_cannot_have_is_refused():
    with pytest.raises(ConfigError, match=r"voltage_droop cannot be hidden .* states no reference_voltage"):
        simulate(load("rov95"), hidden="voltage_droop", **SHORT, noise="none")
