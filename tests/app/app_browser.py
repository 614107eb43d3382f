"""A real browser at the page: Debian's chromium driven by playwright, and the server that it talks to."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

CHROMIUM = Path(os.environ.get("AUVNN_CHROMIUM", "/usr/bin/chromium"))
ARGUMENTS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
    # Nothing but this machine has an address: a page that asked another host could not load.
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
]  # fmt: skip
OWN = ("http://127.0.0.1:", "data:", "blob:", "about:", "chrome:")


def why_not() -> str:
    """Return why no browser test can run, empty where they can."""
    try:
        import playwright.sync_api  # noqa: F401
    except ModuleNotFoundError:
        return "playwright is not installed: pip install playwright"
    try:
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
    except ModuleNotFoundError:
        return "the page's server is not installed: pip install 'auvnn[app]'"
    return (
        ""
        if CHROMIUM.exists()
        else f"no chromium at {CHROMIUM}: apt-get install chromium, or set AUVNN_CHROMIUM"
    )


def axe() -> Path | None:
    """Return axe-core's file, from AUVNN_AXE or an npm install in the current folder; None where it is not there."""
    places = [os.environ.get("AUVNN_AXE", ""), "node_modules/axe-core/axe.min.js"]
    return next((Path(p) for p in places if p and Path(p).is_file()), None)


@contextlib.contextmanager
def served(folder: Path, *words: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Run `auvnn app` in a folder and give its address; it is interrupted at the end, as a user does."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "AUVNN_ENGINE": "auto"}
    process = subprocess.Popen(
        [sys.executable, "-m", "auvnn", "app", "browser=false", *words],
        cwd=folder, env=environment, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        for line in process.stdout:
            found = re.match(r"page\s+(http://\S+)", line)
            if found:
                break
        else:
            raise AssertionError(f"auvnn app ended with {process.wait()} before it said its address")
        yield found[1], process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise


@contextlib.contextmanager
def browser() -> Iterator[Any]:
    """Give a browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        running = play.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        try:
            yield running
        finally:
            running.close()


class Watched:
    """A page, and what it asked for and complained of.

    Args:
        running: the browser.
        width: of the window, pixels.
        height: of the window.
        theme: "light" or "dark".
    """

    def __init__(self, running: Any, width: int = 1280, height: int = 900, theme: str = "light") -> None:
        self.context = running.new_context(viewport={"width": width, "height": height}, color_scheme=theme)
        self.page = self.context.new_page()
        self.page.set_default_timeout(60_000)
        self.asked: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on(
            "console", lambda said: self.complaints.append(said.text) if said.type == "error" else None
        )

    @property
    def strangers(self) -> list[str]:
        """What was asked of anybody but this machine."""
        return [url for url in self.asked if not url.startswith(OWN)]

    def close(self) -> None:
        """Close the page."""
        self.context.close()


def title(page: Any, words: str, seconds: float = 120) -> None:
    """Wait until a screen is in view."""
    page.wait_for_function(
        "w => document.querySelector('main h1')?.textContent === w", arg=words, timeout=1000 * seconds
    )


def drawn(page: Any, count: int = 1, seconds: float = 60) -> None:
    """Wait until so many plots have ink."""
    page.wait_for_function(
        "n => [...document.querySelectorAll('.uplot canvas')].filter(c => c.width > 0).length >= n",
        arg=count, timeout=1000 * seconds,
    )  # fmt: skip


def settled(page: Any, seconds: float = 60) -> None:
    """Wait until nothing is being read, checked or worked out."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        state = page.evaluate("fetch('api/state').then(r => r.json())")
        busy = state["reading"] or (state["job"] and state["job"]["state"] == "running")
        if not busy and (not state["log"] or state["log"]["judged"] or not state["log"]["ready"]):
            return
        page.wait_for_timeout(150)
    raise AssertionError("the page did not come to rest")


def barriers(page, where: str) -> list[str]:
    """Return what axe finds serious on the screen in view; nothing where axe is not at hand."""
    script = axe()
    if script is None:
        return []
    page.evaluate(script.read_text(encoding="utf-8"))
    found = page.evaluate(
        "axe.run().then(r => r.violations.map(v => [v.impact, v.id, v.nodes.map(n => n.html).slice(0, 3)]))"
    )
    return [f"{where}: {v}" for v in found if v[0] in ("serious", "critical")]
