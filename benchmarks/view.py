"""Drawing speed of a page, and cost of a film: `python -m benchmarks.view`. Requires Chromium and Playwright.

A towel stroke with its drive is shown as a page. Drawn pictures are counted relative to the browser's ticks in the same
time; milliseconds per picture are those of the script, without the browser's own work on the pixels. `--pictures
FOLDER` saves the pictures for the docs.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import midair
from midair.pipeline import calibrated_pressure
from midair.rig import view_of_loop
from midair.settings import MODES
from midair.view import WEB, Film, ViewData, show_page, size_of, write_gif

TICKS = """async (seconds) => {
  const {transport} = document.querySelector(".midair-view").midair;
  const before = transport.drawn, begin = performance.now();
  let ticks = 0;
  while (performance.now() - begin < 1000 * seconds) { await new Promise(requestAnimationFrame); ticks++; }
  return [transport.drawn - before, ticks];
}"""

EACH = """async () => {
  const {transport, pictures} = document.querySelector(".midair-view").midair, told = {};
  transport.stop();
  for (const picture of pictures) {
    const state = {...transport.state, ...picture.fixed};
    let spent = 0;
    for (let n = 0; n < 40; n++) {
      const begin = performance.now();
      picture.draw({...state, from: 200 + n, frame: 216 + n});
      spent += performance.now() - begin;
      await new Promise(requestAnimationFrame);
    }
    told[picture.label] = spent / 40;
  }
  return told;
}"""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.view", description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=5, help="observation time in s (default 5)")
    parser.add_argument("--pictures", type=Path, help="folder for saved pictures")
    options = parser.parse_args()
    drive, both = towel()
    print(f"web: {sum(path.stat().st_size for path in WEB.iterdir()) / 1e3:.0f} kB")
    watch(both, options.seconds)
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        write_gif(Film(drive), Path(folder) / "film.gif")
        size = (Path(folder) / "film.gif").stat().st_size
    spent = time.process_time() - began
    print(f"GIF: {1e3 * spent / drive.frames:.1f} ms of CPU per picture, {size / drive.frames / 1e3:.1f} kB")
    if options.pictures is not None:
        keep_pictures(drive, both, options.pictures)


def towel() -> tuple[ViewData, ViewData]:
    """View of the drive of a loop with a virtual towel stroke; and the same with original and re-recorded pressure."""
    take = midair.record("virtual:towel", 1.28)
    settings = MODES["best"]().but(rate=1000.0)
    both = view_of_loop(
        midair.loop(calibrated_pressure(take.recording, take.calibration, settings).cut(0.4, 0.5), settings)
    )
    drive = replace(both, samples=None, again=None, sensor=None)
    return drive, both


def watch(shown: ViewData, seconds: float) -> None:
    with browser() as page:
        begun = time.monotonic()
        opened(page, shown)
        print(f"page: {size_of(shown) / 1e6:.1f} MB of frames, first picture after {time.monotonic() - begun:.2f} s")
        drawn, ticks = page.evaluate(TICKS, seconds)
        print(f"drawn: {drawn} of {ticks} ticks in {seconds:g} s, {drawn / ticks:.1%}")
        for label, spent in page.evaluate(EACH).items():
            print(f"  {label:26} {spent:5.2f} ms per picture of 17 frames")


def keep_pictures(drive: ViewData, both: ViewData, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, shown, how in (
        ("show-both", both, {}),
        ("show-dark", drive, {"color_scheme": "dark"}),
    ):
        with browser(reduced_motion="reduce", viewport={"width": 1200, "height": 600}, **how) as page:
            opened(page, shown)
            page.wait_for_timeout(300)
            page.locator(".midair-view").screenshot(path=folder / f"{name}.png")
    Film(drive).picture(both.frames // 2).save(folder / "show-film.png")


def opened(page: Any, shown: ViewData) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "page.html"
        path.write_text(show_page(shown), encoding="utf-8")
        page.goto(path.as_uri())
        page.wait_for_function("document.querySelector('.midair-view').midair?.transport.drawn > 0")


class browser:  # noqa: N801  reads as a function: `with browser() as page`
    """A page of the machine's Chromium."""

    def __init__(self, **how: Any) -> None:
        self._how = how

    def __enter__(self) -> Any:
        from playwright.sync_api import sync_playwright

        self._driver = sync_playwright().start()
        found = shutil.which("chromium") or shutil.which("google-chrome")
        self._browser = self._driver.chromium.launch(executable_path=found, args=["--no-sandbox"])
        return self._browser.new_context(**self._how).new_page()

    def __exit__(self, *_: object) -> None:
        self._browser.close()
        self._driver.stop()


if __name__ == "__main__":
    main()
