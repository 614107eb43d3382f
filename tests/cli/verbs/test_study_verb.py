"""`auvnn study`: composes, refuses what it does not know, and runs each case, cut down, from end to end."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from auvnn.cli.main import VERBS
from auvnn.cli.verbs.study import TAKEN
from auvnn.models import load
from auvnn.studies.paper import CASES
from auvnn.studies.paper.options import Options

QUICK = {
    "noise_free": ["case.larger=null", "case.structures=[classical,damping]", "case.rich.duration=6"],
    "noisy": ["duration=9", "case.offline.data=manoeuvre", "case.held_out.duration=6", "case.stride=20"],
    "payload": ["duration=10", "case.offline.data=manoeuvre", "case.stride=10", "case.time=3", "manoeuvre.time=6"],
}  # fmt: skip
FIGURES = {
    "noise_free": ["figure_5", "held_out", "damping", "structures"],
    "noisy": ["figure_6", "figure_7", "frozen", "damping"],
    "payload": ["figure_8", "figure_9", "frozen"],
}


@pytest.fixture(autouse=True)
def elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("case", CASES.names())
def test_each_case_composes_to_options(case, auvnn):
    status, out, err = auvnn("study", f"case={case}", "--cfg", "job")
    assert (status, err) == (0, "")
    given = yaml.safe_load(out)
    assert set(TAKEN) <= set(given)
    full, smoke = Options.read(given), Options.read({**given, "effort": "smoke"})
    assert full.name == case
    # The paper's own numbers, and a smoke run that asks for no more than they do.
    assert full.manoeuvre == {"force": 100.0, "moment": 10.0, "time": 15.0}
    assert smoke.duration < full.duration and smoke.scheme["restarts"] == 1


# Longer than a test should take; the checks of the whole tree run all three from the command line.
@pytest.mark.long
@pytest.mark.parametrize("case", CASES.names())
def test_each_case_runs_and_leaves_what_it_says(case, auvnn):
    status, _, err = auvnn("study", f"case={case}", "effort=smoke", "out=out", *QUICK[case])
    assert status == 0 and "Traceback" not in err, err
    assert {p.name + "/" * p.is_dir() for p in Path("out").iterdir()} - {".hydra/"} == set(
        VERBS.get("study").writes
    )
    answer = json.loads(Path("out/study.json").read_text())
    assert answer["schema"] == "auvnn/study/1" and answer["case"] == case and answer["model"] == "rov95"
    assert [f["name"] for f in answer["figures"]] == FIGURES[case]
    assert (
        all(isinstance(v, int | float) for v in answer["metrics"].values())
        and answer["metrics"]["parameters"] == 426
    )
    assert any(words.startswith("ours: ") for words in answer["assumed"])
    drawn = {p.name for p in Path("out/figures").iterdir()}
    assert {f"{name}.png" for name in FIGURES[case]} <= drawn
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert "could not be drawn" not in page and "A smoke run" in page
    assert load("out/model").damping is not None
    # A figure's numbers are beside it: the plant's and every model's velocity.
    curve = next(name for name in FIGURES[case] if f"{name}.csv" in drawn)
    with open(f"out/figures/{curve}.csv", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    assert rows[0][:7] == ["t", *(f"plant_{a}" for a in "uvwpqr")] and len(rows[0]) % 6 == 1
    table = np.array(rows[1:], dtype=float)
    assert np.isfinite(table).all() and (np.diff(table[:, 0]) > 0).all()
    if case == "noise_free":
        # The figure's curves give the metric.
        plant, model = table[:, 1:7], table[:, 7:13]
        worst = (np.sqrt(np.mean((plant - model) ** 2, 0)) / np.ptp(plant, 0)).max()
        assert worst == pytest.approx(
            answer["metrics"]["manoeuvre_rmse_over_range_worst"], rel=0.05, abs=1e-6
        )
        assert worst < 0.01 < 0.5 < answer["metrics"]["manoeuvre_zero_damping_rmse_over_range_worst"]
    if case == "payload":
        before, after = table[table[:, 0] < 2.99], table[table[:, 0] > 4.0]
        # Up to the pick-up the networks are right; afterwards the vehicle is slower than they say.
        offline = table.shape[1] - 6
        assert len(before) and np.isfinite(after[:, offline:]).all()
        assert answer["metrics"]["mass_ratio"] == pytest.approx(155 / 95)
        assert (answer["metrics"]["damping_factor_min"], answer["metrics"]["damping_factor_max"]) == (
            1.5,
            10.0,
        )


def test_bad_options_are_told_in_one_line(refused):
    assert "'noise_free'" in refused("study", "case=noise_fre")
    assert "choose full or smoke" in refused("study", "effort=quick", "out=out")
    assert "'rate'" in refused("study", "rat=3")
    assert "std or uniform" in refused(
        "study", "case=noisy", "case.noise.amplitude=peak", "effort=smoke", "out=out"
    )
    assert "pick-up must lie within" in refused("study", "case=payload", "case.time=200", "effort=smoke",
                                                "case.offline.data=manoeuvre", "out=out")  # fmt: skip
    assert not Path("out").exists()


def test_a_dry_run_says_what_it_would_write(auvnn):
    status, out, err = auvnn("study", "case=noisy", "out=out", "dry_run=true")
    assert (status, err) == (0, "")
    assert "would write  study.json, model/, report.html, figures/ in out" in out and not Path("out").exists()
