"""Effects ranked one step ahead: what was hidden comes first with its value; with nothing missing nothing pays."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis import rank_one_step
from auvnn.errors import ConfigError
from auvnn.models import from_vehicle
from tests.small_logs import make_log, sines, small_vehicle

MODEL = from_vehicle(small_vehicle())
NAMES = ("cg_offset", "constant_force", "net_buoyancy", "turning_forces", "thruster_lag", "linear_damping")


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("net_buoyancy", {"force": 6.0}),
        ("cg_offset", {"x": 0.02, "y": -0.01, "z": 0.0}),
        ("constant_force", {"X": 5.0, "Y": -4.0, "Z": 0.0, "K": 0.0, "M": 0.0, "N": 1.0}),
    ],
)
def test_what_was_hidden_comes_first_with_its_value(effect, values):
    log = make_log(MODEL.with_effects({effect: values}), duration=20.0, noise=0.3, max_step=0.05)
    first = rank_one_step(MODEL, log, NAMES)[0]
    assert first.effect == effect and first.pays and first.gain > 5 * first.std
    scale = max(abs(v) for v in values.values())
    for name, value in values.items():
        assert abs(first.values[name] - value) < 0.25 * scale + 1e-3, (name, first.values)


def test_where_nothing_is_missing_nothing_gains_much():
    log = make_log(MODEL, duration=20.0, noise=1.0, max_step=0.05)
    for found in rank_one_step(MODEL, log, NAMES):
        assert found.gain < max(3 * found.std, 0.02 * found.before), found


def test_an_effect_and_its_double_are_one_group():
    """A constant force in a vehicle that never turns is what net buoyancy is: neither may be called better."""
    light = MODEL.with_effects({"net_buoyancy": {"force": 6.0}})
    # The four upright thrusters alone, all alike.
    command = np.zeros((201, 8))
    command[:, 4:] = 0.2 * sines(np.arange(201) / 10, 1, 3)
    still = make_log(light, duration=20.0, noise=0.3, max_step=0.05, command=command, stir=0.0)
    found = {
        r.effect: r for r in rank_one_step(MODEL, still, ("net_buoyancy", "constant_force", "thruster_lag"))
    }
    best = max(found.values(), key=lambda r: r.gain)
    assert best.effect == "net_buoyancy" or found["net_buoyancy"].tied
    assert not found["thruster_lag"].tied and best.behind == 0.0 and best.tied
    assert found["constant_force"].gain > 0.5 * best.gain
    plain = best.to_dict()
    assert plain["effect"] == best.effect and np.isfinite(plain["gain"]) and plain["pays"] is True


def test_an_effect_that_is_not_there_is_refused():
    with pytest.raises(ConfigError, match="ocean_curent"):
        rank_one_step(MODEL, make_log(MODEL, runs=1, duration=10.0), "ocean_curent")
