"""The glider experiment: its files are sound, and the record is predicted where it is at hand."""

from __future__ import annotations

import csv
import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from auvnn.logs import Log
from auvnn.metrics.unmeasured import completed
from auvnn.models import load

ROOT = Path(__file__).resolve().parents[2]
HERE = ROOT / "experiments" / "glider"
DATA = Path(os.environ.get("AUVNN_DATA", ROOT.parent / "shared" / "data")) / "glider"


@pytest.fixture
def study():
    sys.path.insert(0, str(HERE))
    try:
        sys.modules.pop("run", None)
        import run

        yield run
    finally:
        sys.path.remove(str(HERE))
        sys.modules.pop("run", None)


def test_the_model_file_has_the_published_numbers():
    """Parasite drag 0.15 and lift slopes 3.8 + 3.7 per rad on 0.1 m2 in 1004 kg/m3, with the drag's share in the lift."""
    vehicle = load(HERE / "glider.yaml").vehicle
    pressure = 0.5 * 1004.0 * 0.1
    assert vehicle.quadratic_damping[0, 0] == pytest.approx(0.15 * pressure, rel=0.01)
    assert vehicle.effects["body_lift"]["Zuw"] == pytest.approx(-(3.8 + 3.7 + 0.15) * pressure, rel=0.01)
    assert vehicle.glides and vehicle.reduced.turned == (4,) and vehicle.reduced.moved == (0, 2)


def test_the_mapping_reads_what_a_glider_writes(tmp_path):
    path = tmp_path / "raw.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["unix_s", "pressure_bar", "pitch_rad", "drive_cm3", "density", "speed_adcp", "dive"])
        for k in range(60):
            writer.writerow([1466704292.0 + k, 1.5 + 0.01 * k, -0.4, -200.0, 1005.0, "", 1])
    log = Log.read(path, HERE / "mapping.yaml")
    run = log.runs[0]
    assert log.unmeasured == ["u", "v", "w", "p", "q", "r"]
    np.testing.assert_allclose(run.ballast, -2e-4)
    np.testing.assert_allclose(run.euler[:, 1], -0.4)
    np.testing.assert_allclose(np.diff(run.position[:, 2]), 1000.0 / (1005.3 * 9.80665), rtol=1e-9)
    driven = completed(load(HERE / "glider.yaml"), log).runs[0]
    lift = 9.81 * (1005.0 * -2e-4 + 1.0 * 686.7 / (9.81 * 1004.0))
    np.testing.assert_allclose(driven.wrench[:, 2], -lift * np.cos(-0.4), rtol=1e-9)


def test_what_is_expected_holds_together():
    """The README rests on these: depth rates predicted, no name, and a compressibility that the record cannot show."""
    expected = json.loads((HERE / "expected.json").read_text())
    assert expected["fitted"]["depth_rate_r2"] >= 0.95 > expected["as_given"]["depth_rate_r2"]
    assert expected["diagnosis"]["verdict"] == "unknown" and not expected["diagnosis"]["missing"]
    assert max(c["explained"] for c in expected["diagnosis"]["candidates"]) < 0.004
    found = expected["with_compressibility"]["parameters"]["compressibility.per_metre"]
    assert abs(found["value"]) < 2.0 * found["std"]


def test_an_oracle_sees_too_little_of_it_and_it_is_named_where_there_is_more():
    expected = json.loads((HERE / "expected.json").read_text())
    oracle, text = expected["oracle"], (HERE / "README.md").read_text()
    halves = [oracle[h]["force, as stated"] for h in ("first", "second")]
    both = sum(h["std"] ** -2 for h in halves) ** -0.5
    together = sum(h["estimate"] * h["std"] ** -2 for h in halves) * both**2
    # 5e-10 per Pa, by the hydrostatic pressure of a metre of this water.
    assert oracle["published"] == pytest.approx(5e-10 * 1005.3 * 9.80665)
    assert f"**{oracle['published'] / both:.1f}** |" in text and oracle["published"] / both < 3.0
    assert f"together {1e6 * together:.1f}e-6 +- {1e6 * both:.1f}e-6" in text
    # What is likelier with the published value, without it, and with what the other half says.
    assert sum(h["published_adds"] for h in halves) < 0.0
    assert oracle["first_half_estimate_adds_on_second"]["force, as stated"] < 0.0
    for made in expected["made"]:
        assert made["missing"] == (["compressibility"] if made["hidden"] else [])
        found = made["parameters"]["per_metre"]
        assert abs(found["value"] - made["hidden"]) < 3.0 * found["std"]


ABSENT = pytest.mark.skipif(
    not (DATA / "gliderflight_data.npy").is_file(),
    reason="the glider's record is not here: set AUVNN_DATA to the folder above glider/",
)


@pytest.mark.data
@ABSENT
def test_mass_and_drag_of_one_half_predict_the_other(study, tmp_path):
    expected = json.loads((HERE / "expected.json").read_text())
    first, second = study.halves(DATA, tmp_path)
    assert [len(first.runs), len(second.runs)] == expected["dives"]
    made, values = study.fitted(load(HERE / "glider.yaml"), first)
    for name, found in values.items():
        wanted = expected["fitted"]["parameters"][name]
        # To a hundredth of a standard error: processors add up in different orders.
        assert found["value"] == pytest.approx(wanted["value"], abs=0.01 * wanted["std"]), name
    scores = study.scores(study.predicted_rate(made, second))
    assert scores["depth_rate_r2"] >= 0.95
    for name, value in scores.items():
        assert value == pytest.approx(expected["fitted"][name], abs=2e-4), name


@pytest.mark.data
@pytest.mark.long
@ABSENT
def test_the_whole_study_gives_what_is_expected(study, tmp_path):
    expected = json.loads((HERE / "expected.json").read_text())
    found = study.plain(study.study(DATA, tmp_path, say=lambda words: None))
    for name in ("verdict", "missing"):
        assert found["diagnosis"][name] == expected["diagnosis"][name]
    assert found["as_given"] == pytest.approx(expected["as_given"], abs=2e-4)
    mine, theirs = (
        r["with_compressibility"]["parameters"]["compressibility.per_metre"] for r in (found, expected)
    )
    assert mine["value"] == pytest.approx(theirs["value"], abs=0.05 * theirs["std"])
