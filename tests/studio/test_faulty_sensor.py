"""Clipping, lost frames, a dead channel, an unplugged sensor: on the page and in the file."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from midair.files import open_take

pytestmark = pytest.mark.browser

HERE = Path(__file__).parent


@pytest.fixture
def sender(monkeypatch):
    pytest.importorskip("pylsl")
    monkeypatch.setenv("LSLAPICFG", str(HERE.parent / "devices" / "sensors" / "lsl_api.cfg"))
    made, name = [], f"faulty {time.monotonic_ns()}"

    def start():
        words = [sys.executable, str(HERE / "faulty_sender.py"), name]
        made.append(subprocess.Popen(words, stdout=subprocess.PIPE, text=True))
        assert made[-1].stdout.readline().strip() == "ready"
        return name, made[-1]

    yield start
    for each in made:
        each.kill()
        each.wait()
        each.stdout.close()


def test_sensor_faults_are_shown_and_stored_in_the_file(sender, studio_at, look):
    name, running = sender()
    studio = studio_at("--sensor", f"lsl:{name}?counter=16&full_scale=1&timeout=1", new=True)
    page = look(studio)
    page.go("#record")
    page.until("studio.link.state.record?.state === 'listening'", timeout=90)
    page.page.get_by_label("Object").fill("towel")
    page.page.get_by_label("Surface").fill("")
    page.page.get_by_label("Duration, s").fill("")
    page.page.locator("#record").click()
    page.until("studio.link.state.record.state === 'recording'")
    events = "[...document.querySelectorAll('.record .events li')].map(each => each.textContent).join('; ')"
    for words in ("channel 5 (row 1, column 1) clips: reduce its gain", "channel 2 (row 0, column 2) is dead"):
        page.until(f"{events}.includes({words!r})")
    page.until(f"{events}.includes('10 frames (10 ms) were lost')")
    meters = "[...document.querySelectorAll('.meter')].map(each => each.textContent)"
    page.until(f"{meters}[2] === '2: dead' && {meters}[5] === '5: clipped'")
    assert "1 cells dead or stuck, 1 clipped" in page.page.locator(".meters").get_attribute("aria-label")

    running.kill()
    page.until("studio.link.state.record.state === 'lost'", timeout=30)
    page.until("document.querySelector('#kept')?.innerText.includes('towel-01.h5')")
    said = page.page.locator("#kept").inner_text()
    assert "recorded until then are kept" in said
    assert "clipped channels" in said
    assert "dead channels" in said
    assert "lost the sender" in page.page.locator("#sensor-lost").inner_text()
    assert page.page.locator("#record").is_disabled()
    assert page.page.locator("#state-sensor").inner_text().endswith("lost")

    take = open_take(studio.folder / "towel-01.h5")
    kept = page.page.evaluate("studio.link.state.record.take")
    assert take.recording.frames == kept["frames"] > 100
    kinds = {(event.kind, event.channel) for event in take.journal}
    assert ("clipped", 5) in kinds
    assert ("dead", 2) in kinds
    lost = [event for event in take.journal if event.kind == "lost"]
    assert lost
    assert {event.frames for event in lost} == {10}
    assert {event.channel for event in take.journal if event.kind == "clipped"} == {5}

    sender()
    page.page.get_by_role("button", name="Open the sensor again").click()
    page.until("studio.link.state.record.state === 'listening'", timeout=60)
    assert page.page.locator("#sensor-lost").is_hidden()
