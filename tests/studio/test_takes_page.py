"""Takes in a real browser: edits with preview, notes, marks, folders, zoom, a project, and a session by keyboard."""

import os

import numpy as np
import pytest

from midair.files import load, save
from midair.model import Recording

pytestmark = pytest.mark.browser


@pytest.fixture
def takes_at(studio_at):
    """A studio with two takes."""

    def open_studio():
        studio, rng = studio_at(), np.random.default_rng(1)
        for name in ("denim", "wool"):
            samples = 20 * rng.uniform(0, 1, size=(200, 4, 4))
            save(Recording(samples=samples, rate=1000, unit="Pa"), studio.folder / f"{name}.h5")
        return studio

    return open_studio


@pytest.mark.timeout(1800)
def test_edits_are_previewed_and_notes_marks_and_folders_are_kept(takes_at, look, tmp_path):
    studio = takes_at()
    page = look(studio, reduced_motion="reduce")
    button = lambda name: page.page.get_by_role("button", name=name, exact=True)  # noqa: E731
    seen, label = page.page.locator("#edit-preview"), page.page.get_by_label
    page.go("#reproduce/wool.h5")
    page.until("studio.room.take?.name === 'wool.h5'", timeout=400)
    for kind, field, value, words in (
        ("mask", "Channels", "0,1", "preview: 0.200 s"),
        ("mask", "Channels", "99", "99"),
        ("join", "Take", None, "preview: 0.400 s"),
    ):
        button("Edit").click()
        label("Edit", exact=True).select_option(kind)
        label(field, exact=True).fill(value) if value else label(field, exact=True).select_option("denim.h5")
        label(field, exact=True).press("Enter" if value == "99" else "Tab")
        page.until(f"document.querySelector('#replace[open]').textContent.includes({words!r})", timeout=400)
        assert seen.locator("svg").count() == (value != "99")
        button("Make the take" if kind == "join" else "Cancel").click()
    page.until("studio.room.take?.name === 'wool-01.h5'", timeout=400)
    joined, *parts = (load(studio.folder / f"{one}.h5").samples for one in ("wool-01", "wool", "denim"))
    assert (np.asarray(joined) == np.concatenate(parts)).all()
    page.page.locator("#main").focus()
    page.page.evaluate("studio.room.transport.seek(123)")
    page.page.keyboard.press("m")
    label("name of the mark at 0.123 s").fill("a rib")
    label("notes on this take").fill("soft at the end")
    page.until("studio.room.take.facts.written.text === 'soft at the end'")
    page.page.wait_for_timeout(1000)  # notes are kept a moment after the last letter
    button("Rename").click()
    label("New name").fill("wool/felt")
    label("New name").press("Enter")
    page.until("studio.room.take?.name === 'wool/felt.h5'")
    gain = label("Gain", exact=True)
    gain.fill("")
    gain.press("Tab")
    assert gain.input_value() == "1", "an empty number is the usual one"
    assert page.serious() == []
    page.page.screenshot(path=f"{os.environ.get('MIDAIR_PICTURES', tmp_path)}/notes.png")
    page.page.get_by_label("order of the takes").select_option("name")
    names = "[...document.querySelectorAll('.takes a')].map((one) => one.dataset.take).slice(0, 3).join()"
    assert page.page.evaluate(names) == "denim.h5,wool.h5,wool/felt.h5"
    button("Delete").click()
    page.page.locator("#undo").click()
    page.until("studio.room.take?.name === 'wool/felt.h5'")
    page.page.reload()
    page.until("studio.room?.take?.name === 'wool/felt.h5'")
    assert label("notes on this take").input_value() == "soft at the end"
    assert label("name of the mark at 0.123 s").input_value() == "a rib"
    button("Export").click()
    label("Of", exact=True).select_option("folder")
    page.page.locator("#replace").get_by_role("button", name="Export").click()
    page.until("!!document.querySelector('#exported')")
    (project,) = (studio.folder / "exports").glob("*.zip")
    other = takes_at()
    (other.folder / "wool.h5").unlink()
    there = look(other)
    there.until("studio.room?.add && !studio.room.add.disabled")
    there.page.locator("input[type=file]").set_input_files(project)
    there.until("document.querySelector('#toasts').textContent.includes('denim.h5, which exists already')")
    assert not (other.folder / "wool").exists(), "nothing is written of a project that does not fit"
    (other.folder / "denim.h5").unlink()
    there.page.locator("input[type=file]").set_input_files(project)
    there.until("studio.link.state.takes.some((row) => row.name === 'wool/felt.h5')")
    assert (other.folder / "wool" / "felt.h5").read_bytes() == (studio.folder / "wool" / "felt.h5").read_bytes()
    assert page.wrong == []


