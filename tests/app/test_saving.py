"""Saving from the page: everything or nothing, reports included, and what can never be there is said."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the page's server is not installed: pip install 'auvnn[app]'")

from auvnn.app import saving
from auvnn.app.jobs.tasks import Tasks
from auvnn.app.session import Session
from auvnn.app.source import Source
from auvnn.errors import ConfigError, InputError
from tests.log_samples import make_log


class Still:
    """A child process that is there and does nothing."""

    def __init__(self, alive: bool = True) -> None:
        self.alive = alive

    def warm(self) -> None:
        """Be there already."""

    def close(self) -> None:
        """Have nothing to end."""


@pytest.fixture
def session(tmp_path):
    """A log, a model, and the answer of a comparison whose report is not drawn yet."""
    work = tmp_path / "work"
    work.mkdir()
    log = tmp_path / "dive.parquet"
    make_log(2).write(log)
    made = Session(work, tmp_path / "out", "rov95")
    made.child = Still()
    made.open(Source([log]))
    place = work / "answers" / "1_compare"
    place.mkdir(parents=True)
    (place / "comparison.json").write_text("{}")
    made.answers["comparison"], made.summaries["comparison"] = place, {}
    yield made
    made.close()


def empty(folder: Path) -> bool:
    """Whether neither the folder nor anything that was to become it is there."""
    return not folder.exists() and not list(folder.parent.glob(f".{folder.name}.*"))


def test_a_report_that_is_not_drawn_in_time_refuses_and_writes_nothing(session, tmp_path, monkeypatch):
    monkeypatch.setattr(saving, "PATIENCE", 0.0)
    with pytest.raises(InputError, match=r"still being drawn .* nothing was saved; press Save again"):
        saving.save(session, tmp_path / "mine")
    assert empty(tmp_path / "mine") and not session.saved and not session.saving


def test_a_report_that_is_drawn_meanwhile_is_waited_for_and_nothing_begins(session, tmp_path):
    held = []
    thread = threading.Thread(target=lambda: held.extend(saving.save(session, tmp_path / "mine")[0]))
    thread.start()
    while not session.saving:
        time.sleep(0.01)
    with pytest.raises(ConfigError, match="is being saved"):
        session.start("compare")
    assert empty(tmp_path / "mine")
    (session.answers["comparison"] / "report.html").write_text("<p>drawn</p>")
    thread.join(30)
    assert {"comparison.html", "comparison.json", "log.parquet", "loop.py", "commands.sh"} <= set(held)


@pytest.mark.parametrize(("alive", "words"), [(True, "ValueError: no such glyph"), (False, saving.GONE)])
def test_a_report_that_can_never_be_there_is_told(session, tmp_path, alive, words):
    session.child.alive = alive
    if alive:
        session._hear({"drawn": str(session.answers["comparison"]), "problem": "ValueError: no such glyph"})
    held, without = saving.save(session, tmp_path / "mine")
    assert without == [f"the report of the comparison is not there: {words}"]
    assert "comparison.json" in held and "comparison.html" not in held
    assert session.state()["saved_without"] == without


def test_a_drawing_that_fails_costs_its_report_and_not_the_process(tmp_path):
    class Answer:
        def report(self, path: Path) -> None:
            if path.parent.name == "bad":
                raise ValueError("no such glyph")
            path.write_text("<p>drawn</p>")

    tasks = Tasks()
    for name in ("bad", "good"):
        (tmp_path / name).mkdir()
        tasks._pending.append((Answer(), tmp_path / name / "report.html"))
    assert list(tasks.draw_all()) == [
        (str(tmp_path / "bad"), "ValueError: no such glyph"),
        (str(tmp_path / "good"), ""),
    ]
    assert (tmp_path / "good" / "report.html").is_file()


def test_a_stop_before_a_job_begins_leaves_the_reports_that_are_being_drawn(tmp_path):
    """The worker draws before it begins; asked to leave the job out it goes on drawing, and does the next job."""
    import json
    import subprocess
    import sys

    script = (
        "import time\n"
        "from auvnn.app.jobs import tasks, worker\n"
        "class Slow:\n"
        "    def __init__(self): self.left = ['earlier']\n"
        "    def draw_one(self):\n"
        "        return iter(())\n"
        "    def draw_all(self):\n"
        "        while self.left:\n"
        "            time.sleep(0.6)\n"
        "            yield self.left.pop(), ''\n"
        "    def do(self, order, say):\n"
        "        say('at work')\n"
        "        time.sleep(30 if order['kind'] == 'long' else 0)\n"
        "        return {}\n"
        "tasks.Tasks = Slow\n"
        "worker.main()\n"
    )
    child = subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert child.stdin is not None and child.stdout is not None

    def ask(**order):
        child.stdin.write(json.dumps(order) + "\n")
        child.stdin.flush()

    def heard():
        return json.loads(child.stdout.readline())

    ask(job=1, kind="short")
    ask(skip=1)
    assert heard() == {"job": 1, "left_out": True}
    assert heard() == {"drawn": "earlier", "problem": ""}
    ask(job=2, kind="long")
    assert heard() == {"job": 2, "progress": "at work"}, (
        "what was left out does nothing, and the next job is done"
    )
    ask(skip=2)
    assert heard() == {"job": 2, "left_out": False}, "a job that has begun ends only with its process"
    child.kill()
    child.wait(30)
