"""Fins that are mounted far off: a vehicle that begins from rest turns over, and its first windows hold up a fit."""

from __future__ import annotations

import pytest

import auvnn

OFFSET = {"fin_1": 0.15, "fin_2": 0.157, "fin_3": -0.194, "fin_4": -0.45}


@pytest.mark.parametrize("seed", [2, 3])
def test_large_offsets_of_fins_are_found(seed):
    model = auvnn.load("remus100")
    made = auvnn.simulate(
        model,
        "multisine",
        hidden={"fin_offset": OFFSET},
        duration=40.0,
        rate=10.0,
        runs=4,
        seed=seed,
        noise="realistic",
    )
    better = auvnn.add(model, made.log, "fin_offset", horizons=("5",))
    found = {name: entry["value"] for name, entry in better.parameters["fin_offset"].items()}
    assert found == pytest.approx(OFFSET, abs=0.005)
    assert better.waterfall[2]["error"] < 0.2 * better.waterfall[1]["error"]