def test_time_is_zoomed_by_drag_and_wheel_and_a_part_is_chosen(takes_at, look):
    page = look(takes_at(), reduced_motion="reduce")
    for address, words in (
        ("reproduce/%", "% cannot be opened"),
        ("compare/gone.h5", "gone.h5: there is no such take"),
    ):
        page.go(f"#{address}")
        page.until(f"document.querySelector('#main').innerText.includes({words!r})")
    page.go("#reproduce/wool.h5")
    page.until("studio.room.take?.pictures.length && studio.room.take.samples.last > 150", timeout=400)
    mouse, value = page.page.mouse, page.page.evaluate

    def drag(box, first, last):
        mouse.move(box["x"] + first * box["width"], box["y"] + box["height"] / 3)
        mouse.down()
        mouse.move(box["x"] + last * box["width"], box["y"] + box["height"] / 3, steps=4)
        mouse.up()

    cells = page.page.locator("#box-traces canvas").bounding_box()
    drag(cells, 0.5, 0.75)
    assert 0.03 < value("studio.room.transport.span") < 0.07, "a quarter of 0.2 s, and no more"
    mouse.wheel(0, 100)
    page.until("studio.room.transport.span > 0.05")
    drag(page.page.locator("#transport canvas").bounding_box(), 0.25, 0.75)
    loop = value("studio.room.transport.loop")
    assert (loop["from"], loop["to"], loop["on"]) == (pytest.approx(50, abs=2), pytest.approx(150, abs=2), True)
    page.page.locator("#main").focus()
    page.page.keyboard.press("Delete")
    page.until("studio.room.take?.name === 'wool-01.h5'", timeout=400)
    assert value("studio.room.take.facts.frames") == 200 - (loop["to"] - loop["from"])
    assert page.wrong == []


@pytest.mark.timeout(600)
def test_a_session_by_keyboard_alone(takes_at, look):
    """Choose a take, solve it quickly, play it on the virtual array and read the comparison; no mouse."""
    page = look(takes_at(), reduced_motion="reduce")
    page.until("document.querySelectorAll('.takes a').length === 6", timeout=120)
    page.go("#reproduce/sample:orbit")
    page.until("studio.room?.take?.name === 'sample:orbit'", timeout=120)
    press, value = page.page.keyboard.press, page.page.evaluate
    assert " of 10 people " in page.page.locator(".reproduce .verdict").inner_text()
    assert page.page.locator(".reproduce .verdict").bounding_box()["y"] < 120, "on top of the panel"

    def tab_to(words):
        """Press Tab until the element in focus has these words."""
        for _ in range(80):
            press("Tab")
            if (
                value("(({labels, textContent}) => (labels?.[0] ?? {textContent}).textContent)(document.activeElement)")
                == words
            ):
                return
        raise AssertionError(words)

    value("document.activeElement.blur()")
    tab_to("orbitsample")
    press("Home")
    press("Enter")
    page.until("studio.room.take?.name === 'wool.h5'")
    tab_to("Mode")
    press("q")
    page.until("studio.room.made.mode === 'quick'")
    tab_to("Solve")
    press("Enter")
    page.until("!studio.room.play.disabled", timeout=300)
    tab_to("Play on array")
    press("Enter")
    page.until("document.querySelector('#hold')?.disabled === false", timeout=60)
    tab_to("Play")
    press("Enter")
    page.until("!!document.querySelector('#to-compare')", timeout=120)
    tab_to("Compare")
    press("Enter")
    page.until("studio.name === 'compare' && !!studio.room.found", timeout=120)
    assert "felt" in page.page.locator(".compare").inner_text()
    press("Escape")
    assert page.wrong == []
