"""The page's addresses without a browser: a log, its mapping, a job in the child process, stopping, saving."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("starlette", reason="the page's server is not installed: pip install 'auvnn[app]'")

from auvnn.app.session import Session
from auvnn.app.web import Pages
from auvnn.logs import Log
from tests.app.asking import ask
from tests.log_samples import frame, make_log


class Asker:
    """Asks a page's application."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.app = Pages(session).app()

    def get(self, name: str):
        return self._plain(*ask(self.app, f"/api/{name}"))

    def post(self, name: str, **body):
        return self._plain(*ask(self.app, f"/api/{name}", "POST", body))

    def put(self, path: str, content: bytes):
        return self._plain(*ask(self.app, f"/api/{path}", "PUT", content))

    @staticmethod
    def _plain(status, _headers, body):
        data = json.loads(body)
        return data if status == 200 else (status, data["error"])

    def wait(self, seconds: float = 60.0) -> dict:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            state = self.get("state")
            job, log = state["job"], state["log"]
            if not (job and job["state"] == "running") and not (log and log["ready"] and not log["judged"]):
                return state
            time.sleep(0.05)
        raise AssertionError("did not come to rest")


@pytest.fixture
def asker(tmp_path):
    work = tmp_path / "work"
    work.mkdir()
    session = Session(work, tmp_path / "out", "rov95")
    yield Asker(session)
    session.close()
    assert not work.exists()


@pytest.fixture(scope="module")
def dive(tmp_path_factory) -> Path:
    """A log without thrusters or a wrench fits no model; this one has eight thrusters."""
    from auvnn.models import load
    from auvnn.simulation import simulate

    path = tmp_path_factory.mktemp("dive") / "dive.parquet"
    hidden = {"ocean_current": {"v_north": 0.3, "v_east": -0.2}}
    simulate(load("rov95"), "multisine", "none", hidden, 0, runs=2, duration=12.0, rate=10.0).log.write(path)
    return path


def test_a_dropped_file_is_read_and_checked(asker, dive):
    state = asker.put("upload?name=../../my%20dive.parquet", dive.read_bytes())
    assert state["log"]["ready"] and state["log"]["name"] == "my_dive"
    assert asker.wait()["log"]["sizes"]["errors"] == 0
    log = asker.get("log")
    assert {c["name"] for c in log["columns"]} >= {"t", "u", "r", "thruster_8"}
    assert "is held out" in log["held_words"] and len(log["fit_runs"]) == 1
    found = asker.get("traces?group=velocity&run=0&points=200")
    np.testing.assert_allclose(found["t"], Log.read(dive).runs[0].t, atol=1e-5)
    # What was dropped lies in the work folder and nowhere else, whatever its name asked for.
    assert all(asker.session.work in p.parents for p in asker.session.source.files)


def test_columns_are_named_and_units_set_on_the_page(asker, tmp_path):
    path = tmp_path / "foreign.csv"
    frame(make_log(1).runs[0]).rename({"u": "surge velocity", "t": "stamp"}).write_csv(path)
    state = asker.post("open", path=str(path))
    assert not state["log"]["ready"] and "Did you mean" in state["log"]["error"]
    log = asker.get("log")
    assert log["overview"] is None and "surge velocity" in [c["name"] for c in log["raw"]]
    state = asker.post("mapping", mapping=log["offered"])
    assert state["log"]["ready"] and not state["log"]["error"]
    changed = asker.post("mapping", change={"scale": {"u": 2.0}})
    assert changed["log"]["ready"]
    now = asker.get("log")["columns"]
    assert next(c for c in now if c["name"] == "u")["scale"] == 2.0


