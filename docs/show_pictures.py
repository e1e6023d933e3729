"""Pictures of docs/show.md, by Chromium: `python docs/show_pictures.py docs/images`."""

import shutil
import sys
import tempfile
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import midair
from midair.pipeline import calibrated_pressure
from midair.rig import view_of_loop
from midair.settings import MODES
from midair.view import Film, show_page


def main():
    folder = Path(sys.argv[1])
    take = midair.record("virtual:towel", 1.28)
    settings = MODES["best"]().but(rate=1000.0)
    pressure = calibrated_pressure(take.recording, take.calibration, settings).cut(0.4, 0.5)
    both = view_of_loop(midair.loop(pressure, settings))
    drive = replace(both, samples=None, again=None, sensor=None)
    for name, shown, how in (("show-both", both, {}), ("show-dark", drive, {"color_scheme": "dark"})):
        with opened(shown, reduced_motion="reduce", viewport={"width": 1200, "height": 600}, **how) as page:
            page.wait_for_timeout(300)
            page.locator(".midair-view").screenshot(path=folder / f"{name}.png")
    Film(drive).picture(both.frames // 2).save(folder / "show-film.png")


@contextmanager
def opened(shown, **how):
    """A page of the machine's Chromium that shows a view."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        path = Path(folder) / "page.html"
        path.write_text(show_page(shown), encoding="utf-8")
        found = shutil.which("chromium") or shutil.which("google-chrome")
        browser = driver.chromium.launch(executable_path=found, args=["--no-sandbox"])
        page = browser.new_context(**how).new_page()
        page.goto(path.as_uri())
        page.wait_for_function("document.querySelector('.midair-view').midair?.transport.drawn > 0")
        yield page
        browser.close()


if __name__ == "__main__":
    main()
