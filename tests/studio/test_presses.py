"""Every button that starts work answers by itself; the server is stopped meanwhile, so that nothing else can answer."""

import os
import signal
import time
from contextlib import contextmanager

import pytest

pytestmark = pytest.mark.browser

PRESS = """async (button) => {
    const began = performance.now(),
        busy = () => button.ariaBusy === 'true' || !!document.querySelector('dialog[open]') ||
            document.querySelector('#draw-played')?.textContent === 'drawing …';
    button.click();
    if (!busy()) return 0;
    await new Promise((drawn) => requestAnimationFrame(() => setTimeout(drawn)));
    return busy() ? performance.now() - began : 0; }"""
"""Milliseconds until a picture with the busy button, a dialog that the press has opened, or its first word is drawn."""

CLOSE = """document.querySelectorAll('dialog[open]').forEach((each) => each.close()),
    document.querySelectorAll('.job button[aria-label^=cancel]').forEach((each) => each.click())"""

BUTTONS = [
    ("reproduce", "Solve"),
    ("reproduce", "Play on array"),
    ("reproduce", "Simulate the palm"),
    ("reproduce", "Duplicate"),
    ("reproduce", "Edit"),
    ("reproduce", "Export"),
    ("compare/sample:orbit", "Error budget"),
    ("draw", "Save"),
    ("draw", "Play on the virtual array"),
    ("study", "Draw the plan"),
    ("calibrate", "Tap each cell in turn"),
    ("gallery", "use tap"),
    ("record", "Record R"),
    ("live", "Check exposure"),
]


@contextmanager
def stopped(studio):
    os.kill(studio.process.pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(studio.process.pid, signal.SIGCONT)


def test_each_press_is_answered_at_once_and_each_job_can_be_cancelled(studio_at, look, tmp_path):
    (tmp_path / "wool.csv").write_text("x,y\n" + "0.1,0.2\n" * 100)
    studio = studio_at()
    page = look(studio)
    page.until("studio.room?.take?.name === 'sample:orbit' && !!studio.room.take.facts.drive", timeout=400)
    page.until("studio.link.state.player.state === 'ready'", timeout=400)
    took = {}
    for address, name in BUTTONS:
        page.go(f"#{address}")
        page.until(f"studio.name === {address.split('/')[0]!r}")
        button = page.page.get_by_role("button", name=name, exact=True).first
        for _ in range(600):
            if button.is_enabled():
                break
            time.sleep(0.1)
        with stopped(studio):
            took[name] = button.evaluate(PRESS)
        # A dialog that asks ends what its button waits for, and so does a job that is cancelled.
        page.until(f"({CLOSE}, !document.querySelector('button[aria-busy], .job'))", timeout=400)
    page.go("#reproduce")
    page.until("studio.room?.add && !studio.room.add.disabled")
    with stopped(studio):
        page.page.locator("input[type=file]").set_input_files(tmp_path / "wool.csv")
        page.until("document.querySelector('#import[open] progress')")
    page.until("document.querySelector('#import .course polygon')", timeout=400)
    page.page.locator("#import").get_by_role("button", name="Cancel", exact=True).click()
    print({name: round(each) for name, each in took.items()}, "ms")
    assert min(took.values()) > 0, took
    # The virtual sensor rests while no page shows it.
    page.until("studio.link.state.record.state === 'closed'")
    page.go("#record")
    page.until("studio.link.state.record.state === 'listening' && studio.room.drawn > 2", timeout=400)
