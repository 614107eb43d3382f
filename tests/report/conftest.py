"""Pages and figures that tests of reports share."""

import json

import pytest
from filelock import FileLock
from markupsafe import Markup

from auvnn.report import style
from tests.conftest import LAID_OUT
from tests.report.report_fakes import KINDS, drawer, make


@pytest.fixture
def unseen(monkeypatch):
    """Make figures, but do not render them."""
    monkeypatch.setattr("auvnn.report.page.figure_markup", lambda *_: Markup('<div class="plot"></div>'))
    monkeypatch.setattr(style, "settle", lambda figure: figure)


@pytest.fixture(scope="session")
def pages(tmp_path_factory, worker_id) -> dict[str, str]:
    """Return all pages, their figures laid out; whichever worker needs them first draws them for all."""

    def drawn():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(style, "settle", LAID_OUT)
            return {kind: drawer(kind).page(make(kind, 1200, 1)) for kind in KINDS}

    if worker_id == "master":
        return drawn()
    place = tmp_path_factory.getbasetemp().parent / "pages.json"
    with FileLock(f"{place}.lock"):
        if not place.exists():
            place.write_text(json.dumps(drawn()), encoding="utf-8")
    return json.loads(place.read_text(encoding="utf-8"))


@pytest.fixture(scope="module", autouse=True)
def layout(laid_out_figures):
    """Lay figures out: where their parts lie is what these tests ask."""
