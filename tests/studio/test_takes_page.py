"""Takes in a real browser: edits with preview, notes, marks, folders, zoom, a project, and a session by keyboard."""

import numpy as np
import pytest
from tests.waiting import wait_until

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


def test_takes_are_found_and_edited_and_notes_marks_and_folders_are_kept(takes_at, look):
    studio = takes_at()
    page = look(studio)
    button = lambda name: page.page.get_by_role("button", name=name, exact=True)  # noqa: E731
    seen, label = page.page.locator("#edit-preview"), page.page.get_by_label
    page.take("wool.h5")
    page.page.get_by_role("searchbox").fill("den")
    page.until("[...document.querySelectorAll('.takes li:not([hidden])')].length === 1")
    page.page.get_by_role("searchbox").fill("")
    assert page.page.locator(".takes").bounding_box()["height"] > 100, "four takes are seen without scrolling"
    listed = "[...document.querySelectorAll('.takes a')]"
    tabbed = f"{listed}.filter((one) => one.tabIndex === 0).map((one) => one.dataset.take)"
    assert page.page.evaluate(tabbed) == ["wool.h5"], "Tab reaches the chosen take, and then the settings"
    page.until(f"{listed}.length === 6")
    page.page.locator(".takes [tabindex='0']").focus()
    page.press("Home", "ArrowDown", "ArrowUp", "End", "ArrowUp", "Enter")
    page.until("studio.room?.take?.name === 'sample:brush'")
    page.take("wool.h5")
    page.page.get_by_role("link", name="Compare").click()
    page.until("studio.room.name === 'wool.h5'")
    page.page.get_by_role("link", name="Reproduce").click()
    page.until("studio.room?.take?.name === 'wool.h5'")
    button("Duplicate").click()
    page.until("studio.room?.take?.name === 'wool-01.h5'")
    page.take("wool.h5")
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
    page.until("studio.room.take?.name === 'wool-02.h5'", timeout=400)
    joined, *parts = (load(studio.folder / f"{one}.h5").samples for one in ("wool-02", "wool", "denim"))
    assert (np.asarray(joined) == np.concatenate(parts)).all()
    page.page.locator("#main").focus()
    page.page.evaluate("studio.room.transport.seek(123)")
    page.press("m")
    label("name of the mark at 0.123 s").fill("a rib")
    label("notes on this take").fill("soft at the end")
    page.until("studio.room.take.facts.written.text === 'soft at the end'")
    notes = studio.folder / "wool-02.notes.json"
    wait_until(lambda: notes.exists() and "soft at the end" in notes.read_text(encoding="utf-8"))
    button("Rename").click()
    label("New name").fill("wool/felt")
    label("New name").press("Enter")
    page.until("studio.room.take?.name === 'wool/felt.h5'")
    gain = label("Gain", exact=True)
    gain.fill("")
    gain.press("Tab")
    assert gain.input_value() == "1", "an empty number is the usual one"
    assert page.serious() == []
    page.page.get_by_label("order of the takes").select_option("name")
    names = f"{listed}.map((one) => one.dataset.take).slice(0, 4).join()"
    assert page.page.evaluate(names) == "denim.h5,wool-01.h5,wool.h5,wool/felt.h5"
    button("Delete").click()
    page.until("!studio.link.state.takes.some((row) => row.name === 'wool/felt.h5')")
    page.page.locator("#undo").click()
    page.until("studio.room.take?.name === 'wool/felt.h5'")
    page.page.reload()
    page.until("studio.room?.take?.name === 'wool/felt.h5'")
    assert label("notes on this take").input_value() == "soft at the end"
    assert label("name of the mark at 0.123 s").input_value() == "a rib"
    button("Export").click()
    label("Of", exact=True).select_option("folder")
    page.page.locator("#replace").get_by_role("button", name="Export").click()
    page.until("document.querySelector('#exported')?.download.endsWith('.zip')")
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
    there.wrong.clear()  # the project that was refused, and takes that the test removed
    assert (other.folder / "wool" / "felt.h5").read_bytes() == (studio.folder / "wool" / "felt.h5").read_bytes()


def test_time_is_zoomed_by_drag_and_wheel_and_a_part_is_chosen(takes_at, look):
    page = look(takes_at())
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
    page.press("Delete")
    page.until("studio.room.take?.name === 'wool-01.h5'", timeout=400)
    assert value("studio.room.take.facts.frames") == 200 - (loop["to"] - loop["from"])


def test_a_session_by_keyboard_alone(takes_at, look):
    """Choose a take, solve it quickly, play it on the virtual array and read the comparison; no mouse."""
    page = look(takes_at())
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
