"""The Beluga experiment: its files are sound, and the reversed signs are found where the data are at hand."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from auvnn.logs import Log
from auvnn.models import load

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "experiments" / "beluga"
DATA = Path(os.environ.get("AUVNN_DATA", ROOT.parent / "shared" / "data")) / "beluga"


def test_the_model_file_has_the_published_rows():
    """Surge, sway, heave and yaw rows of the published thruster matrix, with its senses; roll of verticals 0.22 m."""
    rows = load(HERE / "beluga.yaml", actuation="thrusters").actuators.allocation.numpy()
    sense = np.array([1, -1, 1, 1, -1, -1, 1, -1])
    surge = np.array([0.70711, 0, 0, 0.70711, 0.70711, 0, 0, 0.70711])
    heave = np.array([0, 1, 1, 0, 0, 1, 1, 0])
    np.testing.assert_allclose(np.abs(rows[0]), surge, atol=1e-4)
    np.testing.assert_allclose(np.abs(rows[2]), heave, atol=1e-4)
    np.testing.assert_allclose(rows[0] * sense >= -1e-9, True)
    np.testing.assert_allclose(np.abs(rows[3][[1, 2, 5, 6]]), 0.22, atol=1e-4)


@pytest.mark.skipif(not DATA.is_dir(), reason="Beluga's logs are not here: set AUVNN_DATA to the folder above beluga/")
def test_the_reversed_rates_are_found_before_any_fitting():
    log = Log.read(DATA / "random-1.csv", HERE / "mapping-raw.yaml")
    scales = {n: k.scale for n, k in log.quality().kinematics.items()}
    assert scales["p"] == pytest.approx(-1, abs=0.1) and scales["q"] == pytest.approx(-1, abs=0.1)
    assert scales["r"] == pytest.approx(1, abs=0.1)
