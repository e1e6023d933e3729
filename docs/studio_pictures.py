"""The pictures of the studio: the virtual rig, a fixed seed and a fixed frame. ``python docs/studio_pictures.py``."""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from playwright.sync_api import sync_playwright

IMAGES = Path(__file__).parent / "images"


def until(page, script, timeout=300.0):
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        try:
            if page.evaluate(script):
                return
        except Exception as wrong:
            if "destroyed" not in str(wrong) and "not defined" not in str(wrong):
                raise
        time.sleep(0.05)
    raise TimeoutError(script)


def live(page):
    """The room Live, frozen at one frame of what the seed gives; how it went there is the computer's."""
    page.evaluate("location.hash = '#live'")
    until(page, "studio.name === 'live' && !document.querySelector('#live-check').disabled")
    page.locator("#live-check").click()
    until(page, "!document.querySelector('#hold').disabled")
    page.locator("#hold").click(delay=900)
    until(page, "studio.room.track?.last > 5000")
    page.locator("#main").focus()
    page.keyboard.press("Space")
    page.evaluate("studio.room.frozen.transport.set({channel: 6}); studio.room.frozen.transport.seek(3640)")
    page.wait_for_timeout(1500)
    page.screenshot(path=IMAGES / "studio-live.png")


def main():
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        words = [sys.executable, "-m", "midair", "studio", folder, "--no-browser"]
        studio = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        try:
            browser = driver.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
            seen = {"viewport": {"width": 1440, "height": 900}, "color_scheme": "dark", "reduced_motion": "reduce"}
            page = browser.new_context(**seen).new_page()
            page.goto(studio.stdout.readline().strip())
            until(page, "studio.name === 'start'")
            page.evaluate("location.hash = '#reproduce'")
            until(page, "!!studio.room?.played && studio.room.take.played.last === studio.room.take.facts.frames")
            page.evaluate("studio.room.transport.set({speed: 0.1, channel: 6}); studio.room.transport.seek(300)")
            page.evaluate("studio.room.transport.setLoop({from: 200, to: 400, on: true})")
            until(page, "document.querySelectorAll('.job').length === 0")
            page.wait_for_timeout(1500)
            page.screenshot(path=IMAGES / "studio-reproduce.png")
            live(page)
            browser.close()
        finally:
            studio.terminate()
            studio.wait(15)


if __name__ == "__main__":
    main()
