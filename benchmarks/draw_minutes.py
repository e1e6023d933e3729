"""A designer's first minutes: from an empty studio to a pattern, a recorded texture on a spot, and a study of both.

``python -m benchmarks.draw_minutes FOLDER`` goes the way in Chromium, in real time but without pauses to think, keeps
a picture of each step, and prints clicks and minutes. A browser test takes the same way.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

SEEN = "!studio.room.busy && studio.room.seen === JSON.stringify(studio.room.pattern)"
"""The preview in view is that of the pattern."""

HALF = 52
"""Half the side of the picture of the palm in mm."""


def walk(page: Any, seen: Callable[[str], None], until: Callable[[str], Any]) -> int:
    """Take the way on a page that has just opened an empty studio; returns the number of clicks, entries and drags.

    `seen` is called with the name of what is to be seen, `until` waits until a script is true.
    """
    acts = "for (const name of ['click', 'change', 'pointerup']) addEventListener(name, (one) => { studio.acts += "
    acts += "name !== 'pointerup' || one.target.closest?.('svg') ? 1 : 0; }, true);"
    page.evaluate(f"() => {{ studio.acts = 0; {acts} }}")
    button = lambda name: page.get_by_role("button", name=name, exact=True)  # noqa: E731
    said = lambda words: until(f"document.querySelector('#draw-said').innerText === {words!r}")  # noqa: E731

    def drag(selector: str, *way: tuple[float, float]) -> None:
        """Move the pointer over the picture of the palm, in mm, or of the time line, in its own units."""
        page.locator(selector).scroll_into_view_if_needed()
        box, times = page.locator(selector).bounding_box(), "times" in selector
        for number, (x, y) in enumerate(way):
            across, up = (x / 400, y / 84) if times else (x / 2 / HALF + 0.5, 0.5 - y / 2 / HALF)
            page.mouse.move(box["x"] + across * box["width"], box["y"] + up * box["height"], steps=4)
            if number == 0:
                page.mouse.down()
        page.mouse.up()

    page.get_by_role("link", name="Draw").click()
    until(f"studio.name === 'draw' && {SEEN}")
    seen("1-draw")
    # A curl, drawn by hand, that wanders to the right and fades.
    drag(".palm-picture svg", (-25, -8), (-15, 5), (-5, -8), (-16, -14), (-24, -9))
    button("Add a key").click()
    page.locator('[data-handle="0.k1"]').focus()
    for _ in range(6):
        page.keyboard.press("Shift+ArrowRight")
    drag(".times", (390, 12), (390, 47))
    until(SEEN)
    seen("2-key-frames")
    page.locator("#draw-name").fill("curl")
    button("Save").click()
    said("saved curl.toml")
    seen("3-saved")

    # A recorded texture on a spot that moves up the palm.
    button("texture on a spot").click()
    until("[...document.querySelector('#draw-signal').options].some((one) => one.value === 'sample:towel')")
    page.locator("#draw-signal").select_option("sample:towel")
    until("!!studio.room.one.signal")
    page.locator("#draw-am").uncheck()
    button("Add a key").click()
    page.locator('[data-handle="0.k1"]').focus()
    for _ in range(5):
        page.keyboard.press("Shift+ArrowUp")
    until(f"{SEEN} && !document.querySelector('#draw-play').disabled")
    seen("4-texture")
    page.locator("#draw-loop").check()
    page.locator("#draw-play").click()
    until("studio.room.looping && studio.link.state.player.emitting")
    page.locator("#draw-pressure_pa").fill("80")
    page.keyboard.press("Tab")
    until("document.querySelector('#draw-played').innerText === 'playing in a loop, with this change'")
    seen("5-loop")
    page.keyboard.press("Escape")
    until("!studio.room.looping")
    page.locator("#draw-name").fill("cloth")
    button("Save").click()
    said("saved cloth.toml")

    page.get_by_role("link", name="Study").click()
    until("document.querySelectorAll('#own-study option[value$=\".toml\"]').length === 2")
    page.get_by_label("Name", exact=True).fill("touches")
    page.get_by_label("Participants").fill("5")
    page.get_by_label("takes and patterns to present").select_option(["curl.toml", "cloth.toml"])
    page.get_by_label("Question", exact=True).fill("Which touch was it?")
    page.get_by_label("Second question (may stay empty)").fill("How pleasant was it?")
    seen("6-study")
    page.locator("#new-study").click()
    until("document.querySelector('#simulate')?.disabled === false")
    page.locator("#simulate").click()
    until("document.querySelector('#analyse')?.disabled === false")
    page.locator("#analyse").click()
    until("document.querySelector('#to-report')")
    seen("7-analysed")
    return int(page.evaluate("studio.acts"))


def main() -> None:
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(prog="python -m benchmarks.draw_minutes", description=__doc__.splitlines()[0])
    parser.add_argument("pictures", type=Path, help="folder for the pictures")
    parser.add_argument("--width", type=int, default=1280, help="width of the page in pixels")
    parser.add_argument("--scheme", choices=("light", "dark"), default="light", help="colours of the page")
    given = parser.parse_args()
    given.pictures.mkdir(parents=True, exist_ok=True)
    wrong: list[str] = []
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as state, sync_playwright() as driver:
        studio = subprocess.Popen(
            [sys.executable, "-m", "midair", "studio", folder, "--no-browser"],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "MIDAIR_STATE": state},
        )
        try:
            browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            context = browser.new_context(
                viewport={"width": given.width, "height": 800}, color_scheme=given.scheme, reduced_motion="reduce"
            )
            page = context.new_page()
            page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
            page.on("pageerror", lambda said: wrong.append(str(said)))
            page.goto((studio.stdout.readline() if studio.stdout else "").strip())

            def until(script: str, patience: float = 600.0) -> Any:
                end = time.monotonic() + patience
                while time.monotonic() < end:
                    try:
                        if found := page.evaluate(script):
                            return found
                    except Exception as failed:
                        if "destroyed" not in str(failed) and "not defined" not in str(failed):
                            raise
                    time.sleep(0.05)
                page.screenshot(path=given.pictures / "failed.png")
                raise TimeoutError(script)

            until("globalThis.studio?.link?.page > 0")
            began = time.monotonic()
            acts = walk(page, lambda name: page.screenshot(path=given.pictures / f"{name}.png"), until)
            print(f"{acts} clicks, entries and drags, {(time.monotonic() - began) / 60:.1f} minutes")
            with context.expect_page() as report:
                page.locator("#to-report").click()
            report.value.wait_for_load_state()
            report.value.screenshot(path=given.pictures / "8-report.png", full_page=True)
            browser.close()
        finally:
            studio.terminate()
            studio.wait(15)
    if wrong:
        raise SystemExit("\n".join(wrong))


if __name__ == "__main__":
    main()
