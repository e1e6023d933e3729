import time

import pytest

from midair.rig import record

pytestmark = pytest.mark.browser


def state_air(page, temperature):
    page.page.locator("#state-air").click()
    page.page.get_by_label("Temperature").fill(temperature)
    page.page.get_by_role("button", name="Use this air").click()


def test_a_drive_of_other_air_is_marked_and_corrected_or_solved_again(studio_at, look):
    page = look(studio_at())
    assert page.page.locator("#state-air").inner_text() == "air not stated"
    page.towel()
    assert page.page.locator("#other-air").is_hidden()
    state_air(page, "lsl:Room")
    page.until("document.querySelector('#air .bad').textContent.includes('expected degrees Celsius')")
    page.page.locator("#air").get_by_role("button", name="Close").click()
    state_air(page, "22C")
    page.until("document.querySelector('#state-air').textContent === 'air 22.0 °C'")
    # The sample is solved for the paper's 340 m/s.
    page.until("document.querySelector('#other-air').textContent.includes('the drive was solved for 13.6 °C')")
    page.page.locator("#other-air").get_by_role("button", name="Correct phases").click()
    page.until("!document.querySelector('#hold').disabled")
    dialog = page.page.locator("#exposure")
    assert "corrected for the air of the room" in dialog.inner_text()
    assert "20 to 24 °C" in dialog.inner_text()
    assert "palm warms by" in dialog.inner_text()
    dialog.get_by_role("button", name="Close").click()
    page.page.locator("#other-air").get_by_role("button", name="Solve again").click()
    page.page.get_by_role("button", name="Replace").click()
    page.until("Math.abs(studio.room.take?.facts.drive?.air_c - 22) < 1e-6", timeout=180)
    page.until("document.querySelector('#other-air').hidden")
    assert "temperature 22C" in page.page.locator("#in-view").inner_text()


def test_a_take_without_a_drive_plays_while_it_is_solved_and_a_loop_takes_the_newest_drive(studio_at, look):
    studio = studio_at()
    for name in ("new", "other"):
        record("virtual:towel", 0.2, path=studio.folder / f"{name}.h5")
    page = look(studio)
    page.take("new.h5")
    page.page.get_by_label("Mode").select_option("paper")
    page.page.get_by_label("Solver").select_option("live")
    page.page.get_by_role("button", name="Play on array").click()
    page.until("!document.querySelector('#hold').disabled", timeout=120)
    assert "each part is checked before it sounds" in page.page.locator("#exposure").inner_text()
    page.hold_to_play()
    page.until("document.querySelector('#exposure').textContent.includes('new.rerecorded.h5')", timeout=120)
    page.until("studio.link.state.takes.some((row) => row.name === 'new.h5' && row.solved)", timeout=60)
    page.page.locator("#exposure").get_by_role("button", name="Close").click()

    page.take("other.h5")

    def solve(gain):
        page.page.get_by_label("Mode").select_option("quick")
        page.page.get_by_label("Gain").fill(gain)
        page.page.get_by_label("Gain").press("Tab")
        page.page.get_by_role("button", name="Solve", exact=True).click()

    solve("1")
    page.until("!document.querySelector('#replace').open && studio.room.take?.facts?.drive", timeout=120)
    page.page.get_by_role("button", name="Play on array").click()
    page.page.get_by_label("Loop until STOP").check()
    page.until("!document.querySelector('#hold').disabled", timeout=120)
    page.hold_to_play()
    page.until("studio.link.state.player.emitting", timeout=60)
    first = page.page.evaluate("studio.link.state.exposure.pressure_pa")
    page.page.locator("#exposure").get_by_role("button", name="Close").click()
    solve("4")
    page.page.locator("#replace").get_by_role("button", name="Replace").click()
    page.until(f"studio.link.state.exposure.pressure_pa > {2 * first}", timeout=120)
    page.until("studio.link.state.player.emitting", timeout=60)
    page.press("Escape")
    page.until("studio.link.state.player.state === 'ready'", timeout=30)
    time.sleep(1.0)
    assert page.page.evaluate("studio.link.state.player.state") == "ready", "a STOP ends the loop"


def test_hot_units_are_shown_at_once_and_the_play_waits_for_the_choice(studio_at, look, tap):
    studio = studio_at("--device", f"autd3:{tap.address}", new=True)
    page = look(studio)
    page.towel()
    page.until("studio.link.state.player.state === 'ready'", timeout=120)
    page.page.get_by_role("button", name="Play on array").click()
    page.page.get_by_label("Times").fill("10")
    page.press("Tab")
    page.until("!document.querySelector('#hold').disabled || !!document.querySelector('#exposure .bad')")
    if page.page.locator("#hold").is_disabled():
        page.page.get_by_role("button", name="Attenuate").click()
    page.hold_to_play()
    page.until("studio.link.state.player.emitting")
    tap.hot, began = range(65536), time.monotonic()
    page.until("!document.querySelector('#hot-play').hidden")
    assert time.monotonic() - began < 5
    assert not page.page.evaluate("studio.link.state.player.emitting")
    assert "too hot" in page.page.locator("#hot-play").inner_text()
    assert "It stays silent until you choose." in page.page.locator("#hot-play").inner_text()
    tap.hot = ()
    time.sleep(2.0)
    assert not page.page.evaluate("studio.link.state.player.emitting"), "cool for two seconds, and it still waits"
    page.page.locator("#hot-play").get_by_role("button", name="Wait until they have cooled").click()
    page.until("document.querySelector('#hot-play').hidden")
    page.until("studio.link.state.player.emitting")
    tap.hot = range(65536)
    page.until("!document.querySelector('#hot-play').hidden")
    page.page.locator("#hot-play").get_by_role("button", name="Stop").click()
    page.until("studio.link.state.player.said.includes('stopped on request')")
    assert page.page.locator("#hot-play").is_hidden()
