"""The panel Draw in a real browser: drawing, undo, sliders, keyboard, play, save and accessibility."""

import os
import tomllib

import pytest

from midair.patterns import load_pattern

pytestmark = pytest.mark.browser

SEEN = "!studio.room.busy && studio.room.seen === JSON.stringify(studio.room.pattern)"
"""The preview in view is that of the pattern."""

HALF = 52
"""Half the side of the picture of the palm in mm."""


def test_a_pattern_is_drawn_changed_played_and_saved_and_the_panel_is_accessible(studio_at, look, tmp_path):
    studio = studio_at()
    page = look(studio)
    click, press, value = (lambda name: page.page.locator(name).click()), page.page.keyboard.press, page.page.evaluate
    said = "document.querySelector('#draw-said').innerText"
    page.go("#draw")
    page.until(f"studio.name === 'draw' && {SEEN}", timeout=120)
    assert " dB too loud without protection; about " in page.page.locator("#draw-exposure").inner_text()
    assert "of 10 people" in page.page.locator("#draw-felt").inner_text()
    assert "felt by 8 of 10" in page.page.get_by_role("button", name="square").inner_text()
    assert "ears: 23 dB too loud" in page.page.get_by_role("button", name="square").inner_text()
    page.page.get_by_role("button", name="square").click()
    press("Control+z")
    assert value("studio.room.one.shape.name") == "circle"
    click("#draw-redo")
    assert value("studio.room.one.shape.name") == "polygon"
    centre = value("studio.room.one.centre_mm")
    page.page.locator('[data-handle="0"]').focus()
    page.press("ArrowRight", "Shift+ArrowUp", "ArrowRight")
    assert value("document.activeElement.dataset.handle") == "0", "the handle keeps the focus"
    assert value("studio.room.one.centre_mm") == [centre[0] + 2, centre[1] + 5]
    page.page.get_by_role("button", name="texture on a spot").click()
    page.page.locator("#draw-slider-grain").focus()
    press("End")
    click("#draw-pressure_pa-slider")
    assert value("[studio.room.pattern.parameters.grain.default, studio.room.one.pressure_pa]") == [250, "$pressure"]
    click("#draw-copy")
    page.page.locator("#draw-shape").select_option("line")
    assert value("studio.room.pattern.spot.map((spot) => spot.shape.name)") == ["points", "line"]
    click("#draw-delete")
    page.page.locator("#draw-whole-duration_s").fill("0.2")
    press("Tab")
    page.until(f"{SEEN} && !document.querySelector('#draw-play').disabled", timeout=120)
    click("#draw-play")
    page.until(f"/^SIMULATED: played 800 frames/.test({said.replace('said', 'played')})", timeout=120)
    page.page.locator("#draw-name").fill("grainy")
    click("#draw-save-drive")
    page.until(f"{said} === 'saved grainy.toml and grainy.drive.h5'", timeout=60)
    saved = tomllib.loads((studio.folder / "grainy.toml").read_text(encoding="utf-8"))
    click("#draw-save")
    page.page.locator("dialog[open]").get_by_role("button", name="Cancel", exact=True).click()
    page.until(f"{said} === 'not saved'")
    page.page.get_by_role("button", name="pulse").click()
    page.page.locator("#draw-open").select_option("grainy.toml")
    page.until("studio.room.pattern.name === 'grainy'")
    assert value("studio.room.pattern") == saved

    # Key frames are moved by arrow keys and mouse.
    keys = "studio.room.one.key.map((key) => [key.at_s, ...key.centre_mm, key.part ?? 1])"
    page.page.get_by_role("button", name="texture on a spot").click()
    click("#draw-key-add")
    click("#draw-key-add")
    assert value(keys) == [[0, 0, 0, 1], [0.5, 0, 0, 1], [1, 0, 0, 1]]
    page.page.locator('[data-key="1"]').focus()
    page.press("Shift+ArrowRight", "ArrowLeft", "ArrowDown")
    page.page.locator('[data-handle="0.k2"]').focus()
    press("Shift+ArrowUp")
    assert value(keys) == [[0, 0, 0, 1], [0.59, 0, 0, 0.95], [1, 0, 5, 1]]
    page.page.locator('[data-key="1"]').focus()
    page.page.locator("#draw-key-ease").select_option("step")
    box, across = page.page.locator(".times").bounding_box(), (26 + 364 * 0.65) / 400
    page.page.mouse.dblclick(box["x"] + across * box["width"], box["y"] + 0.5 * box["height"])
    assert value(keys)[2] == [0.65, 0, 0, 0.95], "a jump holds until the next key"
    for _ in range(2):
        press("Control+z")
    page.page.locator('[data-key="1"]').focus()
    press("Delete")
    assert value(keys) == [[0, 0, 0, 1], [1, 0, 5, 1]]
    page.page.locator("#draw-shape").select_option("svg")
    page.page.locator("#draw-svg").fill("M0 0H9V9")
    press("Tab")
    page.until(SEEN, timeout=120)
    assert value("studio.room._path(studio.room.one)[200].map(Math.round)") == [20, 20]
    page.page.get_by_role("button", name="line stroke").click()
    click("#draw-key-add")
    page.until(SEEN, timeout=120)
    for _ in page.shown("draw", tmp_path, ("dark", 1280), ("light", 1280), ("dark", 390), ("light", 390)):
        page.page.locator("main").evaluate("(main) => main.scrollTo(0, 0)")
        assert page.unhelped() == []


