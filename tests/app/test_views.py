"""What the page makes of answers that a quick log does not give: partial verdicts, costs, the whole loop."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the page's server is not installed: pip install 'auvnn[app]'")

from auvnn.app.records import Job, step_of, words_of
from auvnn.app.script import Told, commands, python
from auvnn.app.session import Session
from tests.app.app_browser import Watched, barriers, browser, served, title, why_not
from tests.app.test_pages import Asker, dive

__all__ = ["dive"]


def candidate(name: str, explained: float) -> dict[str, Any]:
    values = {"force": {"value": 3.2, "std": 0.4, "unit": "N"}}
    return {
        "effect": name, "p_value": 1e-4, "explained": explained, "cv_before": 1.2, "cv_after": 1.1,
        "parameters": values, "confusable_with": [], "needs": [],
    }  # fmt: skip


def left(rms: float) -> dict[str, float]:
    return {"rms": rms, "upper": 1.2 * rms, "correlation_time": 3.0, "share": 0.05, "detectable": 0.3}


PARTIAL: dict[str, Any] = {
    "schema": "auvnn/diagnosis/1", "model": "rov95", "log": "dive", "verdict": "partial", "missing": [],
    "nearest": ["net_buoyancy", "constant_force"], "story": ["Something is missing that no effect explains as a whole."],
    "candidates": [candidate("waves", 0.1), candidate("net_buoyancy", 0.4), candidate("constant_force", 0.2)],
    "joint": {
        name: {
            "parameters": {"force": {"value": 3.2, "std": 0.4, "unit": "N"}}, "explained_by_dof": {"Z": 0.4, "X": 0.1},
            "gain": {"value": 0.05, "std": 0.01}, "confounded_with": [{"effect": "waves", "similarity": 0.9}],
        }
        for name in ("net_buoyancy", "constant_force")
    },
    "matters": {}, "left": {**{a: left(1.0) for a in "XYZKMN"}, "cost": 0.2}, "unexplained": 0.5,
    "depends_on": {"Z": {"u": 0.3}}, "next_experiment": None, "warnings": [], "steps": [],
}  # fmt: skip
NAMED = {
    **PARTIAL, "verdict": "named", "missing": ["net_buoyancy", "waves"], "nearest": [], "joint": {},
    "matters": {
        "net_buoyancy": {"cost": 0.8, "worst": None, "force": {}, "share": 0.3, "matters": True},
        "waves": {"cost": 0.02, "worst": None, "force": {}, "share": 0.01, "matters": False},
    },
}  # fmt: skip
GAIN = {"value": 0.2, "std": 0.01}
IMPROVED: dict[str, Any] = {
    "schema": "auvnn/improve/1", "model": "rov95", "log": "dive", "test": "dive", "verdict": "from 0.5 to 0.1",
    "waterfall": [
        {"step": "as given", "kind": "left", "error": 0.5},
        {"step": "ocean_current", "kind": "a cause with a name", "error": 0.1},
        {"step": "noise floor", "kind": "left", "error": 0.08},
    ],
    "steps": [
        {"step": "ocean_current", "kind": "a cause with a name", "gain": GAIN, "before": 0.5, "after": 0.3}
    ],
    "tried": [{"step": "waves", "kind": "a name that only predicts", "accepted": False, "gain": GAIN}],
    "loses": {"baseline": ["p"], "persistence": []}, "story": ["Compared.", "Added ocean_current."], "warnings": ["mind"],
}  # fmt: skip


@pytest.fixture
def asker(tmp_path):
    work = tmp_path / "work"
    work.mkdir()
    session = Session(work, tmp_path / "out", "rov95")
    yield Asker(session)
    session.close()


def walked(asker, tmp_path) -> Path:
    """Let the child process have walked the loop."""
    from auvnn.models import load

    folder = asker.session.work / "answers" / "1_improve"
    folder.mkdir(parents=True)
    load("rov95").with_effects({"ocean_current": {"v_north": 0.1}}).save(folder / "model")
    (folder / "improve.json").write_text(json.dumps(IMPROVED))
    (folder / "more.json").write_text("{}")
    asker.session.job = Job(1, "improve", words_of("improve", []), folder, time.monotonic())
    asker.session._hear({"job": 1, "progress": "diagnosing"})
    assert asker.get("state")["job"]["lines"] == ["diagnosing"]
    asker.session._hear({"job": 1, "done": {"verdict": IMPROVED["verdict"]}})
    return folder


def test_the_whole_loops_model_is_kept_taken_back_and_saved(asker, tmp_path, dive):
    asker.post("open", path=str(dive))
    asker.wait()
    folder = walked(asker, tmp_path)
    state = asker.get("state")
    assert state["job"]["state"] == "done" and state["can_keep_improved"] and not state["can_keep"]
    assert asker.get("answer?kind=improve")["waterfall"] == IMPROVED["waterfall"]
    assert asker.post("keep", kind="nothing")[0] == 400
    asker.post("keep", kind="improve")
    state = asker.get("state")
    assert state["history"][-1]["words"] == "improved by ocean_current" and not state["can_keep_improved"]
    assert state["history"][-1]["error"] == {"before": 0.5, "after": 0.1, "floor": 0.08}
    assert asker.post("keep", kind="improve")[0] == 400, "it is in the model already"
    assert [e["name"] for e in asker.get("effects") if e["present"]] == ["ocean_current"]
    script = asker.get("script")
    assert (
        "auvnn improve model=rov95" in script["commands"] and "auvnn.improve(model, log" in script["python"]
    )
    compile(script["python"], "loop.py", "exec")
    (folder / "report.html").write_text("the report of the loop")
    held = asker.post("save", folder=str(tmp_path / "saved"))["holds"]
    assert {"model/", "improve.json", "report.html"} <= set(held)
    assert (tmp_path / "saved" / "report.html").read_text() == "the report of the loop"
    asker.post("take-back")
    assert len(asker.get("state")["history"]) == 1 and asker.get("state")["can_keep_improved"]


def test_improve_needs_a_log_and_a_model(asker):
    assert asker.post("start", kind="improve") == (400, "there is no log yet: drop a file, or choose one")


def test_steps_of_both_kinds_are_told_and_scripted():
    assert step_of("improve", Path("x"), {**IMPROVED, "steps": []}).words.startswith("improved by nothing")
    told = Told("rov95", "thrusters", ((), ("waves",)), False, True)
    assert "model=again/improve_1/model" in commands(told, Path("there")) and "auvnn.improve" in python(told)


REASON = why_not()


@pytest.fixture(scope="module")
def page(dive, tmp_path_factory):
    """A page on which answers are what a test says they are."""
    folder = tmp_path_factory.mktemp("views")
    with browser() as running, served(folder, "model=rov95", f"log={dive}") as (address, _):
        watched = Watched(running)
        watched.page.goto(address)
        watched.page.wait_for_selector(".step.done")
        watched.address = address
        yield watched
        assert not watched.complaints and not watched.strangers
        watched.close()


def shows(watched: Any, screen: str, words: str, **answers: Any) -> Any:
    """Open a screen as if these answers had been given."""
    page = watched.page
    page.unroute_all()

    def state(route: Any) -> None:
        found = route.fetch().json()
        found["answers"] = {k: {"summary": a, "stale": False, "report": True} for k, a in answers.items()}
        found["can_keep_improved"] = "improve" in answers
        found["version"] += 1000
        route.fulfill(json=found)

    def answer(route: Any) -> None:
        kind = route.request.url.partition("kind=")[2].partition("&")[0]
        route.fulfill(json={"more": {}, **answers[kind]}) if kind in answers else route.continue_()

    page.route("**/api/state*", state)
    page.route("**/api/answer?*", answer)
    page.goto("about:blank")
    page.goto(f"{watched.address}#{screen}")
    title(page, words)
    return page


@pytest.mark.skipif(bool(REASON), reason=REASON)
def test_a_partial_verdict_claims_no_cause(page):
    found = shows(page, "missing", "What is missing", diagnosis=PARTIAL)
    found.wait_for_selector(".verdict.warn")
    text = found.inner_text("main")
    assert "none of them is claimed as the cause: net_buoyancy, constant_force" in text
    assert "What predicts a part" in text and "Cannot be told apart from waves" in text and "Z 40" in text
    cards = found.locator(".candidate h3").all_inner_texts()
    assert (
        cards[0].startswith("net_buoyancy") and "predicts" in cards[0] and not cards[2].endswith("predicts")
    )
    # After what predicts, by what each explains alone.
    assert [c.split()[0].removesuffix("predicts") for c in cards] == [
        "net_buoyancy",
        "constant_force",
        "waves",
    ]
    assert found.locator("#try").inner_text() == "Try net_buoyancy, constant_force"
    assert not barriers(found, "partial")


@pytest.mark.skipif(bool(REASON), reason=REASON)
def test_what_does_not_matter_says_so(page):
    found = shows(page, "missing", "What is missing", diagnosis=NAMED)
    found.wait_for_selector(".verdict.good")
    rows = found.locator('[aria-label="What each name costs"] tbody tr').all_inner_texts()
    assert rows[0].split()[:2] == ["net_buoyancy", "yes"] and rows[1].split()[:2] == ["waves", "no"]
    assert "80 %" in rows[0] and not barriers(found, "matters")


@pytest.mark.skipif(bool(REASON), reason=REASON)
def test_the_whole_loop_is_one_button_and_ends_in_its_waterfall(page):
    found = shows(page, "result", "Result")
    assert found.locator("#improve").inner_text() == "Improve"
    found = shows(page, "result", "Result", improve=IMPROVED)
    found.wait_for_selector("#improved")
    text = found.inner_text("main")
    assert "from 0.5 to 0.1" in text and "Worse than the plain regression in p" in text
    assert (
        found.locator("#keep-improved").is_visible()
        and found.locator("#improve").inner_text() == "Walk it again"
    )
    assert found.locator("ol.waterfall li").count() == 3
    assert not barriers(found, "improved")


@pytest.mark.long
@pytest.mark.skipif(bool(REASON), reason=REASON)
def test_improve_runs_can_be_stopped_and_ends_in_a_model(page):
    page.page.unroute_all()
    found = page.page
    found.goto("about:blank")
    found.goto(f"{page.address}#result")
    found.click("#improve")
    found.wait_for_selector("#stop")
    found.click("#stop")
    found.wait_for_function("document.querySelector('#job').innerText.includes('Stopped')")
    found.click("#improve")
    found.wait_for_selector("#improved", timeout=600_000)
    found.click("#keep-improved")
    found.wait_for_function("document.querySelector('.history').innerText.includes('improved by')")
