"""The whole loop by one button, to its end: the page's job is the command's."""

from __future__ import annotations

import pytest

pytest.importorskip("starlette", reason="the page's server is not installed: pip install 'auvnn[app]'")

from auvnn.app.session import Session
from tests.app.test_pages import Asker


@pytest.fixture
def asker(tmp_path):
    (tmp_path / "work").mkdir()
    session = Session(tmp_path / "work", tmp_path / "out", "rov95")
    yield Asker(session)
    session.close()


@pytest.mark.long
def test_improve_runs_to_its_end_and_is_kept(asker, demo_file):
    asker.post("open", path=str(demo_file))
    asker.wait()
    asker.post("start", kind="improve")
    state = asker.wait(900)
    assert state["job"]["state"] == "done", state["job"]
    assert state["can_keep_improved"]
    told = asker.get("answer?kind=improve")
    assert "ocean_current" in told["more"]["effects_in_model"]
    first, last = told["waterfall"][0], told["waterfall"][-1]
    assert last["error"] < 0.2 * first["error"], told["waterfall"]
    asker.post("keep", kind="improve")
    assert "ocean_current" in asker.get("state")["history"][-1]["words"]
