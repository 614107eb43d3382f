"""The page in a real browser: the whole loop by clicks, and what goes wrong."""

from __future__ import annotations

import base64
import resource
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from tests.app.app_browser import Watched, barriers, browser, drawn, served, settled, title, why_not
from tests.log_samples import frame, make_log

REASON = why_not()
pytestmark = pytest.mark.skipif(bool(REASON), reason=REASON)

DROP = """async ([text, name]) => {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const data = new DataTransfer();
  data.items.add(new File([bytes], name));
  document.body.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
}"""


def drop(page, path: Path) -> None:
    """Drop a file on the page, as a person does with the mouse."""
    page.evaluate(DROP, [base64.b64encode(path.read_bytes()).decode(), path.name])


@pytest.fixture(scope="module")
def running():
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """One server for the tests that do not mind one another."""
    with served(tmp_path_factory.mktemp("server"), "model=rov95") as (address, _):
        yield address


@pytest.fixture
def watched(running):
    found = Watched(running)
    yield found
    assert not found.strangers, "the page asked another host"
    found.close()


@pytest.mark.long
def test_the_whole_loop_by_clicks(running, demo_file, tmp_path):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with served(tmp_path) as (address, process):
        watched = Watched(running)
        page, found = watched.page, []
        page.goto(address)
        page.wait_for_selector("#drop")
        found += barriers(page, "begin")
        drop(page, demo_file)
        page.wait_for_selector("#model")
        page.select_option("#model", "rov95")
        page.wait_for_selector("#compare:not([disabled])")
        settled(page)
        drawn(page, 5)
        found += barriers(page, "log")

        page.click("#compare")
        title(page, "Where it fails")
        drawn(page, 2)
        page.click('button[aria-label^="roll, speed"] >> nth=5')
        page.wait_for_selector('.cell[aria-pressed="true"]')
        found += barriers(page, "where")

        page.click("#diagnose")
        # Survives a reload in the middle: the job goes on, and its end is seen.
        page.wait_for_selector("#stop")
        page.reload()
        page.wait_for_selector("#stop")
        title(page, "What is missing", 240)
        page.wait_for_selector(".candidate.chosen")
        assert "ocean_current" in page.inner_text(".verdict")
        found += barriers(page, "missing")

        page.click("#try")
        title(page, "Try it")
        drawn(page, 6)
        page.wait_for_selector("#ocean_current-v_north")
        found += barriers(page, "try")
        page.click("#fit")
        page.wait_for_selector("#keep", timeout=240_000)
        assert "Accepted" in page.inner_text("main")
        page.click("#keep")

        title(page, "Result")
        drawn(page, 6)
        found += barriers(page, "result")
        page.click("#save")
        page.wait_for_selector("#told p", timeout=180_000)
        folder = Path(page.inner_text("#told p").removeprefix("Saved: "))
        assert {p.name for p in folder.iterdir()} >= {
            "model",
            "report.html",
            "comparison.html",
            "diagnosis.html",
            "loop.py",
        }
        assert not found, found
        assert not watched.complaints and not watched.strangers, (watched.complaints, watched.strangers)
        watched.close()

        import auvnn

        model = auvnn.load(folder / "model")
        assert model.effect_names == ["ocean_current"]
        values = model.effect("ocean_current").values()
        assert values["v_north"] == pytest.approx(0.15, abs=0.005) and values["v_east"] == pytest.approx(
            -0.10, abs=0.005
        )
    assert process.returncode == 0, "Ctrl-C is how it ends"
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    # The server and its child; the browser, which draws in software here, ends later and is not among them.
    print(f"machine time of server and child: {spent:.0f} s")
    assert spent < 90.0


def test_no_file_is_a_good_log_by_its_name_alone(watched, server, tmp_path):
    page = watched.page
    page.goto(server)
    page.wait_for_selector("#steps .step")
    bad = tmp_path / "bad.parquet"
    bad.write_bytes(b"PAR1 and nothing of the kind")
    drop(page, bad)
    page.wait_for_selector(".card .bad")
    assert "bad.parquet" in page.inner_text(".card .bad")
    assert "cannot be read" in page.inner_text("#steps")


def test_text_from_a_log_stays_text(watched, server, tmp_path):
    import polars as pl

    page = watched.page
    page.goto(server)
    page.wait_for_selector("#steps .step")
    name = '<img src=x onerror="document.title=1"><script>document.title=2</script>'
    path = tmp_path / "<b>bold<b>.parquet"
    frame(make_log(1).runs[0]).with_columns(pl.lit(1.0).alias(name)).write_parquet(path)
    drop(page, path)
    page.wait_for_selector(".head .name")
    page.click("details.card summary")
    page.wait_for_selector("text=Kept but not used")
    assert name in page.inner_text("main")
    assert page.locator("main img, main script, main b:text('bold')").count() == 0
    assert "Log" in page.title()


