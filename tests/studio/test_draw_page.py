"""The panel Draw in a real browser: drawing, undo, sliders, keyboard, play, save and accessibility."""

import os
import tomllib

import pytest
from axe_playwright_python.sync_playwright import Axe

from midair.cli import run

pytestmark = pytest.mark.browser

SEEN = "!studio.room.busy && studio.room.seen === JSON.stringify(studio.room.pattern)"


def test_a_pattern_is_drawn_changed_played_and_saved(studio_at, look, tmp_path):
    studio = studio_at()
    page = look(studio)
    click, press, value = (lambda name: page.page.locator(name).click()), page.page.keyboard.press, page.page.evaluate
    said = "document.querySelector('#draw-said').innerText"
    page.go("#draw")
    page.until(f"studio.name === 'draw' && {SEEN}", timeout=120)
    assert "limit 110 dB" in page.page.locator("#draw-exposure").inner_text()
    assert "above the detection threshold" in page.page.locator("#draw-felt").inner_text()
    box = page.page.locator(".palm-picture svg").bounding_box()
    for x, y in ((-30, -30), (30, -30), (0, 30), (-30, -29)):  # a triangle, in mm
        page.page.mouse.move(box["x"] + (x / 104 + 0.5) * box["width"], box["y"] + (0.5 - y / 104) * box["height"])
        if x == y == -30:
            page.page.mouse.down()
    page.page.mouse.up()
    drawn = value("studio.room.one.shape")
    assert (drawn["name"], len(drawn["corners_mm"])) == ("polygon", 3)
    page.page.locator("#main").focus()
    for key, name in (("Control+z", "circle"), ("Control+Shift+z", "polygon")):
        press(key)
        assert value("studio.room.one.shape.name") == name
    centre = value("studio.room.one.centre_mm")
    page.page.locator('[data-handle="0"]').focus()
    for key in ("ArrowRight", "Shift+ArrowUp", "ArrowRight"):
        press(key)
    assert value("document.activeElement.dataset.handle") == "0", "the handle keeps the focus"
    assert value("studio.room.one.centre_mm") == [centre[0] + 2, centre[1] + 5]
    click("#draw-undo")
    assert value("studio.room.one.centre_mm") == centre
    page.page.get_by_role("button", name="texture on a spot").click()
    page.page.locator("#draw-slider-grain").focus()
    press("End")
    click("#draw-pressure_pa-slider")
    assert value("[studio.room.pattern.parameters.grain.default, studio.room.one.pressure_pa]") == [250, "$pressure"]
    click("#draw-copy")
    page.page.locator("#draw-shape").select_option("line")
    assert value("studio.room.pattern.spot.map((spot) => spot.shape.name)") == ["points", "line"]
    click("#draw-delete")
    page.until(f"{SEEN} && !document.querySelector('#draw-play').disabled", timeout=120)
    click("#draw-play")
    page.until(f"/^SIMULATED: played 4000 frames/.test({said.replace('said', 'played')})", timeout=120)
    page.page.locator("#draw-name").fill("grainy")
    click("#draw-save-drive")
    page.until(f"{said} === 'saved grainy.toml and grainy.drive.h5'", timeout=60)
    saved = tomllib.loads((studio.folder / "grainy.toml").read_text(encoding="utf-8"))
    assert run(["draw", str(studio.folder / "grainy.toml"), str(tmp_path / "again.drive.h5")]) == 0
    click("#draw-save")
    page.page.get_by_role("button", name="Cancel").click()
    page.until(f"{said} === 'not saved'")
    page.page.get_by_role("button", name="pulse").click()
    page.page.locator("#draw-open").select_option("grainy.toml")
    page.until("studio.room.pattern.name === 'grainy'")
    assert value("studio.room.pattern") == saved
    assert page.wrong == []


def test_key_frames_are_moved_and_a_loop_plays_each_change(studio_at, look):
    page = look(studio_at())
    click, press, value = (lambda name: page.page.locator(name).click()), page.page.keyboard.press, page.page.evaluate
    keys = "studio.room.one.key.map((key) => [key.at_s, ...key.centre_mm, key.part ?? 1])"
    page.go("#draw")
    page.until("studio.name === 'draw'")
    page.page.get_by_role("button", name="texture on a spot").click()
    click("#draw-key-add")
    click("#draw-key-add")
    assert value(keys) == [[0, 0, 0, 1], [0.5, 0, 0, 1], [1, 0, 0, 1]]
    page.page.locator('[data-key="1"]').focus()
    for key in ("Shift+ArrowRight", "ArrowLeft", "ArrowDown"):
        press(key)
    page.page.locator('[data-handle="0.k2"]').focus()
    press("Shift+ArrowUp")
    assert value(keys) == [[0, 0, 0, 1], [0.59, 0, 0, 0.95], [1, 0, 5, 1]]
    box = page.page.locator(".times").bounding_box()

    def at(time, part):
        x, y = (26 + 364 * time) / 400, (62 - 50 * part) / 84
        return box["x"] + x * box["width"], box["y"] + y * box["height"]

    page.page.mouse.move(*at(0.59, 0.95))
    page.page.mouse.down()
    page.page.mouse.move(*at(0.3, 0.5), steps=3)
    page.page.mouse.up()
    assert value(keys)[1] == [0.3, 0, 0, 0.5]
    page.page.locator("#draw-key-ease").select_option("step")
    page.page.mouse.dblclick(*at(0.65, 0.1))
    assert value(keys)[2] == [0.65, 0, 0, 0.5], "a jump holds until the next key"
    press("Control+z")
    press("Control+z")
    press("Control+z")
    assert value(keys)[1] == [0.59, 0, 0, 0.95]
    page.page.locator('[data-key="1"]').focus()
    press("Delete")
    assert value(keys) == [[0, 0, 0, 1], [1, 0, 5, 1]]
    page.page.locator("#draw-shape").select_option("svg")
    page.page.locator("#draw-svg").fill("M0 0H9V9")
    page.until(f"{SEEN} && !document.querySelector('#draw-play').disabled", timeout=120)
    page.page.locator("#draw-loop").check()
    click("#draw-play")
    page.until("studio.room.looping && studio.link.state.player.emitting", timeout=180)
    page.page.locator("#draw-slider-grain").focus()
    press("End")
    said = "document.querySelector('#draw-played').innerText"
    page.until(f"{said} === 'playing in a loop, with this change'", timeout=180)
    press("Escape")
    page.until(f"!studio.room.looping && {said} === 'stopped'")
    assert page.wrong == []


def test_the_panel_fits_and_is_accessible(studio_at, look, tmp_path):
    page = look(studio_at())
    page.go("#draw")
    page.until("studio.name === 'draw'")
    page.page.get_by_role("button", name="line stroke").click()
    page.page.locator("#draw-key-add").click()
    page.until(SEEN, timeout=120)
    for scheme, width in (("dark", 1280), ("light", 1280), ("dark", 390), ("light", 390)):
        page.page.emulate_media(color_scheme=scheme)
        page.page.set_viewport_size({"width": width, "height": 800})
        page.page.locator("main").evaluate("(main) => main.scrollTo(0, 0)")
        page.page.screenshot(path=f"{os.environ.get('MIDAIR_PICTURES', tmp_path)}/draw-{scheme}-{width}.png")
        assert page.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert (
            page.page.evaluate("""[...document.querySelectorAll('.draw .field :is(input, select)')].filter((one) =>
            !document.getElementById(one.getAttribute('aria-describedby'))?.innerText).map((one) => one.id)""")
            == []
        )
        assert Axe().run(page.page).response["violations"] == []
    assert page.wrong == []