def test_a_designer_draws_two_touches_for_a_study(studio_at, look, tmp_path):
    """A curl with key frames, a recorded texture in a loop that is changed while it plays; a study offers both."""
    page, kept = look(studio := studio_at()), os.environ.get("MIDAIR_PICTURES", tmp_path)
    until, value = (lambda script: page.until(script, timeout=300)), page.page.evaluate
    acts = "for (const name of ['click', 'change', 'pointerup']) addEventListener(name, (one) => { studio.acts += "
    acts += "name !== 'pointerup' || one.target.closest?.('svg') ? 1 : 0; }, true);"
    value(f"() => {{ studio.acts = 0; {acts} }}")
    button = lambda name: page.page.get_by_role("button", name=name, exact=True)  # noqa: E731
    said = lambda words: until(f"document.querySelector('#draw-said').innerText === {words!r}")  # noqa: E731

    def drag(selector, *way):
        """Move the pointer over the picture of the palm, in mm, or of the time line, in its own units."""
        page.page.locator(selector).scroll_into_view_if_needed()
        box, times = page.page.locator(selector).bounding_box(), "times" in selector
        for number, (x, y) in enumerate(way):
            across, up = (x / 400, y / 84) if times else (x / 2 / HALF + 0.5, 0.5 - y / 2 / HALF)
            page.page.mouse.move(box["x"] + across * box["width"], box["y"] + up * box["height"], steps=4)
            if number == 0:
                page.page.mouse.down()
        page.page.mouse.up()

    page.page.get_by_role("link", name="Draw").click()
    until(f"studio.name === 'draw' && {SEEN}")
    # A curl, drawn by hand, that wanders to the right and fades.
    drag(".palm-picture svg", (-25, -8), (-15, 5), (-5, -8), (-16, -14), (-24, -9))
    button("Add a key").click()
    page.page.locator('[data-handle="0.k1"]').focus()
    page.press(*6 * ["Shift+ArrowRight"])
    drag(".times", (390, 12), (390, 47))
    until(SEEN)
    page.page.screenshot(path=f"{kept}/draw-2-key-frames.png")  # for the documentation
    page.page.locator("#draw-name").fill("curl")
    button("Save").click()
    said("saved curl.toml")

    # A recorded texture on a spot that moves up the palm.
    button("texture on a spot").click()
    until("[...document.querySelector('#draw-signal').options].some((one) => one.value === 'sample:towel')")
    page.page.locator("#draw-signal").select_option("sample:towel")
    until("!!studio.room.one.signal")
    page.page.locator("#draw-am").uncheck()
    button("Add a key").click()
    page.page.locator('[data-handle="0.k1"]').focus()
    page.press(*5 * ["Shift+ArrowUp"])
    until(f"{SEEN} && !document.querySelector('#draw-play').disabled")
    page.page.locator("#draw-loop").check()
    page.page.locator("#draw-play").click()
    until("studio.room.looping && studio.link.state.player.emitting")
    page.page.locator("#draw-pressure_pa").fill("80")
    page.press("Tab")
    until("document.querySelector('#draw-played').innerText === 'playing in a loop, with this change'")
    page.press("Escape")
    until("!studio.room.looping")
    page.page.locator("#draw-name").fill("cloth")
    button("Save").click()
    said("saved cloth.toml")

    page.page.get_by_role("link", name="Study").click()
    until("document.querySelectorAll('#own-study option[value$=\".toml\"]').length === 2")
    assert value("studio.acts") < 60
    curl, cloth = (load_pattern(studio.folder / f"{name}.toml") for name in ("curl", "cloth"))
    assert 3 <= len(curl.spot[0].shape.corners_mm) <= 12
    assert [(key.centre_mm, key.part) for key in curl.spot[0].key] == [((0, 0), 1), ((30, 0), 0.3)]
    assert cloth.foci().pressure.max() == pytest.approx(80, abs=1)
    assert cloth.foci().pressure.std() > 5, "the take modulates it"
