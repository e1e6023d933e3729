import time

import numpy as np
import pytest
from tests.palms import palm_path

from midair.files import load_played, open_take, save_palm_path

pytestmark = pytest.mark.browser

PLAYS = "studio.link.state.live.state === 'plays'"


@pytest.fixture
def feeling(studio_at, look):
    def begin():
        page = look(studio := studio_at())
        page.until("studio.link.state.player?.state === 'ready'", timeout=120)
        page.go("#live")
        page.until("studio.name === 'live' && !document.querySelector('#live-check').disabled")
        page.page.locator("#live-check").click()
        page.hold_to_begin()
        page.until("studio.link.state.live.state === 'plays' && studio.room.drawn > 10", timeout=120)
        return studio, page

    return begin


def in_silence(page):
    page.until("studio.link.state.live.state === 'idle'", timeout=10)
    assert not page.page.evaluate("studio.link.state.player.emitting")
    return page.page.evaluate("studio.link.state.live.said")


def test_every_frame_arrives_and_a_stalled_page_catches_up(feeling):
    _, page = feeling()
    first, drawn, began = *page.page.evaluate("[studio.room.track.last, studio.room.drawn]"), time.monotonic()
    page.page.wait_for_timeout(4000)
    last, lost, more = page.page.evaluate("[studio.room.track.last, studio.room.track.lost, studio.room.drawn]")
    took = time.monotonic() - began
    assert 0.8 * 1000 * took < last - first < 1.2 * 1000 * took + 500
    assert lost == page.page.evaluate("studio.room.sound.lost") == 0
    assert more - drawn > 20
    # The virtual array makes no sound: it goes on while the page does not respond, and no frame is lost.
    page.page.evaluate("() => { const end = performance.now() + 2000; while (performance.now() < end); }")
    assert page.page.evaluate(PLAYS)
    page.press("Escape")
    assert "stopped on request" in in_silence(page)
    felt = page.page.evaluate("studio.link.state.live_goes.frames")
    page.until(f"studio.room.track.last === {felt} && studio.room.sound.last === {felt}")
    assert page.page.evaluate("studio.room.track.lost") == page.page.evaluate("studio.room.sound.lost") == 0


def test_freeze_slow_motion_and_keep(feeling):
    studio, page = feeling()
    press = page.page.keyboard.press
    assert page.page.locator("#simulated").is_visible()
    assert "not for tapping" in page.page.locator("#main").inner_text()
    said = page.page.locator(".parts").get_attribute("aria-label")
    assert said.startswith("From touch to sound 13.0 ms: filter 6.0, work and sending")
    assert page.page.locator(".named").inner_text().startswith("filter 6.0 + work "), "a name for each part"
    page.page.locator("#live-end").wait_for()
    page.page.get_by_label("Loudness").fill("60")
    assert page.page.locator("#loud").inner_text() == "60 %"
    page.until("studio.room.track.last > 1500")
    page.page.locator("#main").focus()
    press("Space")
    page.until("!!studio.room.frozen")
    frames = page.page.evaluate("studio.room.frozen.transport.frames")
    # The frozen picture does not change; live touch goes on.
    before = page.page.evaluate("studio.room.track.last")
    page.until(f"studio.room.track.last > {before} + 300")
    assert page.page.evaluate("studio.room.frozen.transport.frames") == frames
    assert page.page.evaluate("studio.room.traces.track.last") == frames
    press("Home")
    for key, frame in ((".", 1), ("Shift+.", 11), (",", 10), ("End", frames - 1)):
        press(key)
        assert page.page.evaluate("studio.room.frozen.transport.frame") == frame
    overview = page.page.locator("#box-overview canvas")
    box = overview.bounding_box()
    page.page.mouse.click(box["x"] + box["width"] / 4, box["y"] + 8)
    assert page.page.evaluate("studio.room.frozen.transport.frame") == pytest.approx(frames / 4, abs=frames / 100)
    page.page.locator("#main").focus()
    for key, rate in (("2", 100), ("3", 10)):
        press("Home")
        press(key)
        press("Space")
        began = time.monotonic()
        page.page.wait_for_timeout(1500)
        moved, took = page.page.evaluate("studio.room.frozen.transport.frame"), time.monotonic() - began
        press("Space")
        assert 0.4 * rate * took < moved < 1.6 * rate * took, f"{rate} frames a second"
    press("r")
    kept = page.until("studio.link.state.live.take")
    assert kept["frames"] > frames
    path = studio.folder / kept["name"]
    take, played = open_take(path), load_played(path)
    assert take.recording.frames == played.frames == kept["frames"]
    assert played.intensity.max() > 0
    press("Enter")
    page.until("!studio.room.frozen")
    assert page.page.evaluate(PLAYS)
    press("Space")
    # It may hold the page up for longer than what is armed lasts: last of all but leaving.
    assert page.serious() == []
    page.page.locator("#to-reproduce").click()
    page.until(f"studio.room.take?.name === {kept['name']!r} && studio.room.take.samples.last > 1000", timeout=60)
    # Leaving the panel stops live touch.
    in_silence(page)


def test_live_touch_follows_a_palm_and_is_silenced_by_stop_and_a_closed_tab(feeling, look, tmp_path):
    studio, page = feeling()
    page.page.get_by_label("Loudness, per cent").fill("30")
    page.until("studio.link.state.live.share === 0.3")
    began = time.monotonic()
    page.press("Escape")
    assert "stopped on request" in in_silence(page)
    assert time.monotonic() - began < 5

    def again(tracker, latency):
        page.page.get_by_label("Follow the palm of a tracker").fill(tracker)
        page.page.get_by_label("Its latency, ms").fill(latency)
        page.page.locator("#live-check").click()
        drawn = page.page.evaluate("studio.room.drawn")
        page.hold_to_begin()
        page.until(f"studio.link.state.live.state === 'plays' && studio.room.drawn > {drawn} + 10", timeout=60)

    times = np.arange(6000) / 100
    centre = np.stack([5e-3 * np.sin(6 * times), 0 * times, 0.2 + 0 * times], axis=1)
    save_palm_path(palm_path(times, centre), tmp_path / "hand.csv")
    again(f"replay:{tmp_path / 'hand.csv'}", "10")
    page.until("/the palm is followed/.test(document.querySelector('#main').innerText)", timeout=120)
    page.page.locator("#live-end").click()
    assert "ended normally" in in_silence(page)
    again("", "")
    watching = look(studio, context=page.page.context)
    watching.go("#live")
    watching.until("studio.room.track?.last > 100", timeout=30)
    assert watching.page.locator("#live-check").is_disabled()
    page.page.close()
    said = in_silence(watching)
    assert "stopped on request" in said or "did not renew its permission" in said
