"""Effects over dives: trends by closed forms, one dive that fails alone, dates, and the answer."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from auvnn.errors import ConfigError, InputError
from auvnn.improvement.fleet import fleet
from auvnn.improvement.one_dive import Question, dive
from auvnn.improvement.trend import trend
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle, thinned

FORCES = (2.0, 2.0, 8.0)


def model() -> GreyBox:
    return GreyBox(small_vehicle({"added_mass": 0.1}))


@pytest.fixture(scope="module")
def dives(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("dives")
    for k, force in enumerate(FORCES):
        truth = model().with_effects({"net_buoyancy": {"force": force}})
        log = make_log(truth, runs=1, duration=16.0, rate=10.0, noise=1.0, seed=k)
        log.write(folder / f"dive_2026-05-{10 + 2 * k}.parquet")
    (folder / "dive_2026-05-20.parquet").write_bytes(b"PAR1 and no more")
    return folder


@pytest.fixture(scope="module")
def found(dives):
    return fleet(model(), dives, "net_buoyancy", window=2.0)


def test_equal_values_are_constant_and_have_no_slope():
    random = np.random.default_rng(1)
    p_constant, p_slope = [], []
    for _ in range(400):
        std = random.uniform(0.5, 2.0, 12)
        told = trend(np.arange(12), 3.0 + std * random.normal(size=12), std)
        p_constant.append(told.constant_p)
        p_slope.append(told.slope_p)
    # Under the hypothesis p-values are uniform; those of the slope err on the safe side where scatter scales them.
    assert stats.kstest(p_constant, "uniform").pvalue > 1e-3
    assert np.mean(np.array(p_slope) < 0.05) < 0.08


def test_a_line_is_that_of_weighted_least_squares():
    random = np.random.default_rng(2)
    x, std = np.sort(random.uniform(0, 50, 9)), random.uniform(0.2, 0.4, 9)
    y = 1.0 + 0.3 * x + std * random.normal(size=9) * 0.5
    told = trend(x, y, std)
    line, covariance = np.polyfit(x, y, 1, w=1 / std, cov="unscaled")
    assert told.slope == pytest.approx(line[0]) and told.slope_std == pytest.approx(covariance[0, 0] ** 0.5)
    assert told.level == pytest.approx(np.polyval(line, told.middle))
    assert told.slope_p < 1e-10 and told.constant_p < 1e-10 and told.scatter < 1.0


def test_scatter_beyond_what_is_stated_widens_the_slope():
    random = np.random.default_rng(3)
    x, y = np.arange(20.0), random.normal(size=20)
    told = trend(x, y, np.full(20, 0.1))
    line = stats.linregress(x, y)
    assert told.slope_std == pytest.approx(line.stderr) and told.slope_p == pytest.approx(line.pvalue)


@pytest.mark.parametrize(("count", "finite"), [(0, 0), (1, 1), (2, 1)])
def test_few_values_have_no_slope(count, finite):
    told = trend(np.arange(count), np.ones(count), np.full(count, 0.1))
    assert np.isfinite(told.mean) == bool(finite) and not np.isfinite(told.slope)
    assert np.isfinite(told.constant_p) == (count > 1)


def test_what_has_no_standard_error_does_not_count():
    told = trend([0, 1, 2], [1.0, 9.0, 1.0], [0.1, np.nan, 0.1])
    assert told.count == 2 and told.mean == pytest.approx(1.0)


def test_values_of_each_dive_are_those_that_were_hidden(found):
    assert [d["verdict"] for d in found.dives] == ["adequate"] * 3
    for entry, force in zip(found.dives, FORCES, strict=True):
        row = entry["parameters"]["net_buoyancy"]["force"]
        assert row["unit"] == "N" and 0 < row["std"] < 1.0
        assert abs(row["value"] - force) < 4 * row["std"]


def test_a_change_is_seen_and_put_in_words(found):
    (row,) = found.trends
    assert row["changes"] and row["constancy"]["p_value"] < 1e-6
    assert "net_buoyancy.force" in row["words"] and "not the same on all" in row["words"]
    # Values to two digits of their standard deviation, slopes by the day; no probability of nothing at all.
    assert re.search(r"mean \d+\.\d{2,3} ± 0\.0\d{1,2} N over 3 dives", row["words"]), row["words"]
    assert " N per day (p" in row["words"] and "p = 0)" not in row["words"]
    assert found.metrics["parameters_changing"] == 1


def test_dives_are_in_order_of_the_dates_in_their_names(found):
    assert found.along == "date"
    assert [d["days"] for d in found.dives] == [0.0, 2.0, 4.0]
    assert found.dives[0]["start"] == "2026-05-10T00:00:00+00:00" and found.dives[0]["start_from"] == "name"
    assert found.trends[0]["slope"]["unit"] == "N/d"


def test_a_dive_that_cannot_be_fitted_fails_alone(found):
    (lost,) = found.failed
    assert "dive_2026-05-20" in lost["file"] and "cut short" in lost["words"]
    assert any("could not be fitted" in w for w in found.warnings)


def test_the_answer_is_plain_and_has_a_page_and_a_figure(found, tmp_path):
    found.write(tmp_path)
    data = json.loads((tmp_path / "fleet.json").read_text())
    assert data["schema"] == "auvnn/fleet/1" and len(data["dives"]) == 3
    page = (tmp_path / "report.html").read_text()
    assert "Not the same on all dives" in page and "dive_2026-05-20" in page
    assert any(p.name.startswith("over_dives") for p in (tmp_path / "figures").iterdir())


def test_an_effect_that_needs_what_a_dive_lacks_is_told(dives):
    path = sorted(dives.iterdir())[0]
    told = dive(Question(model(), ("bottom_proximity",), Mapping.read(None), 2.0, 8, False), path)
    assert isinstance(told, str) and "altitude" in told


def test_wrong_questions_are_refused(dives, tmp_path):
    for effects, words in (
        ([], "at least one"),
        (["net_bouyancy"], "Did you mean"),
        (["waves", "waves"], "twice"),
    ):
        with pytest.raises(ConfigError, match=words):
            fleet(model(), dives, effects)
    with pytest.raises(InputError, match="without a log file"):
        fleet(model(), tmp_path, "net_buoyancy")
    with pytest.raises(InputError, match="none of 1 dives"):
        fleet(model(), dives / "dive_2026-05-20.parquet", "net_buoyancy")


def test_commands_that_change_between_samples_are_fitted_so(tmp_path):
    """Held, they would leave the added mass off to make up for it, and the dive with something unexplained."""
    held, thin = (1.5, 4.0)
    for k, force in enumerate((held, thin)):
        truth = GreyBox(small_vehicle()).with_effects({"net_buoyancy": {"force": force}})
        log = make_log(truth, runs=2, duration=30.0, rate=25.0, noise=1.0, max_step=0.04, seed=k, first=2 * k)
        (thinned(log, 5) if force == thin else log).write(tmp_path / f"dive{k}.parquet")
    found = fleet(GreyBox(small_vehicle()), tmp_path, "net_buoyancy")
    first, second = found.dives
    assert first["commands"] is None
    assert second["commands"]["share_of_next"] == pytest.approx(0.4, abs=0.12)
    for entry, force in zip(found.dives, (held, thin), strict=True):
        assert entry["verdict"] == "adequate"
        assert entry["parameters"]["net_buoyancy"]["force"]["value"] == pytest.approx(force, rel=0.03)
        mass = entry["coefficients"]["added_mass"]
        assert all(abs(mass[k]["value"] - 1.0) < 0.03 for k in "XYZ")
    (told,) = [w for w in found.warnings if "between samples" in w]
    assert "1 of 2" in told and "dive1" in told
