"""A newcomer's first five minutes as pictures: open, look, record, solve, play, compare, report, all of it virtual.

``python docs/studio_first_minutes.py FOLDER`` writes them there, and fails if a console complains or a request leaves
this computer. A browser test takes the same way.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

PATIENCE = 300.0
"""Seconds for one step, on a machine that is busy."""


def walk(page: Any, seen: Callable[[str], None], until: Callable[..., Any]) -> dict[str, Any]:
    """Take the way, calling `seen` with a name wherever there is something to look at; what the comparison found.

    Parameters
    ----------
    page : playwright.sync_api.Page
        Which has just opened the studio's link.
    seen : callable
        Called with the name of what is to be seen now.
    until : callable
        Given a script, waits until it is true and gives what it is.
    """
    until("(globalThis.studio?.drawn ?? 0) > 0")
    seen("1-open")
    until("!!studio.room.played && studio.room.take.played.last > 0")
    until(f"studio.drawn > {until('studio.drawn')} + 10")
    page.locator("#main").focus()
    page.keyboard.press("2")
    page.evaluate("studio.room.transport.pause(); studio.room.transport.seek(742)")
    until("studio.room.transport.frame === 742")
    seen("2-look")
    page.evaluate("location.hash = '#record'")
    until("studio.link.state.record?.state === 'listening' && studio.room.newest > 1200")
    page.get_by_label("Object").fill("towel")
    page.get_by_label("Surface").fill("flat")
    page.keyboard.press("Tab")
    page.locator("#record").click()
    until("studio.link.state.record.state === 'recording' && studio.link.state.levels?.frames > 300")
    seen("3-record")
    until("studio.link.state.record.take?.name === 'towel-flat-01.h5'")
    seen("4-recorded")
    page.locator("#to-reproduce").click()
    until("studio.room.take?.name === 'towel-flat-01.h5'")
    page.get_by_role("button", name="Solve").click()
    until("!!document.querySelector('.job progress')")
    seen("5-solve")
    until("!!studio.room.played && studio.room.take.name === 'towel-flat-01.h5' && studio.room.take.played.last > 0")
    page.evaluate("studio.room.transport.pause(); studio.room.transport.seek(742)")
    seen("6-solved")
    page.get_by_role("button", name="Play on array").click()
    until("!document.querySelector('#hold').disabled")
    seen("7-play")
    # The button has to be held for .6 s.
    page.locator("#hold").click(delay=900)
    until("!!document.querySelector('#to-compare')")
    seen("8-played")
    page.locator("#to-compare").click()
    found = until("studio.room.found")
    until("studio.room.pictures?.length > 0 && document.querySelectorAll('.job').length === 0")
    seen("9-compare")
    page.get_by_role("button", name="Make the report").click()
    until("!document.querySelector('#to-report').hidden")
    seen("10-reported")
    return dict(found)


def main() -> None:
    """Take the pictures."""
    from playwright.sync_api import sync_playwright

    into = Path(sys.argv[1] if len(sys.argv) > 1 else "first-minutes")
    into.mkdir(parents=True, exist_ok=True)
    wrong: list[str] = []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        words = [sys.executable, "-m", "midair", "studio", folder, "--no-browser"]
        studio = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        try:
            browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
            page.on("pageerror", lambda said: wrong.append(str(said)))
            page.on("request", lambda asked: None if "//127.0.0.1:" in asked.url else wrong.append(asked.url))
            page.goto((studio.stdout.readline() if studio.stdout else "").strip(), wait_until="commit")

            def until(script: str) -> Any:
                end = time.monotonic() + PATIENCE
                while time.monotonic() < end:
                    try:
                        if found := page.evaluate(script):
                            return found
                    except Exception as failed:
                        if "destroyed" not in str(failed) and "not defined" not in str(failed):
                            raise
                    time.sleep(0.05)
                raise TimeoutError(script)

            walk(page, lambda name: page.screenshot(path=into / f"{name}.png"), until)
            with page.context.expect_page() as report:
                page.locator("#to-report").click()
            report.value.wait_for_load_state()
            report.value.screenshot(path=into / "11-report.png")
            browser.close()
        finally:
            studio.terminate()
            studio.wait(15)
    if wrong:
        raise SystemExit("\n".join(wrong))


if __name__ == "__main__":
    main()
