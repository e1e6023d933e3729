"""The studio in a browser from end to end: look at a solved touch, play it on the virtual array, compare."""

import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.browser


@pytest.fixture
def page(chromium, tmp_path):
    """A page of a studio in an empty folder."""
    command = [sys.executable, "-m", "midair", "studio", str(tmp_path), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as studio:
        try:
            page = chromium.new_page(viewport={"width": 1280, "height": 800})
            page.goto(f"{studio.stdout.readline().strip()}#reproduce")
            page.wait_for_url(lambda url: "/enter" not in url)
            page.goto(f"{page.url}#reproduce")
            yield page
            page.close()
        finally:
            studio.terminate()
            studio.wait(30)


def until(page, script, limit=120.0):
    end = time.monotonic() + limit
    while not (found := page.evaluate(script)):
        assert time.monotonic() < end, script
        time.sleep(0.1)
    return found


@pytest.mark.timeout(600)
def test_studio(page):
    until(page, "!!globalThis.studio?.room?.played && studio.room.take.played.last > 0")
    page.evaluate("studio.room.transport.pause()")
    page.get_by_role("button", name="Play on array").click()
    until(page, "!document.querySelector('#hold').disabled")
    page.locator("#hold").click(delay=900)  # held, since it starts the sound
    until(page, "!!document.querySelector('#to-compare')")
    page.locator("#to-compare").click()
    assert 0.8 < float(dict(until(page, "studio.room.found")["figures"])["correlation"]) <= 1
    assert page.locator("#simulated").is_visible()
