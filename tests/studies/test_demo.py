"""The demo keeps its promises: one run of it, looked at from all sides.

By hand (-m long): `.ci/run` runs the README's demo itself, and tests/cli one of a quarter of the length.
"""

from __future__ import annotations

import json
import re
import time
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from auvnn.logs import Log
from auvnn.metrics.rollouts import rollout_table, scale_of
from auvnn.models import load
from auvnn.studies import demo

pytestmark = pytest.mark.long
SPEEDS = ("v_north", "v_east", "v_down")


class Ran(NamedTuple):
    """What a run of the demo said, left behind and answered."""

    answer: demo.Demo
    data: dict[str, Any]
    folder: Path
    lines: list[str]
    seconds: float


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    folder = tmp_path_factory.mktemp("demo") / "tour"
    lines: list[str] = []
    # Of the processor: how long it takes by the clock depends on who else is computing.
    began = time.process_time()
    answer = demo.run_demo(folder, seed=0, say=lines.append)
    return Ran(answer, answer.to_dict(), folder, lines, time.process_time() - began)


def test_the_current_is_named_first_and_alone(ran):
    assert ran.data["verdict"] == "named"
    assert ran.data["missing"] == ["ocean_current"]
    assert ran.answer.diagnosis.candidates[0]["effect"] == "ocean_current"


@pytest.mark.parametrize("name", SPEEDS)
def test_each_component_is_found_with_a_small_and_true_standard_error(ran, name):
    hidden = {"v_north": 0.15, "v_east": -0.10, "v_down": 0.0}[name]
    for found in (ran.data["parameters"], ran.answer.improvement.parameters):
        entry = found["ocean_current"][name]
        assert entry["unit"] == "m/s"
        assert 0 < entry["std"] <= 0.01
        assert abs(entry["value"] - hidden) <= 3 * entry["std"]


def test_the_error_falls_to_that_of_the_true_model(ran):
    metrics = ran.data["metrics"]
    assert metrics["error_after"] <= 1.1 * metrics["error_true_model"]
    assert metrics["error_after"] < 0.5 * metrics["error_as_given"]
    # The floor is estimated from the noise, the error is one draw of it.
    assert metrics["error_noise_floor"] == pytest.approx(metrics["error_true_model"], rel=0.2)
    assert ran.answer.improvement.accepted


def test_the_errors_are_those_of_a_run_that_was_not_fitted(ran):
    # From the files alone, and scored without the demo.
    test = Log.read(ran.folder / "simulate" / "test.parquet")
    truth = load("rov95").with_effects(demo.HIDDEN)
    scale = scale_of(test)
    errors = {name: rollout_table(model, test, scale, ("5",))[0]["5"]["total"]
              for name, model in (("given", load("rov95")), ("true", truth),
                                  ("after", load(ran.folder / "add" / "model")))}  # fmt: skip
    metrics = ran.data["metrics"]
    assert errors["given"] == pytest.approx(metrics["error_as_given"], rel=1e-6)
    assert errors["true"] == pytest.approx(metrics["error_true_model"], rel=1e-6)
    assert errors["after"] == pytest.approx(metrics["error_after"], rel=1e-6)


def test_the_story_is_a_dozen_lines_with_what_matters(ran):
    assert ran.data["story"] == ran.lines[:-1]
    assert 8 <= len(ran.lines) <= 14
    text = "\n".join(ran.lines)
    for part in ("Missing: ocean_current", "held-out error", "noise alone", "hidden was: v_north 0.15"):
        assert part in text
    assert ran.lines[-1].endswith(str(ran.folder / "report.html"))


@pytest.mark.parametrize(
    "path",
    [
        "simulate/log.parquet", "simulate/test.parquet", "simulate/truth.json", "check/quality.json",
        "check/report.html", "compare/comparison.json", "compare/report.html", "diagnose/diagnosis.json",
        "diagnose/report.html", "add/improvement.json", "add/report.html", "add/model", "report.html",
        "figures",
    ],
)  # fmt: skip
def test_every_verb_leaves_what_it_leaves_alone(ran, path):
    found = ran.folder / path
    assert found.exists()
    assert list(found.iterdir()) if found.is_dir() else found.stat().st_size > 0
    if path.endswith(".json"):
        assert json.loads(found.read_text())["schema"].startswith("auvnn/")


def test_the_answers_written_are_the_answers_told(ran):
    diagnosis = json.loads((ran.folder / "diagnose" / "diagnosis.json").read_text())
    assert diagnosis["missing"] == ran.data["missing"]
    truth = json.loads((ran.folder / "simulate" / "truth.json").read_text())
    assert truth["hidden"] == ran.data["hidden"] == demo.HIDDEN


def test_every_report_is_complete_in_itself(ran):
    pages = sorted(ran.folder.rglob("*.html"))
    assert len(pages) == 5
    for page in pages:
        html = page.read_text(encoding="utf-8")
        assert html.startswith("<!doctype html>") and html.rstrip().endswith("</html>")
        for remote in re.findall(r"""(?:src|href|srcset|action|data)\s*=\s*["']([^"']*)""", html):
            assert remote.startswith(("#", "data:image/png;base64,")), f"{page.name}: {remote[:60]}"
        assert not re.search(r"<(script|iframe|object|embed|link|base|form)\b|@import|https?://", html)
        assert "There is no figure here" not in html and "What could not be shown" not in html


def test_the_report_tells_the_result(ran):
    html = (ran.folder / "report.html").read_text(encoding="utf-8")
    assert "The model lacks ocean_current." in html and "What had been hidden" in html
    for line in ran.data["story"][:3]:
        assert line[:40] in html


def test_it_is_quick(ran):
    assert ran.seconds < 180
