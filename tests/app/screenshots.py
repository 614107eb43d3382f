"""Screenshots of the five screens, light and dark, 1280 and 800 pixels: `python -m tests.app.screenshots FOLDER`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.app.app_browser import Watched, browser, drawn, served, settled, title, why_not


def walk(page, shot) -> None:
    """Go through the loop on the example and take a picture of each screen."""
    page.wait_for_selector("#example")
    shot("0_begin")
    page.click("#example")
    page.wait_for_selector("#compare:not([disabled])", timeout=120_000)
    settled(page)
    drawn(page, 5)
    page.wait_for_selector(".step.done")
    shot("1_log")
    page.click("#compare")
    title(page, "Where it fails")
    drawn(page, 2)
    page.click(".cell >> nth=4")
    page.wait_for_timeout(600)
    shot("2_where")
    page.click("#diagnose")
    title(page, "What is missing", 300)
    page.wait_for_selector(".candidate")
    shot("3_missing")
    page.click("#try")
    title(page, "Try it")
    drawn(page, 6)
    page.wait_for_selector(".figures")
    page.locator("#ocean_current-v_north").fill("0.05")
    page.wait_for_timeout(700)
    shot("4_try")
    page.click("#fit")
    page.wait_for_selector("#keep", timeout=300_000)
    page.wait_for_timeout(900)
    shot("4_try_fitted")
    page.click("#keep")
    title(page, "Result")
    drawn(page, 6)
    page.wait_for_timeout(700)
    shot("5_result")


def main(out: Path) -> None:
    """Take all pictures: the loop is walked once, and the other sizes look at where it ended."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, browser() as running, served(Path(folder)) as (address, _):
        first = Watched(running)
        first.page.goto(address)

        def shot(name: str, page=first.page, kind: str = "1280_light") -> None:
            page.evaluate("window.scrollTo(0, 0)")
            page.wait_for_timeout(150)
            page.screenshot(path=out / f"{name}_{kind}.png", full_page=True)

        walk(first.page, shot)
        for width, theme in ((1280, "dark"), (800, "light"), (800, "dark")):
            view = Watched(running, width, 900, theme)
            for name, screen in (
                ("1_log", "log"),
                ("2_where", "where"),
                ("3_missing", "missing"),
                ("4_try", "try"),
                ("5_result", "result"),
            ):
                view.page.goto(f"{address}#{screen}")
                view.page.wait_for_load_state("networkidle")
                view.page.wait_for_timeout(900)
                shot(name, view.page, f"{width}_{theme}")
            view.close()
        print(*first.complaints, *first.strangers, sep="\n")


if __name__ == "__main__":
    reason = why_not()
    if reason:
        sys.exit(reason)
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "outputs/screens"))