def test_a_fit_is_stopped_and_nothing_of_it_is_kept(watched, server, demo_file):
    page = watched.page
    page.goto(server)
    page.wait_for_selector("#steps .step")
    drop(page, demo_file)
    page.wait_for_selector(".head .name:text('dive')")
    settled(page)
    page.goto(f"{server}#try")
    page.wait_for_selector(".gauges .figure")
    page.locator("#on-net_buoyancy").check()
    page.click("#fit")
    page.click("#stop")
    page.wait_for_selector("text=Stopped; nothing of it was kept.")
    state = page.evaluate("fetch('api/state').then(r => r.json())")
    assert state["job"]["state"] == "stopped" and "improvement" not in state["answers"]
    # And the page goes on working.
    page.click("text=Close")
    page.locator("#on-ocean_current").check()
    page.wait_for_selector("#ocean_current-v_north")


def test_keys_alone_lead_through_the_screens(watched, server):
    page = watched.page
    page.goto(server)
    page.wait_for_selector("#steps .step")
    for key, words in (("2", "Where it fails"), ("5", "Result"), ("1", "Log")):
        page.keyboard.press(key)
        title(page, words)
    page.keyboard.press("Tab")
    page.focus("#theme")
    page.keyboard.press("Enter")
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"


@pytest.mark.parametrize("width", [1280, 800])
def test_nothing_is_wider_than_the_window(running, server, width):
    watched = Watched(running, width)
    for screen in ("log", "where", "missing", "try", "result"):
        watched.page.goto(f"{server}#{screen}")
        watched.page.wait_for_selector("main .screen > *")
        watched.page.wait_for_timeout(200)
        assert watched.page.evaluate("document.documentElement.scrollWidth") <= width, screen
    watched.close()


def test_another_page_is_refused(running, server, tmp_path):
    """A page from elsewhere in the same browser gets nothing, with the token or without."""
    for headers in (
        {"Origin": "http://evil.example"},
        {"Host": "evil.example"},
        {"Sec-Fetch-Site": "cross-site"},
    ):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(urllib.request.Request(f"{server}api/state", headers=headers))
        assert refused.value.code == 403
    with served(tmp_path) as (other, _):
        watched = Watched(running)
        watched.page.goto(other)
        told = watched.page.evaluate(
            "url => fetch(url, {method: 'POST', body: '{}', mode: 'no-cors'}).then(r => r.type, e => String(e))",
            f"{server}api/stop",
        )
        assert "TypeError" in told, "its own policy forbids it to ask"
        watched.page.goto("about:blank")
        answer = watched.page.evaluate(
            "url => fetch(url).then(r => r.status, e => String(e))", f"{server}api/state"
        )
        assert "TypeError" in str(answer)
        watched.close()


@pytest.mark.long
def test_the_first_view_of_a_million_samples(running, tmp_path):
    log = make_log(1, n=1_000_000)
    log.write(tmp_path / "long.parquet")
    with served(tmp_path, "model=rov95", f"log={tmp_path / 'long.parquet'}") as (address, _):
        watched = Watched(running)
        watched.page.goto("about:blank")
        began = time.monotonic()
        watched.page.goto(address)
        drawn(watched.page, 2)
        seen = time.monotonic() - began
        watched.close()
    print(f"first view of a million samples: {seen:.2f} s")
    assert seen < 1.0


@pytest.mark.long
def test_a_slider_moves_and_the_free_run_follows(running, tmp_path):
    from auvnn.models import load
    from auvnn.simulation import simulate

    hidden = {"ocean_current": {"v_north": 0.15, "v_east": -0.1}}
    # The last 30 % are held out: ten minutes at 20 Hz are left.
    simulate(load("rov95"), "multisine", "realistic", hidden, 0, runs=1, duration=860.0).log.write(
        tmp_path / "long.parquet"
    )
    with served(tmp_path, "model=rov95", f"log={tmp_path / 'long.parquet'}") as (address, _):
        watched = Watched(running)
        page = watched.page
        page.goto(address)
        page.wait_for_selector(".step.done")
        page.goto(f"{address}#try")
        page.wait_for_selector(".gauges .figure")
        page.locator("#on-ocean_current").check()
        slider = page.locator("#ocean_current-v_north")
        page.wait_for_timeout(1500)
        times = slider.evaluate("""async (slider) => {
          const times = [];
          for (let k = 0; k < 50; k++) {
            const began = performance.now();
            const after = (done) => () => requestAnimationFrame(() => done());
            const drawn = new Promise((done) => document.addEventListener("redrawn", after(done), { once: true }));
            slider.value = 0.005 * k;
            slider.dispatchEvent(new Event("input", { bubbles: true }));
            await drawn;
            times.push(performance.now() - began);
          }
          return times;
        }""")
        watched.close()
    median = float(np.median(times))
    print(f"slider to redraw, median of 50: {median:.0f} ms")
    assert median < 100.0