def test_seconds_since_1970_are_counted_from_the_beginning(asker, dive, tmp_path):
    import polars as pl

    table, path = pl.read_parquet(dive), tmp_path / "dated.csv"
    table.with_columns(pl.col("t") + 1_716_200_000.0).write_csv(path)
    state = asker.post("open", path=str(path))
    assert state["log"]["ready"] and asker.wait()["log"]["sizes"]["errors"] == 0
    for group in ("velocity", "attitude"):
        found = asker.get(f"traces?group={group}&run=1&points=200")
        np.testing.assert_allclose(found["t"], Log.read(dive).runs[1].t, atol=1e-5)
    asker.post("start", kind="compare")
    assert asker.wait()["job"]["state"] == "done"
    log, _, _ = Log.read(dive).split()
    import auvnn

    wanted = auvnn.compare(auvnn.load("rov95"), log).rollout["5"]["total"]
    assert asker.get("answer?kind=comparison")["rollout"]["5"]["total"] == pytest.approx(wanted, rel=1e-4)
    places = asker.get("where")["regimes"]
    marks = asker.get(f"where-marks?regime={next(iter(places))}&bin=1")
    assert all(0.0 <= a <= b <= 12.0 for spans in marks["runs"].values() for a, b in spans)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"path": "no/such/file.parquet"}, "there is no such file"),
        ({"path": "."}, "is a folder"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(asker, body, words):
    answer = asker.post("open", **body)
    said = answer[1] if isinstance(answer, tuple) else answer["log"]["error"]
    assert words in said and "\n" not in said


def test_a_damaged_file_says_so_and_another_one_can_follow(asker, dive):
    state = asker.put("upload?name=bad.parquet", dive.read_bytes()[:500])
    assert not state["log"]["ready"] and state["log"]["error"]
    assert asker.put("upload?name=good.parquet", dive.read_bytes())["log"]["ready"]


def test_nothing_starts_without_a_log(asker):
    assert asker.post("start", kind="compare") == (400, "there is no log yet: drop a file, or choose one")
    assert asker.post("start", kind="format")[0] == 400
    assert asker.get("answer?kind=comparison") == (400, "there is no comparison yet")
    assert asker.post("model", source="no-such-vehicle")[0] == 400
    assert asker.post("keep")[0] == asker.post("take-back")[0] == 400


def test_the_loop_by_addresses(asker, dive, tmp_path):
    """Compare, mark, try, fit, keep, save; the numbers are those of the Python calls."""
    import auvnn

    asker.post("open", path=str(dive))
    asker.wait()
    asker.post("start", kind="compare")
    assert asker.post("start", kind="compare")[0] == 400, "one job at a time"
    assert asker.post("open", path=str(dive))[0] == 400, "the log stays while a job works on it"
    state = asker.wait()
    assert state["job"]["state"] == "done", state["job"]
    log, test, _ = Log.read(dive).split()
    model = auvnn.load("rov95")
    wanted = auvnn.compare(model, log)
    shown = asker.get("answer?kind=comparison")
    assert shown["rollout"]["5"]["total"] == pytest.approx(wanted.rollout["5"]["total"], rel=1e-6)
    assert shown["residual_wrench"]["K"]["rms"] == pytest.approx(wanted.residual_wrench["K"]["rms"], rel=1e-6)

    # A cell's marks hold as many samples as the cell counted.
    places = asker.get("where")["regimes"]
    name = next(iter(places))
    marks = asker.get(f"where-marks?regime={name}&bin=1")
    t = log.runs[0].t
    inside = sum(((t >= a) & (t <= b)).sum() for a, b in marks["runs"][str(log.runs[0].number)])
    assert inside == marks["count"] > 0
    assert asker.get(f"where-marks?regime={name}&bin=99")[0] == 400

    # Tried by hand with the truth the error is next to none, and the report says what compare says.
    tried = asker.post(
        "try", effects={"ocean_current": {"v_north": 0.3, "v_east": -0.2}}, horizon="full", points=400
    )
    assert tried["given"]["total"] == pytest.approx(wanted.rollout["5"]["total"], rel=1e-6)
    assert tried["error"]["total"] < 0.05 * tried["given"]["total"]
    np.testing.assert_allclose(tried["traces"]["series"]["u1"], tried["traces"]["series"]["u"], atol=5e-3)
    assert asker.post("try", effects={"ocean_current": {"v_north": 99.0}})[0] == 400
    assert asker.post("try", effects={"no_such": {}})[0] == 400

    asker.post("start", kind="add", effects=["ocean_current"])
    state = asker.wait(180)
    assert state["job"]["state"] == "done", state["job"]
    assert state["can_keep"] and state["answers"]["improvement"]["summary"]["accepted"]
    told = asker.get("answer?kind=improvement")
    # Said on the page where a plain regression still predicts better.
    assert told["more"]["beaten"] == ""
    fitted = told["parameters"]["ocean_current"]
    assert fitted["v_north"]["value"] == pytest.approx(0.3, abs=0.01)
    held = asker.get("held-traces?points=300")
    np.testing.assert_allclose(held["series"]["u"], test.runs[0].nu[:, 0], atol=1e-5)
    assert asker.post("keep") is None
    state = asker.get("state")
    assert state["history"][-1]["effects"] == ["ocean_current"] and state["answers"]["comparison"]["stale"]
    assert asker.get("effects")[0]["present"]

    folder = tmp_path / "mine"
    saved = asker.post("save", folder=str(folder))
    assert {"model/", "log.parquet", "test.parquet", "improvement.json", "loop.py", "commands.sh"} <= set(
        saved["holds"]
    )
    assert auvnn.load(folder / "model").effect_names == ["ocean_current"]
    assert asker.post("save", folder=str(folder))[0] == 400, "nothing that is there is replaced"
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")], "nothing half-written is left"

    asker.post("take-back")
    assert len(asker.get("state")["history"]) == 1


def test_a_stopped_job_leaves_nothing_and_the_next_one_runs(asker, dive):
    asker.post("open", path=str(dive))
    asker.wait()
    asker.post("start", kind="diagnose")
    time.sleep(1.0)
    asker.post("stop")
    state = asker.get("state")
    assert state["job"]["state"] == "stopped" and "diagnosis" not in state["answers"]
    assert (
        not list((asker.session.work / "answers").glob("*"))
        if (asker.session.work / "answers").exists()
        else True
    )
    asker.post("start", kind="compare")
    assert asker.wait()["job"]["state"] == "done"


def test_the_child_ends_when_its_server_is_gone():
    child = subprocess.Popen(
        [sys.executable, "-m", "auvnn.app.jobs.worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert child.stdin is not None
    child.stdin.close()
    assert child.wait(60) == 0


def test_the_saved_script_is_python_and_names_what_was_done():
    from auvnn.app.script import Told, commands, python

    told = Told(
        "my rov.yaml", "thrusters", (("ocean_current",), ("net_buoyancy", "thruster_lag")), True, True
    )
    compile(python(told), "loop.py", "exec")
    assert python(told).count("auvnn.add(") == 2
    lines = commands(told, Path("/data/a dive"))
    assert "cd '/data/a dive'" in lines and "effect='[net_buoyancy,thruster_lag]'" in lines
    assert "model='my rov.yaml'" in lines and "model=again/add_1/model" in lines
    assert "refit" not in lines and "refit" not in python(told)


def test_the_saved_script_fits_anew_what_the_model_may_have(tmp_path):
    from auvnn.app.script import Told, commands, python

    twice = Told("rov95", "thrusters", (("ocean_current",), ("waves",), ("ocean_current",)), True, False)
    first, second, third = (x for x in commands(twice, Path("there")).splitlines() if "auvnn add" in x)
    assert "refit" not in first + second and "effect=ocean_current refit=true" in third
    assert python(twice).count("refit=True") == 1
    looped = Told("rov95", "thrusters", ((), ("waves",)), True, False)
    assert "effect=waves refit=true" in commands(looped, Path("there"))
    own = tmp_path / "own.yaml"
    own.write_text("effects: {ocean_current: {v_north: 0.1}}\n")
    of_a_file = Told(str(own), "thrusters", (("ocean_current",),), True, False)
    assert "refit=true" in commands(of_a_file, Path("there")) and "refit=True" in python(of_a_file)
